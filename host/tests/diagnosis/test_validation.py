"""What held-out data say of an answer: split by split, and whether what is left is noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis.odds import Weighed, explanations, posterior
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.diagnosis.validation import SIGNIFICANT, _earlier, _inputs, _largest, _splits

from .test_odds import NOTHING, Stub

BLOCKS, SIZE = 24, 60
QUANTITY = "load_torque_nm"


def whitened(values: np.ndarray[Any, Any], given: np.ndarray[Any, Any]) -> Any:
    """Return a recording whose residual has such values, in blocks of a second."""
    time_s = np.arange(BLOCKS * SIZE) / SIZE
    recording = SimpleNamespace(time_s=time_s)
    data = SimpleNamespace(
        mode=SimpleNamespace(columns=("motor_torque_nm",)),
        observations=SimpleNamespace(time_s=time_s, channel=np.zeros(time_s.size, dtype=int)),
        estimates=SimpleNamespace(recording=Given(recording.time_s, given)),
    )
    rows = np.split(np.arange(time_s.size), BLOCKS)
    return [(data, [(row, values[row]) for row in rows])]


class Given(dict[str, Any]):
    """A recording of one channel."""

    def __init__(self, time_s: Any, torque: Any) -> None:
        super().__init__(motor_torque_nm=torque)
        self.time_s = time_s


def test_white_noise_is_called_white_and_independent_as_often_as_it_says() -> None:
    false = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        white = whitened(rng.normal(size=BLOCKS * SIZE), rng.normal(size=BLOCKS * SIZE))
        found = _largest(QUANTITY, _earlier(white, 0)), _largest(QUANTITY, _inputs(white, 0))
        false += sum(one.is_significant for one in found)
    # 400 tests at 5 %: 20 expected, standard deviation 4.4; Bonferroni makes it rather fewer.
    assert false <= SIGNIFICANT * 400 + 3 * 4.4


@pytest.mark.parametrize("memory", [-0.4, 0.4])
def test_residuals_that_remember_are_not_white(memory: float) -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(size=BLOCKS * SIZE)
    for k in range(1, values.size):
        values[k] += memory * values[k - 1]
    found = _largest(QUANTITY, _earlier(whitened(values, np.zeros(values.size)), 0))
    assert found.is_significant
    # The estimate scatters by 1 / sqrt(1440) = 0.03.
    assert found.value == pytest.approx(memory, abs=0.1)
    assert found.by == "17 ms earlier"


def test_residuals_that_follow_an_input_are_not_independent_of_it() -> None:
    rng = np.random.default_rng(6)
    given = np.sin(np.arange(BLOCKS * SIZE) / 17.0)
    values = rng.normal(size=given.size) + 0.5 * given
    found = _largest(QUANTITY, _inputs(whitened(values, given), 0))
    assert found.is_significant
    assert found.by == "motor_torque_nm"
    # 0.5 sin in unit noise: 0.5 / sqrt(2) over sqrt(1 + 0.125).
    assert found.value == pytest.approx(0.33, abs=0.08)


class OfOneRecording(Stub):
    """A set of effects fitted to a single recording."""

    @property
    def problem(self) -> Any:
        return SimpleNamespace(prior=lambda _x: (np.zeros(1), None), data=(None,))


def test_an_effect_that_one_split_alone_supports_is_seen_to_be() -> None:
    fold = np.arange(12) % 4
    gain = np.where(fold == 2, 30.0, 0.0)

    def prediction(small: Any) -> UnseenPrediction:
        return UnseenPrediction(np.zeros(12) + small, NOTHING, NOTHING, NOTHING, (), (), (fold,))

    sets = [
        Weighed(cast("Any", OfOneRecording(names)), prediction(small))
        for names, small in (((), 0.0), (("a",), gain))
    ]
    likeliest = []
    for _, predictions in _splits(sets):
        pairs = [(one.hypothesis, p) for one, p in zip(sets, predictions, strict=True)]
        likeliest.append(next(iter(explanations(posterior(pairs, 32, 0)))))
    assert likeliest == ["nothing", "nothing", "a", "nothing"]
