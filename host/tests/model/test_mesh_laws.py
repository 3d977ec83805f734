"""Laws that any correct model of the pair obeys, on random rigs and random motion.

Mirror, scaling, stiffness, rate independence, duality of the modes, dwell, dither, energy. The
tolerances are rounding, grown by some thousand steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Mode, Trajectory, Transmission
from bowden.model.mesh.solver import simulate_mesh
from bowden.model.mesh.state import breakaway_excesses, cut
from hypothesis import given, settings
from hypothesis import strategies as st

from .rigs import FloatArray, printed, rigs, series_for, through, times, walks

EXACT = 1e-9
MODES = st.sampled_from(list(Mode))
few = settings(max_examples=40, deadline=None, derandomize=True)


def tensions(found: Trajectory) -> FloatArray:
    return np.stack(
        [
            found.motor_tension_a_n,
            found.load_tension_a_n,
            found.motor_tension_b_n,
            found.load_tension_b_n,
        ]
    )


def angles(found: Trajectory) -> FloatArray:
    return np.stack([found.motor_angle_rad, found.load_angle_rad])


def assert_close(a: FloatArray, b: FloatArray, scale: float, share: float = EXACT) -> None:
    np.testing.assert_allclose(a, b, rtol=0, atol=share * max(scale, np.abs(b).max()))


@few
@given(rigs(stiction=False), MODES, walks, walks)
def test_mirror(pair: Transmission, mode: Mode, motor: list[float], load: list[float]) -> None:
    """theta -> -theta, tau -> -tau swaps the cables and nothing else."""
    t, x, y = series_for(pair, mode, motor, load)
    found, mirrored = simulate_mesh(pair, mode, t, x, y), simulate_mesh(pair, mode, t, -x, -y)
    # To rounding: of two events at one moment the one of cable a is taken first.
    assert_close(tensions(mirrored)[[2, 3, 0, 1]], tensions(found), pair.pretension_n, 1e-12)
    assert_close(angles(mirrored), -angles(found), 1e-3, 1e-12)


@few
@given(rigs(), MODES, walks, walks, st.floats(0.01, 100))
def test_scaling_of_pretension_and_series(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float], factor: float
) -> None:
    t, x, y = series_for(pair, mode, motor, load)
    found = simulate_mesh(pair, mode, t, x, y)
    scaled_pair = replace(pair, pretension_n=factor * pair.pretension_n)
    scaled = simulate_mesh(scaled_pair, mode, t, factor * x, factor * y)
    assert_close(tensions(scaled), factor * tensions(found), factor * pair.pretension_n)
    assert_close(angles(scaled), factor * angles(found), factor * 1e-3)


@few
@given(rigs(), walks, walks, st.floats(0.1, 10))
def test_stiffness_only_stretches_the_motion(
    pair: Transmission, motor: list[float], load: list[float], factor: float
) -> None:
    mode = Mode.POSITION_POSITION
    t, x, y = series_for(pair, mode, motor, load)
    found = simulate_mesh(pair, mode, t, x, y)
    stiffer = replace(pair, axial_stiffness_n=factor * pair.axial_stiffness_n)
    other = simulate_mesh(stiffer, mode, t, x / factor, y / factor)
    assert_close(tensions(other), tensions(found), pair.pretension_n)


@few
@given(rigs(), MODES, walks, walks, st.floats(1e-3, 1e3))
def test_time_does_not_matter_without_rate_terms(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float], factor: float
) -> None:
    t, x, y = series_for(pair, mode, motor, load)
    found, slower = (simulate_mesh(pair, mode, time, x, y) for time in (t, factor * t))
    assert np.array_equal(tensions(slower), tensions(found))


@few
@given(rigs(stiction=True), MODES, walks, walks, st.integers(2, 7))
def test_the_step_does_not_matter(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float], parts: int
) -> None:
    """Lines in 3 or in 3 x parts steps: events are found within a step, stiction's drops too.

    Only that a zone sticks again is decided at samples, so here it never does. And stiction ends
    where the tension does, at a strain of 1e-9: what happens just there may fall either way.
    """
    pair = replace(pair, rest_time_s=1e9)
    t, x, y = series_for(pair, mode, motor, load, steps=3)
    fine_t = np.interp(np.arange((t.size - 1) * parts + 1), np.arange(t.size) * parts, t)
    found = simulate_mesh(pair, mode, t, x, y)
    fine = simulate_mesh(pair, mode, fine_t, np.interp(fine_t, t, x), np.interp(fine_t, t, y))
    assert_close(tensions(fine)[:, ::parts], tensions(found), pair.pretension_n, 1e-4)


def there_and_back(pair: Transmission, walk: list[float], share: float, steps: int) -> float:
    """Give a position-position run's torque to torque-position; the angle's relative error.

    Up to the first slack, where a torque leaves the angle open.
    """
    _, x, _ = series_for(pair, Mode.POSITION_POSITION, walk, walk, steps)
    x = 0.1 * x
    y = share * x * pair.motor_pulley_radius_m / pair.load_pulley_radius_m
    run = simulate_mesh(pair, Mode.POSITION_POSITION, times(x), x, y)
    whole = int(np.argmax(run.slack != 0)) if np.any(run.slack) else x.size
    if whole < 2:
        return 0.0
    taut = slice(0, whole)
    torque = run.motor_torque_nm[taut]
    again = simulate_mesh(pair, Mode.TORQUE_POSITION, times(x)[taut], torque, y[taut])
    error = float(np.abs(again.motor_angle_rad - x[taut]).max())
    return error / max(float(np.abs(x).max()), 1e-6)


@few
@given(rigs(), walks)
def test_modes_are_dual(pair: Transmission, walk: list[float]) -> None:
    """The torque that a position-position run needs, given as torque, returns its angles."""
    assert there_and_back(pair, walk, share=0.0, steps=25) < EXACT


@few
@given(rigs(), walks, st.floats(0, 1))
def test_modes_are_dual_while_the_load_moves_too(
    pair: Transmission, walk: list[float], share: float
) -> None:
    """Within a sample angle and torque take different straight lines: second order in the step."""
    assert there_and_back(pair, walk, share, steps=25) < 1e-3
    assert there_and_back(pair, walk, share, steps=500) < 1e-5


def test_duality_on_the_printed_rig() -> None:
    load = through(0, 0.5, -0.3, 0.4, steps=300)
    motor = 5.2 * load + 0.02 * np.sin(np.arange(load.size) / 40)
    pair = printed(50)
    run = simulate_mesh(pair, Mode.POSITION_POSITION, times(load), motor, load)
    assert not np.any(run.slack)
    again = simulate_mesh(pair, Mode.TORQUE_POSITION, times(load), run.motor_torque_nm, load)
    np.testing.assert_allclose(again.motor_angle_rad, motor, atol=1e-10)
    back = simulate_mesh(pair, Mode.POSITION_TORQUE, times(load), motor, run.load_torque_nm)
    np.testing.assert_allclose(back.load_angle_rad, load, atol=1e-10)


@few
@given(rigs(), MODES, walks, walks, st.integers(1, 20))
def test_a_dwell_leaves_no_trace(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float], dwell: int
) -> None:
    t, x, y = series_for(pair, mode, motor, load)
    found = simulate_mesh(pair, mode, t, x, y)
    i = t.size // 2
    stop = np.concatenate([np.arange(i + 1), np.full(dwell, i), np.arange(i + 1, t.size)])
    rested = simulate_mesh(pair, mode, times(stop), x[stop], y[stop])
    kept = np.concatenate([np.arange(i + 1), np.arange(i + 1 + dwell, stop.size)])
    assert_close(tensions(rested)[:, kept], tensions(found), pair.pretension_n)


@pytest.mark.parametrize("stiction", [False, True])
def test_four_hundred_one_count_dither_cycles_do_not_drift(stiction: bool) -> None:
    count = 2 * np.pi / 10_000
    approach = through(0, 0.3, -0.2, steps=400)
    dither = -0.2 + count * np.tile([1.0, 0.0], 400)
    angle = np.concatenate([approach, dither])
    pair = printed(50, mu_s=0.63, stiction_length_m=0.02) if stiction else printed(50)
    found = simulate_mesh(pair, Mode.TORQUE_POSITION, times(angle), np.zeros_like(angle), angle)
    up, down = found.load_torque_nm[-799::2], found.load_torque_nm[-800::2]
    assert np.ptp(up[1:]) < 1e-9
    assert np.ptp(down[1:]) < 1e-9
    assert np.ptp(found.motor_angle_rad[-798::2]) < 1e-9


@few
@given(rigs(), walks, walks)
def test_energy_is_never_created(pair: Transmission, motor: list[float], load: list[float]) -> None:
    """Work put in at both ends, standstill to standstill, is what friction took: never less."""
    mode = Mode.POSITION_POSITION
    _, x, y = series_for(pair, mode, [*motor, 0.0], [*load, 0.0])
    n = min(len(motor), len(load))
    x, y = (
        np.concatenate([s[: 25 * n + 1], s[25 * n] * np.linspace(1, 0, 26)[1:]]) for s in (x, y)
    )
    found = simulate_mesh(pair, mode, times(x), x, y)
    at_motor = np.trapezoid(found.motor_torque_nm, x)
    at_load = -np.trapezoid(found.load_torque_nm, y)
    # Both ends are back where they were, so no more energy is stored than in the virgin cables:
    # stress left locked in can only be less or more by what friction holds.
    stored = pair.pretension_n**2 * pair.length_m / pair.axial_stiffness_n
    assert at_motor + at_load >= -stored


@few
@given(rigs(), walks, walks)
def test_a_closed_cycle_costs_energy(
    pair: Transmission, motor: list[float], load: list[float]
) -> None:
    """The third turn of any closed way, which starts and ends on a nearly steady cycle."""
    mode = Mode.POSITION_POSITION
    n = min(len(motor), len(load), 5)
    loop_m, loop_l = [0.0, *motor[:n]], [0.0, *load[:n]]
    legs = [*(loop_m * 3)[1:], 0.0], [*(loop_l * 3)[1:], 0.0]
    _, x, y = series_for(pair, mode, *legs, steps=200)
    turn = 200 * (n + 1)
    found = simulate_mesh(pair, mode, times(x), x, y)

    def work(k: int) -> float:
        part = slice(k * turn, (k + 1) * turn + 1)
        return float(
            np.trapezoid(found.motor_torque_nm[part], x[part])
            - np.trapezoid(found.load_torque_nm[part], y[part])
        )

    size = pair.pretension_n**2 * pair.length_m / pair.axial_stiffness_n
    # The trapezoid misses what bends within a step; the steps are a 200th of a line.
    assert work(2) >= -2e-3 * max(size, abs(work(2)))


@few
@given(rigs(stiction=True), MODES, walks, walks)
def test_tension_stays_within_what_friction_can_hold(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float]
) -> None:
    t, x, y = series_for(pair, mode, motor, load)
    found = simulate_mesh(pair, mode, t, x, y)
    law = pair.friction
    ends = tensions(found)
    assert np.all(ends >= 0)
    # Every segment at its breakaway: more no state can hold.
    mesh = cut(pair)
    most = np.exp(law.mu_d * mesh.wrap_rad.sum() + breakaway_excesses(pair, mesh).sum())
    for near, far in ((0, 1), (1, 0), (2, 3), (3, 2)):
        assert np.all(ends[near] <= ends[far] * most * (1 + 1e-9) + 1e-12)


@few
@given(
    rigs(stiction=True), st.sampled_from([Mode.TORQUE_POSITION, Mode.POSITION_TORQUE]), walks, walks
)
def test_the_torque_asked_for_is_carried(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float]
) -> None:
    t, x, y = series_for(pair, mode, motor, load)
    found = simulate_mesh(pair, mode, t, x, y)
    if mode is Mode.TORQUE_POSITION:
        asked, carried = x, found.motor_torque_nm
    else:
        asked, carried = y, found.load_torque_nm
    assert_close(carried, asked, 1e-6)
    assert np.all(found.slack < 3)


def test_slack_begins_and_ends_where_the_stretch_says() -> None:
    """Position-position: cable a is slack while its ends are closer than its natural length."""
    pair = printed(50)
    stretch_m = 10.0 * 2.0 / 4000
    motor = through(0, -1.2 * stretch_m / 0.02, 0, steps=600)
    found = simulate_mesh(pair, Mode.POSITION_POSITION, times(motor), motor, np.zeros_like(motor))
    slack = (found.slack & 1) == 1
    length = stretch_m + 0.02 * motor
    # What the first pass over virgin segments leaves is second order in ds.
    assert np.array_equal(slack, length <= 0) or np.abs(length[slack != (length <= 0)]).max() < 2e-5
    assert slack.any()
    assert not slack[-1]
    assert np.all(found.motor_tension_a_n[slack] == 0)
    # Re-engaged from zero tension, pulled by the motor: T = stretch EA / A-.
    a_minus = 0.28 / 0.21 * -np.expm1(-1.5)
    assert found.motor_tension_a_n[-1] == pytest.approx(stretch_m * 4000 / a_minus, rel=1e-3)


def test_without_pretension_the_cable_that_can_carry_is_found() -> None:
    torque = through(0, 0.1, -0.1, 0.1, steps=100)
    pair = printed(20, pretension_n=0.0)
    found = simulate_mesh(pair, Mode.TORQUE_POSITION, times(torque), torque, np.zeros_like(torque))
    for series in (*tensions(found), *angles(found)):
        assert np.all(np.isfinite(series))
    assert_close(found.motor_torque_nm, torque, 0.1)
    assert np.all((found.slack & 3)[torque != 0] != 3)
    assert np.any(found.slack & 4)
