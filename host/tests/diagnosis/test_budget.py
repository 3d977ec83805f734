from __future__ import annotations

import numpy as np
import pytest
from bowden.diagnosis.budget import Compared, gap_budget
from bowden.signals.repeatability import find_cycles

TIME_S = np.arange(10000) * 1e-3
WAVE = np.sin(2 * np.pi * 0.5 * TIME_S)


def part(measured: np.ndarray, zero: str = "a", *, cyclic: bool = False) -> Compared:
    return Compared(TIME_S, measured, WAVE, find_cycles(TIME_S, WAVE) if cyclic else None, zero)


def test_a_constant_and_a_gain_take_what_they_are_worth() -> None:
    steps = gap_budget("load_torque_nm", [part(1.1 * WAVE + 0.2)])
    # 0.2 squared against 0.1 squared over 2: 8/9 and 1/9 of the squared gap.
    assert [one.share for one in steps] == pytest.approx([8 / 9, 1 / 9, 0.0], abs=1e-6)
    assert steps[0].value == pytest.approx(0.2)
    assert steps[1].value == pytest.approx(0.1)
    assert sum(one.share for one in steps) == pytest.approx(1.0)


def test_recordings_that_share_a_zero_share_the_constant() -> None:
    own = gap_budget("q", [part(WAVE + 0.1, "a"), part(WAVE - 0.1, "b")])
    shared = gap_budget("q", [part(WAVE + 0.1, "a"), part(WAVE - 0.1, "a")])
    assert own[0].share == pytest.approx(1.0)
    assert shared[0].share == pytest.approx(0.0, abs=1e-12)


def test_what_repeats_is_told_from_what_does_not() -> None:
    noise = np.random.default_rng(2).normal(0.0, 0.01, TIME_S.size)
    third = 0.05 * np.sin(2 * np.pi * 1.5 * TIME_S)
    steps = {one.step: one for one in gap_budget("q", [part(WAVE + third + noise, cyclic=True)])}
    assert steps["repeats in every cycle"].share == pytest.approx(0.93, abs=0.03)
    assert steps["repeats in every cycle"].gap_after == pytest.approx(0.01, rel=0.35)


def test_no_gap_has_no_budget() -> None:
    assert gap_budget("q", [part(WAVE)]) == ()
