"""Sets of effects: one that does nothing beside the others is dropped."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import pytest
from bowden.diagnosis.candidates import Candidate, candidates
from bowden.diagnosis.growing import without_idle
from bowden.diagnosis.hypothesis import Hypothesis, finish, start_of
from bowden.diagnosis.material import Material, as_searched, make_material
from bowden.diagnosis.relevance import idle
from bowden.diagnosis.search import search
from bowden.model import Mode

from .lab import MODEL, TRUTH, measured

(OFFSET,) = candidates(("motor_torque_offset",))
(ASYMMETRY,) = candidates(("direction_asymmetry",))
HIDDEN_NM: Final = 0.03


@pytest.fixture(scope="module")
def material() -> Iterator[Material]:
    truth = TRUTH.with_effect(OFFSET.name, {"offset_nm": HIDDEN_NM})
    with ThreadPoolExecutor(1) as pool:
        yield make_material([measured(truth)], MODEL, Mode.TORQUE_POSITION, 1, pool)


@pytest.fixture(scope="module")
def base(material: Material) -> Hypothesis:
    return search(material, MODEL, [OFFSET], seed=1).base


def fitted(
    material: Material, base: Hypothesis, *effects: tuple[Candidate, dict[str, float]]
) -> Hypothesis:
    start = start_of(material, as_searched(MODEL), effects, {}, base.best)
    assert start is not None
    return finish(material, start.fitted(4), base.best.noises)


def test_an_effect_that_does_nothing_beside_another_is_dropped(
    material: Material, base: Hypothesis
) -> None:
    both = fitted(material, base, (ASYMMETRY, {"a": 0.01}), (OFFSET, {"offset_nm": 0.02}))
    assert [both.effects[i] for i in idle(both)] == [ASYMMETRY]
    less = without_idle(material, as_searched(MODEL), both, {})
    assert less is not None
    assert less.names == (OFFSET.name,)
    # Known to a hundredth of itself: counts and noise of 12 s.
    assert less.values(0)["offset_nm"] == pytest.approx(HIDDEN_NM, rel=0.01)
    assert without_idle(material, as_searched(MODEL), both, {less.key: less}) is None
