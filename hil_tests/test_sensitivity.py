"""The table of the diagnosis' constants: complete, and figures that belong to the constant."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from bowden.diagnosis import contribution, odds, predict, proposals, unseen

from hil_tests.benchmarks import decision_constants, remembered, sensitivity
from hil_tests.benchmarks.decision_constants import Constant, constants
from hil_tests.benchmarks.sensitivity import Stated, Tried, heading, page

PAGE = Path(__file__).parents[1] / "docs" / "diagnosis-constants.md"


def _named(name: str) -> Constant:
    return next(one for one in constants() if one.name == name)


def test_the_page_has_the_constants_of_the_code() -> None:
    """Where this fails, `make bench-sensitivity` writes the page anew."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    listed = [tuple(line.strip("| ").split(" | ")[:3]) for line in lines]
    assert listed == [heading(one) for one in constants()]


def test_each_constant_says_what_it_bounds() -> None:
    assert [one.name for one in constants() if not one.bounds] == []


def test_only_the_decision_path_is_read() -> None:
    found = decision_constants.modules()
    assert {"screening", "predict", "odds", "verdict", "contribution"} <= found
    assert not {"localise", "next_experiment", "wording", "waterfall"} & found  # after the verdict


def test_a_constant_is_changed_wherever_it_is_read_and_set_back() -> None:
    places = [vars(one) for one in (unseen, predict, contribution, proposals)]
    with _named("ERROR").set_to(2.0):
        assert [one["ERROR"] for one in places] == [2.0] * len(places)
    assert [one["ERROR"] for one in places] == [1.0] * len(places)


def test_half_and_double() -> None:
    assert (_named("BEGUN").scaled(0.5), _named("BEGUN").scaled(2.0)) == (3, 10)  # of 5
    assert _named("OUTLIER").scaled(2.0) == 0.006
    # odds 19 : 1, halved and doubled: a share stays a share
    assert _named("SURE").scaled(0.5) == pytest.approx(9.5 / 10.5)
    assert _named("SURE").scaled(2.0) == pytest.approx(38.0 / 39.0)


def test_a_step_is_repeated_where_a_constant_that_it_reaches_has_changed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[object] = []
    place = SimpleNamespace(step=lambda what: calls.append(what) or len(calls))  # type: ignore[func-returns-value]
    monkeypatch.setattr(remembered, "STEPS", ((place, "step", "predict"),))
    thing, memory = object(), remembered.Memory()
    with memory.used():
        assert place.step(thing) == place.step(thing) == 1
        with _named("RESAMPLES").set_to(9):  # of `odds`, which no prediction reads
            assert place.step(thing) == 1
        with _named("FOLDS").set_to(8):
            assert place.step(thing) == 2
        assert place.step(thing) == 1
        assert place.step(object()) == 3
    assert calls == [thing, thing, calls[2]]


def test_the_page_tells_what_a_constant_changes() -> None:
    usual = Stated("named", ("wear",), {"wear": 0.96, "nothing": 0.04}, 10.0)
    tie = Stated("ambiguous", ("wear",), {"wear": 0.9, "nothing": 0.1}, 20.0)
    changed = {(one.module, one.name, f): usual for one in constants() for f in sensitivity.FACTORS}
    text = page([Tried("single", usual, {**changed, ("odds", "MORE", 0.5): tie})], "", 7, 1, 12.0)
    (row,) = [line for line in text.splitlines() if line.startswith("| `odds.MORE`")]
    assert row.endswith("| 1 of 1 | 0 of 1 | 0.06 | 0.00 | 2.00 | 1.00 |")
    idle = text[text.index("In these cases") :]
    assert "`odds.MORE`" not in idle
    assert "`odds.SURE`" in idle


def test_cases_are_of_every_kind() -> None:
    found = [one.kind for one in sensitivity.cases(7, 6, 12.0)]
    assert set(found) == {"single", "complete", "unlisted", "pair", "several"}
    assert odds.SURE == 0.95  # nothing above has left a constant changed


def test_every_step_is_remembered_where_it_is_looked_up_and_set_back() -> None:
    steps = [getattr(place, name) for place, name, _ in remembered.STEPS]
    with remembered.Memory().used():
        assert all(
            getattr(place, name) is not step
            for (place, name, _), step in zip(remembered.STEPS, steps, strict=True)
        )
    assert steps == [getattr(place, name) for place, name, _ in remembered.STEPS]
