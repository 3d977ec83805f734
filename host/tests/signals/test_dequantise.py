"""Angles from counts: closer than the counts, with a correct uncertainty, never outside them."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.model import Mode, parse_model
from bowden.recording.recording import Recording
from bowden.signals.dequantise import NOISY_COUNTS, dequantise, estimate_channels, grid
from bowden.signals.runs import SHOWN, chatters
from bowden.signals.smooth_path import TORQUE_ORDER
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ..rigs import TABLE_1
from .counted import COUNT, TIME_S, FloatArray, counted, draws, stop_and_go

ROUNDING = 1 / np.sqrt(12)  # RMS error of plain counts


def triangle(period_s: float, amplitude: float) -> np.ndarray:
    return amplitude * (4 * np.abs((TIME_S / period_s) % 1 - 0.5) - 1)


MOTIONS = {
    "sine": 0.7 * np.sin(2 * np.pi * 0.5 * TIME_S + 0.3),
    "slow sine": 0.3 * np.sin(2 * np.pi * 0.1 * TIME_S + 0.3),
    "triangle": triangle(2.0, 0.6),
    "slow triangle": triangle(5.0, 0.1),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_moving_encoder_is_known_far_better_than_its_counts(name: str) -> None:
    angle = MOTIONS[name]
    found = dequantise(TIME_S, counted(angle))
    error = (found.values - angle) / COUNT
    # Between two edges the path of a steady motion is known to a tenth of a count or so.
    assert np.sqrt(np.mean(error**2)) < 0.4 * ROUNDING
    assert found.quantum == pytest.approx(COUNT, rel=1e-6)


@pytest.mark.parametrize("name", [*MOTIONS, "stop and go"])
def test_sigma_is_what_the_error_is(name: str) -> None:
    angle = MOTIONS.get(name, stop_and_go())
    found = dequantise(TIME_S, counted(angle))
    scaled = np.abs(found.values - angle) / found.sigma
    # The prior allows corners anywhere, so smooth motion is known better than it says; at
    # standstill the error is uniform: 58 % within one sigma, all within 1.73. All errors of one
    # standstill are the same.
    assert np.mean(scaled < 1.0) > 0.5
    assert np.mean(scaled < 2.0) > 0.95


def test_corners_stay_corners() -> None:
    angle = triangle(2.0, 0.6)
    found = dequantise(TIME_S, counted(angle))
    (corner,) = np.nonzero(np.abs(np.diff(angle, 2)) > 1e-6)
    near = np.unique(np.clip(corner[:, None] + np.arange(-4, 6), 0, TIME_S.size - 1))
    # At 1.2 rad/s the encoder makes 1.9 counts a sample: a path smoothed over as little as 5
    # samples would cut the corner by more than a count.
    assert np.abs(found.values - angle)[near].max() < 1.0 * COUNT


def test_a_slow_stroke_is_drawn_as_smooth_as_it_is_beside_fast_ones() -> None:
    """A draw that turns back within a count reverses friction where nothing did."""
    fast = 0.5 * np.sin(2 * np.pi * 2.0 * TIME_S)  # comes to where it began, as fast as it left
    slow = 0.02 * (TIME_S - 3.0)
    found = dequantise(TIME_S, counted(np.where(TIME_S < 3.0, fast, slow)))
    inside = (TIME_S > 3.3) & (TIME_S < 5.7)
    back = [np.mean(np.diff(one[inside]) < 0.0) for one in draws(found, 24)]
    assert np.mean(back) < 0.01


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    speed=st.floats(1e-3, 5.0),
    uneven=st.floats(0.0, 0.9),
    pause=st.booleans(),
)
@example(seed=15750812, speed=3.0, uneven=0.75, pause=False)  # as noisy as it is fast
def test_the_path_never_leaves_its_counts(
    seed: int, speed: float, uneven: float, pause: bool
) -> None:
    generator = np.random.default_rng(seed)
    step = 1e-3 * (1.0 + uneven * generator.uniform(-1.0, 1.0, 600))
    if pause:
        step[300] = 0.7
    time_s = np.cumsum(step)
    angle = np.cumsum(step * speed * np.cumsum(generator.normal(size=600)) / 10.0)
    read = counted(angle)
    found = dequantise(time_s, read, expected_quantum=COUNT)
    # Behind noise it turns where that many standard deviations show it: less may as well be noise.
    is_noisy = found.noise > NOISY_COUNTS * COUNT
    inside = 0.5 * COUNT * (1 + 1e-9) + (SHOWN if is_noisy else 3.0) * found.noise
    if not is_noisy and chatters(np.round(read / COUNT)):
        inside += COUNT  # at readings that alternate, which count is the right one is open
    assert np.all(np.abs(found.values - read) <= inside)
    assert np.all(np.isfinite(found.sigma))
    assert np.all(np.abs(draws(found, 1)[0] - read) <= inside)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_the_estimate_turns_only_where_the_counts_do(seed: int) -> None:
    """A turn back of a hundredth of a count is worth 60 mN m, for as long as the pair stands."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(3000) * 1e-3
    angle, at, place = np.zeros(time_s.size), 0, 0.0
    while at < time_s.size:  # strokes that stop gently, some after another the same way, and stand
        count = int(rng.integers(100, 600))
        way = float(rng.uniform(-0.05, 0.05))
        share = np.minimum(np.arange(time_s.size - at) / count, 1.0)
        angle[at:] = place + way * share**3 * (10 - 15 * share + 6 * share**2)
        place += way
        at += count + int(rng.integers(0, 300))
    q = 2 * np.pi / 10_000
    counts = np.round(angle / q)
    estimated = dequantise(time_s, counts * q, expected_quantum=q)
    found, noise = estimated.values / q, estimated.noise / q
    turned = np.flatnonzero(np.diff(np.sign(np.diff(counts[np.flatnonzero(np.diff(counts))]))))
    way = np.sign(np.diff(found))
    turns = np.flatnonzero(np.diff(way[way != 0.0]))
    assert turns.size <= turned.size + 1
    # No noise was added; few counts may tell that only to a tenth of a count.
    assert noise < 0.1
    assert np.all(np.abs(found - counts) <= 0.5 + 3.0 * noise + 1e-9)


def test_draws_scatter_as_sigma_says_and_together_as_errors_do() -> None:
    found = dequantise(TIME_S, counted(stop_and_go()))
    errors = np.array(draws(found, 40)) - found.values
    spread = np.sqrt(np.mean(errors**2)) / np.sqrt(np.mean(found.sigma**2))
    assert spread == pytest.approx(1.0, abs=0.2)  # clipping to the counts takes a little
    inside = errors[:, (TIME_S > 2.6) & (TIME_S < 2.9)]
    assert np.mean(np.std(inside, axis=1)) < 0.3 * np.std(inside)  # one error for all of it


def test_the_same_seed_draws_the_same_path() -> None:
    found = dequantise(TIME_S, counted(MOTIONS["sine"]))
    first, second = (draws(found, 2) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_clean_channel_is_left_alone() -> None:
    angle = MOTIONS["sine"]
    found = dequantise(TIME_S, angle)
    np.testing.assert_array_equal(found.values, angle)
    assert found.quantum is None
    assert found.sigma.max() < 1e-6


@pytest.mark.parametrize("shape", ["tunnel", "steps"])
def test_white_noise_of_a_given_torque_goes_and_its_corners_and_steps_stay(shape: str) -> None:
    wave = np.sin(2 * np.pi * 0.5 * TIME_S)
    torque = 0.2 * np.clip(3 * wave, -1, 1) if shape == "tunnel" else 0.1 * np.sign(wave)
    noise = np.random.default_rng(3).normal(0.0, 5e-4, TIME_S.size)
    found = dequantise(TIME_S, torque + noise, order=TORQUE_ORDER)
    error = found.values - torque
    assert np.sqrt(np.mean(error**2)) < 0.5 * 5e-4
    assert np.abs(error).max() < 3.5 * 5e-4  # also in the sample after a step of 200 sigmas
    assert np.mean(np.abs(error) < 2 * found.sigma) > 0.9


def test_a_noisy_angle_turns_only_where_the_motion_does() -> None:
    angle = stop_and_go()
    sigma = 0.3 * COUNT
    found = dequantise(TIME_S, angle + np.random.default_rng(5).normal(0.0, sigma, TIME_S.size))
    still = (TIME_S % 1.0 > 0.55) & (TIME_S % 1.0 < 0.95)
    for path in (found.values, *draws(found, 8)):
        assert ways(path) == ways(angle)
        # No reading drags the path along: the largest of 6000 errors is at four sigmas.
        assert np.abs(path - angle)[still].max() < sigma


def ways(path: FloatArray) -> list[float]:
    """Return the signs of a path's strokes, one after the other."""
    signs = np.sign(np.diff(path))
    signs = signs[signs != 0.0]
    return [float(signs[0]), *signs[1:][signs[1:] != signs[:-1]].tolist()]


def test_draws_behind_noise_are_as_far_from_the_estimate_as_the_truth() -> None:
    angle = stop_and_go()
    errors, spread = [], []
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0.0, 0.3 * COUNT, TIME_S.size)
        found = dequantise(TIME_S, angle + noise)
        errors.append(found.values - angle)
        spread += [one - found.values for one in draws(found, 8)]
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(spread)))
    # One draw and the truth come from one posterior. Its heavy tails make draws wider than a
    # motion without a tremble is far off.
    assert 0.4 < ratio < 1.1


@pytest.mark.parametrize("noise_counts", [0.1, 0.3, 1.5])
def test_noise_on_top_of_counts(noise_counts: float) -> None:
    angle = 0.7 * np.sin(2 * np.pi * 0.2 * TIME_S)
    noise = np.random.default_rng(4).normal(0.0, noise_counts * COUNT, TIME_S.size)
    read = counted(angle + noise)
    found = dequantise(TIME_S, read)
    error = found.values - angle
    assert np.sqrt(np.mean(error**2)) < 0.4 * np.sqrt(np.mean((read - angle) ** 2))
    assert np.mean(np.abs(error) < 2 * found.sigma) > 0.85


@pytest.mark.parametrize("counts", [2000, 4096, 10_000, 8192 * 4])
def test_the_count_is_found_in_the_data(counts: int) -> None:
    quantum = 2 * np.pi / counts
    read = counted(MOTIONS["sine"], quantum) + 0.1234
    assert grid(read) == pytest.approx(quantum, rel=1e-6)
    written = np.round(read, 5)  # as a file with few digits has it
    assert grid(written) == pytest.approx(quantum, rel=1e-4)


def test_the_data_win_over_the_model_file() -> None:
    read = counted(MOTIONS["sine"], 2 * np.pi / 4000)
    assert grid(read, 2 * np.pi / 10_000) == pytest.approx(2 * np.pi / 4000, rel=1e-6)
    assert grid(MOTIONS["sine"], 2 * np.pi / 10_000) is None


def test_a_channel_that_never_moves_is_known_to_a_count() -> None:
    found = dequantise(TIME_S, np.zeros(TIME_S.size), expected_quantum=COUNT)
    assert found.quantum == COUNT
    np.testing.assert_array_equal(found.values, 0.0)
    assert found.sigma.max() <= 0.5 * COUNT


def test_only_what_the_mode_is_given_is_smoothed() -> None:
    noise = np.random.default_rng(5).normal(0.0, 1e-3, (2, TIME_S.size))
    angle = counted(MOTIONS["sine"])
    run = Recording(
        TIME_S,
        motor_angle_rad=5.2 * angle,
        load_angle_rad=angle,
        motor_torque_nm=noise[0],
        load_torque_nm=noise[1],
    )
    found = estimate_channels(run, parse_model(TABLE_1), Mode.TORQUE_POSITION)
    np.testing.assert_array_equal(found.recording.load_torque_nm, run.load_torque_nm)
    assert np.std(found.recording.motor_torque_nm) < 0.5 * np.std(run.motor_torque_nm)
    assert found.channels["load_torque_nm"].sigma[0] == pytest.approx(1e-3, rel=0.1)
    assert found.channels["motor_angle_rad"].quantum is not None


def test_the_acceleration_of_a_smooth_motion_is_known() -> None:
    """The torque of a load's inertia is felt through it, also where counts are coarse."""
    angle = 0.3 * np.sin(2 * np.pi * 1.0 * TIME_S)
    found = dequantise(TIME_S, counted(angle))
    true, known = (np.gradient(np.gradient(one, TIME_S), TIME_S) for one in (angle, found.values))
    inside = slice(100, -100)
    # White jerk's posterior; white acceleration's would be off by 7 %.
    error = np.sqrt(np.mean((known - true)[inside] ** 2) / np.mean(true[inside] ** 2))
    assert error < 0.04


@pytest.mark.parametrize("noise_counts", [0.02, 0.05, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("seed", [1, 2])
def test_how_blurred_the_edges_are_is_found(noise_counts: float, seed: int) -> None:
    angle = 0.7 * np.sin(2 * np.pi * 0.2 * TIME_S)
    noise = np.random.default_rng(seed).normal(0.0, noise_counts * COUNT, TIME_S.size)
    found = dequantise(TIME_S, counted(angle + noise))
    # Some hundred edges near turns are passed slowly enough to show it: 1/sqrt(2 100) is 7 %.
    assert found.noise / COUNT == pytest.approx(noise_counts, rel=0.2)


def test_sharp_edges_are_found_to_be_sharp() -> None:
    """What is usual counts as one edge more among some hundred."""
    found = dequantise(TIME_S, counted(0.7 * np.sin(2 * np.pi * 0.2 * TIME_S)))
    assert found.noise / COUNT < 0.01


def test_turns_of_any_kind_are_within_sigma() -> None:
    """A handle slows down evenly and, turned, gathers speed up to 20 times faster or slower."""
    scaled = []
    for seed in range(48):
        rng = np.random.default_rng(seed)
        turn, place = float(rng.uniform(2.5, 3.5)), float(rng.uniform(0.0, 1.0))
        half = float(np.exp(0.5 * rng.uniform(-np.log(20.0), np.log(20.0))))
        gone = TIME_S - turn
        angle = place * COUNT + gone**2 * np.where(gone < 0.0, 1.0 / half, half)
        found = dequantise(TIME_S, counted(angle), expected_quantum=COUNT)
        near = np.abs(gone) < 0.05
        scaled.append(np.mean(((found.values - angle) / found.sigma)[near] ** 2))
    # Two sigma: what happens within a count shows in nothing else. A single turn tells little of
    # how abrupt turns are, so most are known better than that, but not five times.
    assert max(scaled) < 4.0
    assert np.mean(scaled) > 0.04


def test_even_turns_do_not_make_an_abrupt_one_impossible() -> None:
    """Of five turns four are even; at the last the handle stops in 10 ms and comes back slowly."""
    last_s = 5.2
    before = 0.2 * np.cos(2.0 * np.pi * (TIME_S - last_s) / 1.2)
    speed = float(np.interp(last_s - 0.3, TIME_S, np.gradient(before, TIME_S)))
    meets = float(np.interp(last_s - 0.3, TIME_S, before))
    gone = TIME_S - (last_s - 0.3)
    braked = np.minimum(gone, 0.01)
    after = speed * (braked - braked**2 / 0.02) - 0.5 * np.maximum(gone - 0.01, 0.0) ** 2
    angle = np.where(gone < 0.0, before, meets + after)
    found = dequantise(TIME_S, counted(angle), expected_quantum=COUNT)
    near = np.abs(gone - 0.01) < 0.05
    turned_s = TIME_S[near][np.argmax(angle[near])]
    drawn_s = np.array([TIME_S[near][np.argmax(one[near])] for one in draws(found, 48)])
    # Like a normal distribution's: 3 standard deviations hold all but one turn in 370.
    assert abs(turned_s - drawn_s.mean()) < 3.0 * max(float(drawn_s.std()), 1e-3)
