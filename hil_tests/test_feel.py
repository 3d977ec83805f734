"""The pages of the benchmark of feel: bounds, intervals, causes of the worst trials, pictures."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from hil_tests.render.bounds import bound_nm, crossing_time_s, informed, wave_bound_nm
from hil_tests.render.calibrated import calibrated
from hil_tests.render.causes import causes, put_right
from hil_tests.render.disturbed import ALL_TASKS, DISTURBED
from hil_tests.render.feel_page import page
from hil_tests.render.feel_picture import Panel, picture
from hil_tests.render.feel_table import interval, is_active, pooled_ratios, wilson
from hil_tests.render.feel_task_page import ABOUT, task_pages
from hil_tests.render.laws import OURS, law_named
from hil_tests.render.released import KNOT_TICKS, KNOTS, Released, Window, commanded_nm
from hil_tests.render.rigs import draw, told_truth
from hil_tests.render.tasks import task_named
from hil_tests.render.trial import Outcome, run
from hil_tests.test_render_tables import outcome


def test_wave_bound_is_that_of_the_closed_form() -> None:
    rig, steps = draw(3), task_named("steps")
    cable = rig.rig.cable
    late_s = 2.0 * math.sqrt(cable.mass_per_length_kg_per_m / cable.axial_stiffness_n)
    level = rig.ratio * rig.tunnel.limit_nm
    # from 0.5 s on: 0 to 1, to 0.5, to -0.5, to -1, to 0
    squares = level**2 * (1.0 + 0.25 + 1.0 + 0.25 + 1.0)
    assert wave_bound_nm(rig, steps) == pytest.approx(math.sqrt(squares * late_s / 2.5))
    assert wave_bound_nm(rig, task_named("tunnel")) == 0.0


def test_motor_crosses_the_backlash_as_fast_as_torque_and_slew_allow() -> None:
    """An inertia driven by the greatest torque, turned round half way, or by the steepest."""
    rig = draw(3)
    takes_s = crossing_time_s(rig, 0.1)
    cable, motor = rig.rig.cable, rig.rig.motor
    force_n = rig.friction_nm / motor.pulley_radius_m
    backlash_rad = (
        force_n * cable.length_m / (2.0 * cable.axial_stiffness_n) / motor.pulley_radius_m
    )
    most_nm = rig.motor_limit_nm + 0.1 + rig.friction_nm
    slew_nm_per_s = rig.motor_limit_nm / 5e-3
    time_s = np.linspace(0.0, takes_s, 20_001)
    step_s = time_s[1]
    turned_round = np.where(time_s < 0.5 * takes_s, most_nm, -most_nm)
    # up, down through zero and up again, a quarter, a half and a quarter of the time
    phase = time_s / takes_s
    steepest = slew_nm_per_s * takes_s * np.where(
        phase < 0.25, phase, np.where(phase < 0.75, 0.5 - phase, phase - 1.0)
    )  # fmt: skip
    reached = [
        float(np.sum(np.cumsum(torque)) * step_s**2 / motor.inertia_kg_m2)
        for torque in (turned_round, steepest)
    ]
    assert min(reached) == pytest.approx(backlash_rad, rel=1e-3)


def test_bound_of_a_release_is_less_than_friction_that_stays_as_long() -> None:
    rig, release = draw(3), task_named("release", DISTURBED)
    whole_nm = 2.0 * rig.ratio * rig.friction_nm
    share = crossing_time_s(rig, 0.1) / (release.duration_s - release.scored_from_s)
    assert 0.0 < bound_nm(rig, release) < whole_nm * math.sqrt(share)
    stronger = replace(rig, motor_limit_nm=4.0 * rig.motor_limit_nm)
    assert bound_nm(stronger, release) < bound_nm(rig, release)
    assert bound_nm(rig, task_named("tunnel")) == 0.0


def test_search_after_a_release_runs_on_the_plant_of_the_trial() -> None:
    """The law's own motor torque brings the law's own error; what is searched for is feasible."""
    rig, release = draw(6), task_named("release", DISTURBED)
    trial = run(rig, law_named(OURS), release)
    plant = Released(rig, release, commanded_nm(trial))
    _, error_nm, _ = plant.advance(plant.start, plant.first, plant.by_law_nm)
    assert error_nm == pytest.approx(trial.error_nm[plant.first :], abs=1e-5)
    window = Window(plant, plant.start, plant.first, plant.motor_nm)
    held = np.full(KNOTS, plant.motor_nm)
    knots = window.search(held)
    least = min(np.sum(window.error_nm(x) ** 2) for x in window.guesses(held))
    assert np.sum(window.error_nm(knots) ** 2) < least
    torque_nm = np.append(plant.motor_nm, window.torque_nm(knots))
    assert np.max(np.abs(torque_nm)) <= rig.motor_limit_nm
    slew_nm = rig.motor_limit_nm / 5e-3 / 4000  # a tick
    assert np.max(np.abs(np.diff(torque_nm))) <= slew_nm * (1.0 + 1e-9)
    assert len(torque_nm) == KNOTS * KNOT_TICKS + 1


def test_informed_drive_believes_the_truth_and_is_not_late() -> None:
    told = informed(draw(3))
    assert told.belief.friction == told.rig.cable.friction
    assert told.rig.sensing.load_encoder_delay_ticks == 0
    assert told.hidden == draw(3).hidden


def test_intervals_are_wilsons_and_cover_the_quantile() -> None:
    low, high = wilson(0, 100)
    assert (low, high) == pytest.approx((0.0, 0.0370), abs=1e-4)  # z^2 / (n + z^2)
    assert wilson(50, 100) == pytest.approx((0.4038, 0.5962), abs=1e-4)
    middle, low, high = interval(list(np.linspace(0.0, 1.0, 101)), 0.5)
    # +- 1.96 * 0.5 / sqrt(101) = 0.0975 for the median of evenly spread values
    assert middle == 0.5
    assert 0.07 < 0.5 - low < 0.13
    assert 0.07 < high - 0.5 < 0.13


class Ran:
    """A run of the benchmark of feel."""

    bound_nm = 0.1

    def __init__(self, outcome: Outcome) -> None:
        self.outcome = outcome


def test_page_of_feel_pools_tasks_and_counts_active_paths() -> None:
    seeds = [seed for seed in range(1, 9) if not draw(seed).apart][:3]
    outcomes = [outcome(s, "none", 2.0, task=t) for s in seeds for t in ("tunnel", "tremor")]
    outcomes += [outcome(s, OURS, 0.2, task="tunnel") for s in seeds]
    outcomes += [outcome(s, OURS, 0.2 * i, task="tremor") for i, s in enumerate(seeds, 1)]
    outcomes[-1] = replace(outcomes[-1], turn_energy=0.02)
    assert pooled_ratios(outcomes, OURS, lambda t: t == "tunnel") == pytest.approx([0.1] * 3)
    assert [is_active(o) for o in outcomes[-2:]] == [False, True]
    text = page({"rig": [Ran(o) for o in outcomes]}, "Version 1", (0.05, 0.01))
    assert "| trials with an active path | 0 | 1 of 6 [3.0%, 56.4%] |" in text
    assert "| like tasks, median | 0.06 / 0.14 | 0.100 [0.100, 0.100] |" in text
    assert "| [tremor](feel/tremor.md) | 0.200 | 0.050 |" in text


def test_every_task_of_feel_is_explained() -> None:
    assert list(ABOUT) == [task.name for task in ALL_TASKS]


def test_causes_of_a_trial_are_what_put_right_takes_its_error() -> None:
    seed = next(s for s in range(1, 999) if "load_cell_offset" in draw(s).hidden)
    rig, rest = draw(seed), replace(task_named("rest-in-middle"), duration_s=1.2)
    assert set(draw(seed, without=("load_cell_offset",)).hidden) < set(rig.hidden)
    names = [name for name, _ in put_right(rig)]
    assert "without load_cell_offset" in names
    # an error a thousand times as large as any: each thing put right leaves next to nothing of it
    found = causes(rig, law_named(OURS), rest, "rig", 1e3)
    assert {cause.put_right for cause in found} == set(names)
    assert [c.left for c in found] == sorted(c.left for c in found)
    assert not causes(rig, law_named(OURS), rest, "rig", 1e-6)


def test_task_page_shows_the_worst_trial_and_its_picture() -> None:
    seed, rest = 3, replace(task_named("rest-in-middle"), duration_s=1.2)
    runs = [
        Ran(outcome(seed, "none", 2.0, task=rest.name)),
        Ran(outcome(seed, OURS, 0.5, task=rest.name)),
    ]
    files = dict(task_pages({"rig": runs}, [rest]))
    assert list(files) == ["rest-in-middle.svg", "rest-in-middle.md"]
    assert f"| `{OURS}` | 0.25 | {seed}, simulated rig |" in files["rest-in-middle.md"]
    assert files["rest-in-middle.svg"].count("worst: rig 3") == 2  # drawn, and told to who listens


def test_picture_keeps_extremes_and_stays_in_its_panel() -> None:
    spike = np.zeros(4000)
    spike[1234] = 7.0
    text = picture(
        [Panel("<one>", np.arange(4000) / 4000.0, {"spike": spike, "wanted": 0 * spike})]
    )
    assert "&lt;one&gt;" in text
    drawn = re.findall(r'd="M([^"hH]+)" fill="none"', text)
    heights = [float(p.split()[1]) for path in drawn for p in path.split("L")]
    # 4 % above and below the curves, within a panel of 300 with 50 above and 36 below
    assert min(heights) == pytest.approx(50.0 + 214.0 * 0.04 / 1.08, abs=0.2)
    assert max(heights) == pytest.approx(264.0 - 214.0 * 0.04 / 1.08, abs=0.2)


def test_a_calibration_without_a_cell_finds_friction_and_stiffness() -> None:
    """On a rig whose hidden effects touch neither: the friction to 3 %, which the resolution of the
    ramps allows; the stiffness to 5 %, as the rig's cables are not quite linear."""
    rig = draw(10)  # its motor is heavier and has an offset of its torque
    truth, found = told_truth(rig), calibrated(rig).belief
    assert abs(rig.belief.axial_stiffness_n / truth.axial_stiffness_n - 1.0) > 0.1
    friction = found.friction * found.pretension_n
    assert friction == pytest.approx(truth.friction * truth.pretension_n, rel=0.03)
    assert found.axial_stiffness_n == pytest.approx(truth.axial_stiffness_n, rel=0.05)
    assert found.friction_deviation < 0.25 * rig.belief.friction_deviation
