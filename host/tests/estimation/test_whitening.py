"""Whitened blocks and their factors, against a solve; factors are made once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.likelihood import Scales, block_costs, whiten, whiten_once
from bowden.estimation.whitening import Whitened, factorise

from .recorded import MODE, MODEL, RIGHT, known, matrices, run


def counted_factors(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the blocks whose Cholesky factors are made from now on, as they are made."""
    made: list[int] = []

    def counted(blocks: np.ndarray, *parts: np.ndarray) -> tuple[np.ndarray, ...]:
        made.extend(blocks.tolist())
        return factorise(blocks, *parts)

    monkeypatch.setattr("bowden.estimation.likelihood.factorise", counted)
    return made


def whitened(data: Data, noise: Covariance, scales: Scales = RIGHT) -> Whitened:
    """Whiten a column of ones."""
    return whiten(data, noise, scales, np.ones((data.observations.time_s.size, 1)))


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


def test_data_of_other_steps_share_factors_for_they_have_the_same_observations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data, noise = known()
    made = counted_factors(monkeypatch)
    for one in (data, data.sampled(16e-3), data.cut(2)):
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
    data.observations.layout.triangle(inputs, 1)[:] *= -1.0
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
