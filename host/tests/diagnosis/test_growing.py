"""From where a fit starts again, and how many finalists are compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis import growing, weighing
from bowden.diagnosis import search as searching
from bowden.diagnosis import sets as setting
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.sets import Sets


@dataclass(frozen=True)
class Begun:
    """A fit by its effects' names."""

    name: str

    @property
    def effects(self) -> tuple[str, ...]:
        return self.names

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.name.split())

    @property
    def key(self) -> frozenset[str]:
        return frozenset(self.names)


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

    def coordinates(self) -> dict[str, float]:
        return {"mu": 0.2}


class InTurn:
    """What a pool does, one after the other."""

    @staticmethod
    def map(do: Callable[[Any], Any], every: Iterable[Any]) -> list[Any]:
        return [do(one) for one in every]


def test_a_set_starts_again_with_what_the_likeliest_says_of_the_effects_of_both(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gone: list[int] = []
    starts: list[tuple[list[tuple[Named, dict[str, float]]], dict[str, float]]] = []
    monkeypatch.setattr(growing, "start_of", lambda _m, _s, *of: starts.append(of[:2]))
    monkeypatch.setattr(
        growing, "coordinates_without", lambda _other, which: gone.extend(which) or {"mu": 0.3}
    )
    one, likeliest = Fitted({"a": 1.0, "b": 2.0}), Fitted({"b": 5.0, "c": 6.0})
    material, unused = cast("Any", SimpleNamespace(pool=InTurn)), cast("Any", None)
    assert growing.refitted_from(material, unused, cast("Any", one), cast("Any", likeliest)) is one
    effects = [(Named("a"), {"size": 1.0}), (Named("b"), {"size": 5.0})]
    assert gone == [1]  # what c did is left to the calibrated numbers, or to a
    assert starts == [(effects, {"mu": 0.3}), (effects, {"mu": 0.2})]


@pytest.mark.parametrize(("moved", "stayed", "chosen"), [(-9.0, -5.0, -9.0), (-5.0, -9.0, -9.0)])
def test_a_set_goes_on_from_where_it_has_come_further(
    monkeypatch: pytest.MonkeyPatch, moved: float, stayed: float, chosen: float
) -> None:
    """A twin in the place of an effect needs the calibrated numbers that the effect left."""
    ends = iter([moved, stayed])
    monkeypatch.setattr(
        growing,
        "start_of",
        lambda *_: SimpleNamespace(begun=partial(Ended, "a b", next(ends))),
    )
    monkeypatch.setattr(growing, "coordinates_without", lambda *_: {"mu": 0.3})
    monkeypatch.setattr(growing, "merit", lambda one: one.merit)
    one, likeliest = Fitted({"a": 1.0, "b": 2.0}), Fitted({"b": 5.0, "c": 6.0})
    material, unused = cast("Any", SimpleNamespace(pool=InTurn)), cast("Any", None)
    found = growing.refitted_from(material, unused, cast("Any", one), cast("Any", likeliest))
    assert cast("Ended", found).merit == chosen


def compared(
    monkeypatch: pytest.MonkeyPatch,
    parts: dict[str, float],
    rivals: dict[str, float],
) -> list[str]:
    """Return which finalists are looked at, where each has such a share of the posterior."""
    shares = {"a b": 1.0, "": 0.0} | parts | rivals

    def weigh(found: list[Any], *_: Any) -> list[Weighed]:
        return [Weighed(one, prediction, shares[one.name]) for one, prediction in found]

    looked_at: list[str] = []

    def each(names: Iterable[str]) -> Iterator[Begun]:
        yield from (Begun(name) for name in names)

    def predict(one: Begun) -> Any:
        looked_at.append(one.name)
        return np.zeros(1)

    monkeypatch.setattr(weighing, "posterior", weigh)
    monkeypatch.setattr(weighing, "predict_unseen", predict)
    finalists = Begun("a b"), each(parts), each(rivals)
    sets = SimpleNamespace(finalists=lambda: finalists, base=Begun(""), finished=lambda one: one)
    searching._compared(cast("Sets", sets), 32, 0)
    return looked_at


def test_the_first_rival_that_cannot_change_what_is_sure_is_the_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = compared(monkeypatch, {"": 0.2}, {"c": 0.06, "d": 0.04, "e": 0.2})
    assert found == ["a b", "", "c", "d"]


def test_parts_of_the_likeliest_are_looked_at_whatever_its_rivals_carry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the sets without it an effect is judged."""
    found = compared(monkeypatch, {"a": 0.1, "b": 0.01, "": 0.0}, {"c": 0.0, "d": 0.3})
    assert found == ["a b", "a", "b", "c", ""]  # the calibrated model: there to compare with


@dataclass(frozen=True)
class Ended(Begun):
    """A fit that ended at a merit, with some effects that do nothing."""

    merit: float = 0.0
    idle: tuple[int, ...] = ()

    @property
    def best(self) -> SimpleNamespace:
        return SimpleNamespace(noises=())


@pytest.mark.parametrize(
    ("fit", "known", "yielded"),
    [
        (Ended("a", -25.0), -20.0, [("a", -25.0)]),
        (Ended("a", -15.0, (0,)), -20.0, []),
        (Ended("a", -25.0, (0,)), -20.0, [("", -30.0)]),
    ],
    ids=["does something", "known likelier", "known less likely"],
)
def test_a_set_whose_effect_does_nothing_is_a_fit_of_the_set_without_it(
    monkeypatch: pytest.MonkeyPatch, fit: Ended, known: float, yielded: list[tuple[str, float]]
) -> None:
    """Where that is likelier so than it was, it had ended in a notch and counts as it is now."""
    less = cast("Any", Ended("", -30.0))
    monkeypatch.setattr(growing, "idle", lambda one: list(one.idle))
    monkeypatch.setattr(growing, "merit", lambda one: one.merit)
    monkeypatch.setattr(growing, "weighed_under", lambda one, _: one)
    monkeypatch.setattr(growing, "start_without", lambda *_: SimpleNamespace(begun=lambda: less))
    monkeypatch.setattr(setting, "matters", lambda one: not one.idle)
    sets = object.__new__(Sets)
    before = cast("Any", Ended("", known))
    sets.done, sets.noises = {before.key: before}, []
    sets.material = sets.searched = cast("Any", None)
    monkeypatch.setattr(Sets, "finished", lambda _, one: one)
    monkeypatch.setattr(Sets, "_restarted", lambda _s, one, _l: one)
    found = list(sets._ended([cast("Any", fit)], before))
    assert [(one.name, one.merit) for one in cast("list[Ended]", found)] == yielded
    assert cast("Any", sets.done[before.key]).merit == min(
        [known, *(m for n, m in yielded if not n)]
    )


@pytest.mark.parametrize("leaves", [False, True])
@pytest.mark.parametrize("strains", [False, True])
def test_a_set_is_screened_anew_where_it_leaves_something_or_strains_its_tolerances(
    monkeypatch: pytest.MonkeyPatch, leaves: bool, strains: bool
) -> None:
    """A stiffness far from its tolerance leaves nothing, and may be the conduits' compliance."""
    monkeypatch.setattr(setting, "leaves_something", lambda _: leaves)
    monkeypatch.setattr(setting, "is_strained", lambda _one, _screened: strains)
    monkeypatch.setattr(setting, "screened_from", lambda *_: "anew")
    monkeypatch.setattr(setting, "Screen", lambda _: "screen")
    sets = object.__new__(Sets)
    sets.material = sets.searched = cast("Any", None)
    sets.first = cast("Any", SimpleNamespace(here=[], filed=[]))
    found = cast("Any", sets._screened(cast("Any", Begun("a"))))
    assert (found == "anew") is (leaves or strains)


def test_fits_are_finished_until_one_ends_out_of_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """What each promises tells their order only: b, in a notch, ends beside the likeliest."""
    ends = {"a": -50.0, "b": -49.0, "c": None, "d": -10.0, "e": -49.0, "g": -61.0}
    begun = [Ended(name, -30.0 - k) for k, name in enumerate(ends)]  # the last began likeliest
    begun[-1] = Ended("g", -60.0)  # it is likelier already than all others end

    def finish(_material: object, ones: list[Ended], _noises: object) -> list[Ended]:
        return [Ended(one.name, end) for one in ones if (end := ends[one.name]) is not None]

    def in_reach(tried: list[Ended], rivals: list[Ended]) -> list[Ended]:
        return [one for one in tried if one.merit <= min(each.merit for each in rivals) + 3.0]

    monkeypatch.setattr(setting, "foreseen", lambda one: ord(one.name))
    monkeypatch.setattr(setting, "merit", lambda one: one.merit)
    monkeypatch.setattr(setting, "finish", finish)
    monkeypatch.setattr(setting, "in_reach", in_reach)
    sets = object.__new__(Sets)
    sets.material, sets.noises = cast("Any", None), []
    found = sets._finished_in_turn(cast("Any", begun[::-1]), [cast("Any", Ended("f", -48.0))])
    # The fine model cannot run c, which tells nothing of those behind it; e is never fitted.
    assert [one.name for one in cast("list[Ended]", found)] == ["a", "b", "d", "g"]


@pytest.mark.parametrize(
    ("here", "there", "finished", "yielded"),
    [
        (-25.0, -24.0, [-25.0, -24.0], -35.0),  # both could still carry something
        (-5.0, -24.0, [-24.0], -34.0),  # the way out of a notch
        (-5.0, -4.0, [], -5.0),  # neither could
        (-25.0, None, [-25.0], -35.0),  # no rig answers where the likeliest ended
    ],
)
def test_a_finalist_is_fitted_to_the_end_where_it_could_carry_something(
    monkeypatch: pytest.MonkeyPatch,
    here: float,
    there: float | None,
    finished: list[float],
    yielded: float,
) -> None:
    """Else the fit to the end, the dearest step of all, would change nothing that is said."""
    asked: list[float] = []

    def finish(_material: object, ones: list[Ended], _noises: object) -> list[Ended]:
        asked.extend(one.merit for one in ones)
        return [Ended(one.name, one.merit - 10.0) for one in ones]

    def refitted(_material: object, _searched: object, one: Ended, _other: object) -> Ended:
        return one if there is None else Ended("a", there)

    monkeypatch.setattr(setting, "merit", lambda one: one.merit)
    monkeypatch.setattr(setting, "weighed_under", lambda one, _: one)
    monkeypatch.setattr(setting, "refitted_from", refitted)
    monkeypatch.setattr(setting, "in_reach", lambda tried, _: [o for o in tried if o.merit < -20.0])
    monkeypatch.setattr(setting, "finish", finish)
    monkeypatch.setattr(setting, "matters", lambda _: True)
    sets = object.__new__(Sets)
    sets.material = sets.searched = cast("Any", None)
    sets.done, sets.noises = {}, []
    (found,) = sets._ended([cast("Any", Ended("a", here))], cast("Any", Ended("b", -50.0)))
    assert asked == finished
    assert cast("Any", found).merit == yielded
    assert sets.done == {found.key: found}


def test_a_finalist_that_was_found_likelier_is_compared_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found: list[list[Any]] = []

    def weigh(every: list[Any], *_: Any) -> list[Weighed]:
        found.append([one for one, _ in every])
        return [Weighed(one, prediction, 0.5) for one, prediction in every]

    monkeypatch.setattr(weighing, "posterior", weigh)
    monkeypatch.setattr(weighing, "predict_unseen", lambda _: np.zeros(1))
    first, again = Ended("", -20.0), Ended("", -30.0)
    finalists = Ended("a", -25.0), iter([first]), iter([again])
    sets = SimpleNamespace(finalists=lambda: finalists, base=first, finished=lambda one: one)
    searching._compared(cast("Sets", sets), 32, 0)
    assert found[-1] == [finalists[0], again]
