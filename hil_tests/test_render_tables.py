"""The tables and the page of the render bench, from outcomes that are written by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from hil_tests.render.document import document
from hil_tests.render.rigs import draw
from hil_tests.render.table import error_ratios, markdown, summarise
from hil_tests.render.trial import Outcome


def outcome(seed: int, law: str, rms_nm: float, **more: object) -> Outcome:
    plain = Outcome(
        seed=seed,
        apart=False,
        law=law,
        task="free",
        rms_nm=rms_nm,
        peak_nm=2.0 * rms_nm,
        felt_friction_nm=rms_nm,
        stiffness=1.0,
        limit_cycle=False,
        net_energy=-0.5,
        net_energy_to_friction=-0.5,
        slack=0.0,
        bridge_off=False,
        fallback=0.0,
    )
    return replace(plain, **more)  # type: ignore[arg-type]


def test_summary_compares_each_rig_with_its_own_naive_error() -> None:
    law = "model-inversion"
    outcomes = [
        *(outcome(seed, "none", 1.0) for seed in range(1, 6)),
        *(outcome(seed, law, 0.1 * seed, felt_friction_nm=-0.02) for seed in range(1, 5)),
        outcome(5, law, 1.5, net_energy=0.02, limit_cycle=True, bridge_off=True),
        # a second task of rig 5, in which the law is right: pooled, it is (1.5^2 / 2)^(1/2) worse
        outcome(5, "none", 1.0, task="tunnel"),
        outcome(5, law, 0.0, task="tunnel"),
    ]
    found = summarise(outcomes, law)
    assert found.rigs == 5
    assert error_ratios(outcomes, law)[5] == pytest.approx(1.5 / math.sqrt(2.0))
    assert found.ratio_median == pytest.approx(0.3)
    assert found.ratio_worst == pytest.approx(1.5 / math.sqrt(2.0))
    assert found.trials_above_naive == pytest.approx(1.0 / 6.0)
    assert found.felt_median == pytest.approx(0.02)
    assert (found.active, found.limit_cycles, found.stopped) == (1, 1, 1)
    assert found.energy_worst == pytest.approx(0.02)
    assert f"| {law} | 0.300 " in markdown(outcomes)


def test_page_names_the_rigs_that_are_worst_for_ours() -> None:
    law = "model-inversion"
    seeds = [seed for seed in range(1, 20) if not draw(seed).apart][:7]
    outcomes = [outcome(seed, "none", 1.0) for seed in seeds]
    outcomes += [outcome(seed, law, 0.1 * (i + 1)) for i, seed in enumerate(seeds)]
    page = document(outcomes, 1, 7, {"render.emulated.ratio_median": 0.1234})
    worst = page.split(f"## Where {law} does worst")[1]
    assert worst.index(f"| {seeds[6]} | 0.700 ") < worst.index(f"| {seeds[5]} | 0.600 ")
    assert f"| {seeds[1]} | 0.200" not in worst  # the five worst only
    assert "| render.emulated.ratio_median | 0.1234 |" in page
    assert "the seeds 1 to 7" in page


def test_rigs_beyond_their_motor_are_summed_up_apart() -> None:
    outcomes = [
        outcome(1, "none", 1.0),
        outcome(1, "coulomb", 0.5),
        outcome(2, "none", 1.0, apart=True),
        outcome(2, "coulomb", 0.9, apart=True),
    ]
    counted, apart = markdown(outcomes).split("## 1 rigs apart")
    assert "| coulomb | 0.500 " in counted
    assert "| coulomb | 0.900 " in apart
