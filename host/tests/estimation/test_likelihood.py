"""Observations, nuisance numbers and the likelihood, each against a form that is not the code's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.likelihood import (
    LAWS,
    SIZES,
    Scales,
    best_scales,
    block_costs,
    block_weights,
    cost,
    whiten,
    whiten_once,
)
from bowden.estimation.nuisance import Nuisance, as_given, as_read, usual_nuisances
from bowden.estimation.observations import USUAL_BLOCK_S, _block_edges
from bowden.estimation.paths import DRAWS
from bowden.estimation.whitening import Whitened, factorise
from bowden.model import Mode, parse_model
from bowden.recording.recording import Recording
from scipy.stats import multivariate_normal, multivariate_t

from ..rigs import TABLE_1, experiment_2

MODE = Mode.TORQUE_POSITION
MODEL = parse_model(TABLE_1.replace("segments: 50", "segments: 150"))
COUNTS = {"motor_angle_rad": 2000, "load_angle_rad": 10000}
RIGHT = Scales((0.0, 0.0))


def run(seconds: float = 4.0, seed: int = 3) -> tuple[Recording, Recording]:
    """A rig's true series and what its sensors say of them."""
    true = experiment_2(MODEL, seconds=seconds)
    read = {
        name: 2 * np.pi / n * np.round(true[name] / (2 * np.pi / n)) for name, n in COUNTS.items()
    }
    noise = np.random.default_rng(seed).normal(0.0, 1e-3, true.time_s.size)
    return true, true.with_channels(read, load_torque_nm=true.load_torque_nm + noise)


def test_an_edge_says_where_an_encoder_is_to_a_small_part_of_a_count() -> None:
    true, read = run()
    seen = Data.of(read, 0, MODEL, MODE).observations
    angle = seen.channel == 1
    truth = np.interp(seen.time_s[angle], true.time_s, true.motor_angle_rad)
    error = seen.measured[angle] - truth
    # Uniform within what it moves in a sample, which is what sigma says beside 0.05 of a count.
    assert np.sqrt(np.mean((error / seen.sigma[angle]) ** 2)) < 1.1
    # Never worse than one rounded reading: at a count a sample both readings are off alike.
    count = 2 * np.pi / 2000
    assert seen.sigma[angle].max() < 1.001 * np.hypot(0.05 * count, count / np.sqrt(12))
    assert seen.sigma[angle].min() < 0.2 * count


def test_edges_lie_neither_ahead_nor_behind() -> None:
    # At 0.7 counts a sample: an edge after a sample without one is an early one, and a choice
    # that prefers it would put every angle 0.06 counts behind its motion.
    count = 2 * np.pi / 2000
    time_s = np.arange(0.0, 40.0, 1e-3)
    angle = 0.7e3 * count * np.where(time_s < 20.0, time_s, 40.0 - time_s)
    angle = angle + 3.0 * count * np.sin(0.37 * time_s)  # no beat between counts and samples
    read = Recording(
        time_s,
        {
            "motor_angle_rad": count * np.round(angle / count),
            "load_angle_rad": angle / 5.2,
            "motor_torque_nm": np.sin(time_s),
            "load_torque_nm": np.cos(time_s),
        },
    )
    seen = Data.of(read, 0, MODEL, MODE).observations
    edge = seen.channel == 1
    error = (seen.measured[edge] - np.interp(seen.time_s[edge], time_s, angle)) / count
    behind = float(np.mean(error * seen.direction[edge]))
    assert abs(behind) < 3.0 * float(np.std(error)) / np.sqrt(edge.sum())


def test_an_encoder_at_standstill_gives_no_observation() -> None:
    _, read = run()
    still = read.with_channels(motor_angle_rad=np.zeros(read.time_s.size))
    assert not np.any(Data.of(still, 0, MODEL, MODE).observations.channel == 1)


def test_a_speed_is_that_of_the_path_whatever_is_simulated_and_varies_with_it() -> None:
    _, read = run(seconds=2.0)
    whole = Data.of(read, 0, MODEL, MODE).estimates.recording
    few = Data.of(read, 0, MODEL, MODE, step_s=16e-3)
    path = np.gradient(whole["load_angle_rad"], whole.time_s)
    np.testing.assert_array_equal(few.given["load_speed_rad_per_s"], path[few.kept])
    off = [one["load_speed_rad_per_s"] - path[few.kept] for one in few.paths()]
    # A count of 0.63 mrad is passed every 0.3 ms or more slowly: known to a few per cent of 2 rad/s
    assert 0.0 < np.sqrt(np.mean(np.square(off))) < 0.1


def test_every_observation_is_in_one_block() -> None:
    _, read = run()
    seen = Data.of(read, 0, MODEL, MODE).observations
    assert np.array_equal(np.sort(np.concatenate(seen.blocks)), np.arange(seen.time_s.size))
    # A stretch of one and a half usual blocks is not divided.
    assert all(np.ptp(seen.time_s[rows]) <= 1.5 * USUAL_BLOCK_S for rows in seen.blocks)


@pytest.mark.parametrize("stroke_s", [1.0, 2.0, 3.1])
def test_what_a_reversal_begins_stays_in_one_block(stroke_s: float) -> None:
    """Else an error of a turn's place were in the training data of what it is judged by."""
    time_s = np.arange(12_000) * 1e-3
    angle = 0.3 * np.cos(np.pi * time_s / stroke_s)
    begun = _block_edges(Recording(time_s, {"load_angle_rad": angle}))
    turns = stroke_s * np.arange(1, int(12.0 / stroke_s))
    assert all(np.min(np.abs(begun - turn)) < 2e-3 for turn in turns)


@pytest.mark.parametrize("fit", ["worse", "better"])
def test_the_cost_is_that_of_a_multivariate_t_where_a_block_fits_badly(fit: str) -> None:
    """Where it fits better than its covariance says, that of a Gaussian: noise is no less."""
    _, read = run(seconds=2.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    rng = np.random.default_rng(5)
    # Blocks of a hundred observations and more: 1.5 times and half of their noise are far enough
    # from it that each is on the one side.
    size = 1.5 if fit == "worse" else 0.5
    shapes = [
        inputs + np.diag(noise.own[rows])
        for rows, inputs in zip(data.observations.blocks, matrices(data, noise), strict=True)
    ]

    def drawn() -> np.ndarray:
        residual = np.zeros(data.observations.time_s.size)
        for rows, shape in zip(data.observations.blocks, shapes, strict=True):
            residual[rows] = size * np.linalg.cholesky(shape) @ rng.normal(size=rows.size)
        return residual

    def log_density(residual: np.ndarray) -> float:
        total = 0.0
        for rows, shape in zip(data.observations.blocks, shapes, strict=True):
            zero = np.zeros(rows.size)
            t = multivariate_t(zero, shape, df=DRAWS)
            law = t if fit == "worse" else multivariate_normal(zero, shape)
            total += float(law.logpdf(residual[rows]))
        return total

    one, other = drawn(), drawn()
    found = cost([(data, noise, one, None)], RIGHT) - cost([(data, noise, other, None)], RIGHT)
    assert found == pytest.approx(log_density(other) - log_density(one), rel=1e-6)


def test_no_block_tells_more_than_its_noise_allows() -> None:
    """Edges that were read better than they are taken for make no load cell less noisy."""
    count = 140
    rng = np.random.default_rng(8)
    slope = np.concatenate([np.ones(count // 2), np.zeros(count // 2)])  # the cell's, the edges'
    errors = []
    for _ in range(2000):
        residual = np.concatenate([rng.normal(size=count // 2), np.zeros(count // 2)])
        rows = np.column_stack([residual, slope])
        weighed = block_weights(Whitened(rows, np.array([count]), np.zeros(1))) * slope
        errors.append(weighed @ residual / np.sqrt(weighed @ slope))
    # 2000 estimates over their stated standard deviation: known to 1.6 %, thrice that is allowed.
    assert np.std(errors) < 1.05


def test_a_right_model_leaves_what_the_covariance_says() -> None:
    _, read = run(seconds=8.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    zero = data.observations.measured - data.predict(MODEL)
    zero -= (data.observations.channel == 1) * np.mean(zero[data.observations.channel == 1])
    scales = best_scales([(data, noise, zero, None)], RIGHT)
    assert max(scales.discrepancy) <= 0.6  # two solvers of one law may differ by so much
    white = whiten(data, noise, scales, zero[:, None])
    chi = white.squares[:, 0] / white.sizes
    assert np.mean([0.5 < one < 1.2 for one in chi]) > 0.6
    assert np.median(chi) == pytest.approx(0.85, abs=0.3)


def test_a_block_is_whitened_alike_whatever_was_whitened_before() -> None:
    # Factors are kept by their scales: none may stand in for another, and shares of the laws that
    # are put in later (`replace`) begin without any.
    _, read = run(seconds=2.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    row = np.ones((data.observations.time_s.size, 1))
    law = replace(noise, law=noise.sigma)
    every = [RIGHT, Scales((0.3, 0.0)), Scales((0.0, 0.3)), Scales((0.0, 0.0), law=0.3)]
    fresh = [
        whiten(data, replace(law), scales, row).rows for scales in every
    ]  # of a copy, which keeps nothing
    for scales, expected in [*zip(every, fresh, strict=True)] * 2:
        assert np.array_equal(whiten(data, law, scales, row).rows, expected)
        once = whiten_once(data, law, scales, row, range(len(data.observations.blocks)))
        assert np.array_equal(once.rows, expected)
    sums = [float(np.sum(np.square(rows))) for rows in fresh]
    assert len(set(sums)) == len(every)


@pytest.mark.parametrize("only", [None, (1, 2)])
def test_whitened_rows_are_those_of_each_block_by_a_solve(only: tuple[int, ...] | None) -> None:
    _, read = run()
    data = Data.of(read, 0, MODEL, MODE)
    noise = replace(covariance(data, MODEL), law=np.full(data.observations.time_s.size, 2e-3))
    scales = Scales((0.3, 0.1), law=0.3)
    columns = np.random.default_rng(0).normal(size=(data.observations.time_s.size, 3))
    white = whiten(data, noise, scales, columns, only)
    chosen = range(len(data.observations.blocks)) if only is None else only
    parts = np.split(white.rows, np.cumsum(white.sizes)[:-1])
    for number, (block, part) in enumerate(zip(chosen, parts, strict=True)):
        rows = data.observations.blocks[block]
        channel, time_s = data.observations.channel[rows], data.observations.time_s[rows]
        size = np.array(scales.discrepancy)[channel] * noise.floor[channel]
        # A discrepancy and a law's error are alike for 0.15 s, within a channel.
        alike = np.exp(-np.abs(time_s[:, None] - time_s) / 0.15) * (channel[:, None] == channel)
        matrix = matrices(data, noise)[block] + np.diag(noise.own[rows])
        matrix += alike * (np.outer(size, size) + (0.3 * 2e-3) ** 2)
        expected = np.linalg.solve(np.linalg.cholesky(matrix), columns[rows])
        np.testing.assert_allclose(part, expected, atol=1e-9 * float(np.abs(expected).max()))
        half = 0.5 * float(np.linalg.slogdet(matrix)[1])
        assert white.half_log_det[number] == pytest.approx(half, rel=1e-9)
        np.testing.assert_allclose(white.squares[number], np.sum(expected**2, axis=0), rtol=1e-9)


def matrices(data: Data, noise: Covariance) -> list[np.ndarray]:
    """Return what the inputs do, block by block."""
    return list(data.observations.layout.matrices(noise.inputs))


def counted_factors(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the blocks whose Cholesky factors are made from now on, as they are made."""
    made: list[int] = []

    def counted(blocks: np.ndarray, *parts: np.ndarray) -> tuple[np.ndarray, ...]:
        made.extend(blocks.tolist())
        return factorise(blocks, *parts)

    monkeypatch.setattr("bowden.estimation.likelihood.factorise", counted)
    return made


def test_covariances_that_differ_in_what_factors_do_not_hold_share_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data, noise = known()
    count, made = len(data.observations.blocks), counted_factors(monkeypatch)
    law = 0.3 * noise.sigma
    others = [replace(noise, offset=noise.offset + 1.0), replace(noise, law=law)]
    for one in (noise, *others):
        whitened(data, one)
    assert len(made) == count
    with_law = [
        whitened(data, replace(noise, law=one), Scales((0.0, 0.0), law=1.0))
        for one in (law, 2.0 * law)
    ]
    assert len(made) == 3 * count
    small, large = with_law
    assert np.all(large.half_log_det > small.half_log_det)


def known() -> tuple[Data, Covariance]:
    """Return a recording and its covariance about the true model."""
    data = Data.of(run()[1], 0, MODEL, MODE)
    return data, covariance(data, MODEL)


def whitened(data: Data, noise: Covariance, scales: Scales = RIGHT) -> Whitened:
    """Whiten a column of ones."""
    return whiten(data, noise, scales, np.ones((data.observations.time_s.size, 1)))


def test_data_of_other_steps_share_factors_for_they_have_the_same_observations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data, noise = known()
    made = counted_factors(monkeypatch)
    for one in (data, data.sampled(16e-3), data.cut()):
        whitened(one, noise)
    assert len(made) == len(data.observations.blocks)


def test_what_is_whitened_once_keeps_no_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would displace those that are wanted again."""
    data, noise = known()
    made, row = counted_factors(monkeypatch), np.ones((data.observations.time_s.size, 1))
    for _ in range(2):
        whiten_once(data, noise, RIGHT, row, [1])
    assert made == [1, 1]
    whitened(data, noise)
    assert made == [1, 1, *range(len(data.observations.blocks))]


def test_no_covariance_is_taken_for_one_that_is_gone() -> None:
    """Factors are found by where their parts lie in memory, which the next ones might take."""
    data, noise = known()
    for k in range(1, 12):
        other = replace(noise, inputs=k * noise.inputs)
        for block, half in enumerate(whitened(data, other).half_log_det):
            rows = data.observations.blocks[block]
            matrix = matrices(data, other)[block] + np.diag(noise.own[rows])
            expected = 0.5 * np.linalg.slogdet(matrix)[1]
            # Rounding of a sum of logarithms of some hundred variances.
            assert half == pytest.approx(expected, rel=1e-9, abs=1e-6)
        del other


def test_a_covariance_that_is_none_is_refused_by_its_block() -> None:
    data, noise = known()
    inputs = noise.inputs.copy()
    data.observations.layout.matrices(inputs)[1][:] *= -1.0
    with pytest.raises(np.linalg.LinAlgError, match="block 1: its covariance is not positive"):
        whitened(data, replace(noise, inputs=inputs))


def test_factors_are_made_once_however_long_a_recording_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is room for one covariance in any case, and each serves all residuals."""
    monkeypatch.setattr("bowden.estimation.observations.MOST_FACTORS_BYTES", 0)
    data, noise = known()
    scales = Scales((0.3, 0.1))
    count, size = len(data.observations.blocks), data.observations.time_s.size
    residuals = np.random.default_rng(0).normal(size=(size, 5))
    made = counted_factors(monkeypatch)
    for residual in residuals.T:
        whiten(data, noise, scales, residual[:, None])
    assert count > 2
    assert len(made) == count
    other = [Scales((0.1 * k, 0.0)) for k in range(1, 4)]
    for one in other:
        whiten(data, noise, one, residuals)
    assert len(made) == (1 + len(other)) * count
    costs = block_costs(whiten(data, noise, scales, residuals, (0, 2)))
    alone = [block_costs(whiten(data, noise, scales, r[:, None], (0, 2))) for r in residuals.T]
    np.testing.assert_array_equal(costs, np.column_stack(alone))


def test_paths_are_the_same_each_time_and_hold_what_a_simulation_reads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Other paths about another model, and its cost would jump."""
    _, read = run(seconds=2.0)
    data = Data.of(read.with_channels(bus_voltage_v=np.ones(read.time_s.size)), 0, MODEL, MODE)
    kept = list(data.paths())
    assert [a is b for a, b in zip(data.paths(), kept, strict=True)] == [True] * DRAWS
    monkeypatch.setattr("bowden.estimation.paths.MOST_BYTES", 0)
    for again, before in zip(data.paths(), kept, strict=True):  # drawn anew: too large to keep
        assert set(again.channels) == {*MODE.columns, *MODE.speeds}
        assert again is not before
        assert all(np.array_equal(again[name], before[name]) for name in again.channels)


def test_paths_share_what_is_not_drawn() -> None:
    """A copy of ten minutes at 1 kHz takes 5 MB a channel, and each of 48 paths would have one."""
    _, read = run(seconds=2.0)
    data = Data.of(read, 0, MODEL, MODE)
    assert not data.is_thinned
    assert data.given is data.estimates.recording
    torques = [path["motor_torque_nm"] for path in data.paths()]  # exact here, so never drawn
    assert len({one.__array_interface__["data"][0] for one in torques}) == 1


def test_a_discrepancy_is_found_where_something_is_missing() -> None:
    _, read = run(seconds=8.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    seen = data.observations
    missing = 0.05 * np.sin(3.0 * seen.time_s) * (seen.channel == 0)
    residual = seen.measured - data.predict(MODEL) + missing
    torque, angle = best_scales([(data, noise, residual, None)], RIGHT).discrepancy
    # A slow wave of 35 mN m RMS has small steps over the 0.15 s of a discrepancy's memory.
    assert torque > 3.0
    assert torque * noise.floor[0] > 0.005
    assert angle < 1.0


@pytest.mark.parametrize("start", [0.0, 0.3, 1.0])
def test_what_laws_are_off_by_is_found_wherever_it_was_before(start: float) -> None:
    """A discrepancy and a law's error each do for the other, so one alone may seem to hold."""
    _, read = run(seconds=8.0)
    data = Data.of(read, 0, MODEL, MODE)
    seen = data.observations
    noise = covariance(data, MODEL)
    noise = replace(noise, law=np.where(seen.channel == 0, 20.0, 0.0) * noise.sigma)
    residual = seen.measured - data.predict(MODEL)
    residual += 3.0 * noise.floor[0] * np.sin(20.0 * seen.time_s) * (seen.channel == 0)
    parts = [(data, noise, residual, None)]
    every = [Scales((torque, 0.0), law) for torque in SIZES for law in LAWS]
    least = min(every, key=lambda scales: cost(parts, scales))
    found = best_scales(parts, Scales((0.0, 0.0), start))
    assert found.law == least.law
    assert cost(parts, found) <= cost(parts, least)


def test_readings_and_what_they_mean_undo_each_other() -> None:
    true, _ = run(seconds=2.0)
    zero = Nuisance("zero", "motor_torque_nm", (0,), 1.0)
    gain = Nuisance("gain", "motor_torque_nm", (0,), 1.0)
    reading = as_read(true.time_s, true.motor_torque_nm, [(zero, 0.02), (gain, 0.1)])
    assert reading == pytest.approx(1.1 * true.motor_torque_nm + 0.02)
    read = true.with_channels(motor_torque_nm=reading)
    undone = as_given(read, [(zero, 0.02), (gain, 0.1)]).motor_torque_nm
    assert undone == pytest.approx(true.motor_torque_nm, abs=1e-12)


def test_a_delay_shifts_in_time() -> None:
    true, _ = run(seconds=2.0)
    late = Nuisance("delay", "load_torque_nm", (0,), 0.01)
    reading = as_read(true.time_s, true.load_torque_nm, [(late, 0.01)])
    assert reading[10:] == pytest.approx(true.load_torque_nm[:-10], abs=1e-9)


def test_recordings_of_one_label_share_their_zeros() -> None:
    runs = [run(seconds=2.0, seed=k)[1] for k in range(3)]
    estimates = [Data.of(one, k, MODEL, MODE).estimates for k, one in enumerate(runs)]
    found = usual_nuisances(MODE, runs, estimates, ["a", "b", "a"])
    cell = [one.recordings for one in found if one.channel == "load_torque_nm"]
    assert cell == [(0, 2), (1,)]
