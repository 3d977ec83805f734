"""Which fits go on and from where, and how many finalists are compared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis import growing
from bowden.diagnosis import search as searching
from bowden.diagnosis.growing import lowest
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import Weighed


@dataclass(frozen=True)
class Begun:
    """A fit by its effects' names and its cost."""

    name: str
    cost: float
    where: str = ""

    @property
    def best(self) -> Any:
        return SimpleNamespace(cost=self.cost)

    @property
    def key(self) -> frozenset[tuple[str, str]]:
        return frozenset({(name, self.where) for name in self.name.split()})

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.name.split())


def test_forms_of_an_effect_take_one_place_among_those_fitted_to_the_end() -> None:
    """Else three forms of a wrong one leave none for the right one."""
    fits = Begun("a", 10.0, " here"), Begun("a", 11.0, " there"), Begun("b", 20.0), Begun("c", 30.0)
    found = lowest(cast("list[Hypothesis]", fits), 2)
    assert [(one.names, one.best.cost) for one in found] == [(("a",), 10.0), (("b",), 20.0)]


@dataclass(frozen=True)
class Named:
    """An effect by its name."""

    key: str


@dataclass(frozen=True)
class Fitted:
    """A fit by the size of each of its effects."""

    sizes: dict[str, float]
    best: None = None

    @property
    def effects(self) -> list[Named]:
        return [Named(name) for name in self.sizes]

    @property
    def key(self) -> set[str]:
        return set(self.sizes)

    def values(self, index: int) -> dict[str, float]:
        return {"size": list(self.sizes.values())[index]}


def test_a_set_starts_again_with_what_the_likeliest_says_of_the_effects_of_both(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun: list[tuple[Named, dict[str, float]]] = []
    gone: list[int] = []
    monkeypatch.setattr(growing, "start_of", lambda _m, _s, effects, *_: begun.extend(effects))
    monkeypatch.setattr(growing, "coordinates_without", lambda _other, which: gone.extend(which))
    one, likeliest = Fitted({"a": 1.0, "b": 2.0}), Fitted({"b": 5.0, "c": 6.0})
    unused = cast("Any", None)
    assert growing.refitted_from(unused, unused, cast("Any", one), cast("Any", likeliest)) is one
    assert begun == [(Named("a"), {"size": 1.0}), (Named("b"), {"size": 5.0})]
    assert gone == [1]  # what c did is left to the calibrated numbers


def compared(monkeypatch: pytest.MonkeyPatch, shares: dict[str, float]) -> list[str]:
    """Return which finalists are looked at, where each has such a share of the posterior."""

    def weigh(found: list[Any], *_: Any) -> list[Weighed]:
        return [Weighed(one, prediction, shares[one.name]) for one, prediction in found]

    looked_at: list[str] = []

    def each() -> Iterator[Begun]:
        for number, name in enumerate(shares):
            looked_at.append(name)
            yield Begun(name, float(number))

    monkeypatch.setattr(searching, "posterior", weigh)
    monkeypatch.setattr(searching, "predict_unseen", lambda _one: np.zeros(1))
    monkeypatch.setattr(searching, "merit", lambda one: one.cost)
    searching._compared(cast("Iterator[Hypothesis]", each()), 32, 0)
    return looked_at


def test_the_first_finalist_that_cannot_change_what_is_sure_is_the_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shares = {"a": 0.7, "b": 0.06, "c": 0.04, "d": 0.2}
    assert compared(monkeypatch, shares) == ["a", "b", "c"]


def test_what_the_likeliest_is_made_of_is_compared_whatever_it_carries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shares = {"a b": 1.0, "": 0.0, "a": 0.0, "b": 0.0, "c": 0.0, "d": 0.0}
    assert compared(monkeypatch, shares) == ["a b", "", "a", "b", "c"]
