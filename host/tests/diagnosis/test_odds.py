"""From log predictive densities of blocks to a posterior: what makes sure and what must not."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis import verdict as verdicts
from bowden.diagnosis.found import Found
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.localise import Where
from bowden.diagnosis.odds import Weighed, log_prior, posterior
from bowden.diagnosis.result import NamedEffect
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.diagnosis.wording import sentence_of
from bowden.estimation.gap import Gap

BLOCKS = 12
WEAK = {"weak": 0.01, "gone": 0.0}  # of its usual strength; others have it
NOTHING = np.full(BLOCKS, -50.0)  # log density where something unlisted would fit badly
NEVER = -1000.0  # where the inputs did nothing at another moment


@dataclass(frozen=True)
class Stub:
    """A set of effects by their names, without a model behind it."""

    names: tuple[str, ...]

    def relative_strength(self, index: int) -> float:
        return WEAK.get(self.names[index], 1.0)

    @property
    def effects(self) -> tuple[Any, ...]:
        effect = SimpleNamespace(variants=(None,))
        return tuple(SimpleNamespace(effect=effect, name=name) for name in self.names)

    @property
    def problem(self) -> Any:
        return SimpleNamespace(prior=lambda _x: (np.zeros(1), None))

    @property
    def best(self) -> Any:
        return SimpleNamespace(x=None)


def weighed(*sets: tuple[str, Any, Any], rarer: float = 0.0, shifted: Any = NEVER) -> list[Weighed]:
    """Weigh sets by what each says of the blocks; outliers are so much less likely than `large`."""
    found = []
    for names, small, large in sets:
        stub = Stub(tuple(names.split()))
        each = [np.zeros(BLOCKS) + one for one in (small, large, shifted, large - rarer)]
        prediction = UnseenPrediction(*each, (), (), ())
        found.append((cast("Hypothesis", stub), prediction))
    return posterior(found, candidates=32, seed=0)


def decided(every: list[Weighed], monkeypatch: pytest.MonkeyPatch) -> verdicts.Decision:
    def named(one: Hypothesis, share: dict[str, float]) -> list[NamedEffect]:
        return [NamedEffect(name, name, "", {}, share[name]) for name in one.names]

    monkeypatch.setattr(verdicts, "effects_of", named)
    monkeypatch.setattr(verdicts, "shares", lambda one: [1.0] * len(one.names))
    return verdicts.decide(Found(tuple(every), every[0].hypothesis, every[0].hypothesis, ()))


def test_what_predicts_better_in_every_block_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    found = decided(weighed(("", 0.0, NOTHING), ("a", 2.0, NOTHING)), monkeypatch)
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["a"]


def test_one_lucky_block_makes_nothing_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    lucky = np.zeros(BLOCKS)
    lucky[3] = 24.0  # as much in all as 2 a block
    every = weighed(("", 0.0, NOTHING), ("a", lucky, NOTHING))
    assert decided(every, monkeypatch).verdict != "named"


def test_an_effect_that_predicts_no_better_does_not_pay_its_prior(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = weighed(("", 0.0, NOTHING), ("a", 0.1, NOTHING))
    assert decided(every, monkeypatch).verdict == "complete"


def test_two_that_predict_alike_are_a_tie(monkeypatch: pytest.MonkeyPatch) -> None:
    every = weighed(("", 0.0, NOTHING), ("a", 5.0, NOTHING), ("b", 5.0, NOTHING))
    found = decided(every, monkeypatch)
    assert found.verdict == "ambiguous"
    assert {one.name for one in found.effects} == {"a", "b"}
    assert found.tied == (("a", "b"),)
    assert sum(found.odds.values()) == pytest.approx(1.0)


def test_what_is_ruled_out_is_not_in_a_tie_that_something_unlisted_shares(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What "unlisted" carries counts as well: sets without weight do not make up for it."""
    every = weighed(("", 0.0, NOTHING), ("a", 9.0, 9.1), ("b", 9.0, NOTHING), ("c", 1.0, NOTHING))
    found = decided(every, monkeypatch)
    assert found.odds["unlisted"] > 0.05
    assert found.verdict == "ambiguous"
    assert {one.name for one in found.effects} == {"a", "b"}
    assert found.tied == (("a", "b"),)
    gap = Gap("load_torque_nm", 0.02, 0.005, 0.004)
    said = sentence_of(
        "ambiguous",
        found.effects,
        gap,
        Where((), (), cast("Any", None)),
        tied=found.tied,
        odds=found.odds,
    )
    assert said == (
        "The model lacks a or b or something that no effect of the catalogue explains; these "
        "recordings cannot say which. Each brings the held-out gap in load torque from 20 mN m to "
        "about 5 mN m."
    )


@pytest.mark.parametrize(("after", "said"), [(0.002, "falls"), (0.004, "rises")])
def test_a_gap_below_the_noise_may_rise_beside_what_is_named(
    monkeypatch: pytest.MonkeyPatch, after: float, said: str
) -> None:
    found = decided(weighed(("", 0.0, NOTHING), ("a", 9.0, NOTHING)), monkeypatch)
    gap = Gap("load_torque_nm", 0.003, after, 0.005)
    where = Where((), (), cast("Any", None))
    assert f"{said} from 3 mN m to {1e3 * after:g} mN m" in sentence_of(
        found.verdict, found.effects, gap, where, tied=found.tied, odds=found.odds
    )


def test_what_is_in_every_likely_set_is_named_beside_a_tie(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = weighed(
        ("", 0.0, NOTHING), ("a", 1.0, NOTHING), ("a b", 9.0, NOTHING), ("a c", 9.0, NOTHING)
    )
    found = decided(every, monkeypatch)
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["a"]
    assert found.tied == (("b", "c"),)
    # The figures are those of a likely set, not of the sure effect alone.
    assert set(found.chosen.hypothesis.names) in ({"a", "b"}, {"a", "c"})


def test_a_learned_law_beside_a_sure_effect_ties_with_no_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = weighed(("", 0.0, NOTHING), ("a b", 9.0, NOTHING), ("a learned", 8.9, NOTHING))
    found = decided(every, monkeypatch)
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["a"]
    assert found.tied == ()
    assert found.odds["unlisted"] > 0.05


def test_something_unlisted_beats_names_that_fit_badly(monkeypatch: pytest.MonkeyPatch) -> None:
    every = weighed(("", 0.0, 9.0), ("a", 2.0, 10.0))
    found = decided(every, monkeypatch)
    assert found.verdict == "unlisted"
    assert found.effects == ()


def test_one_block_that_fits_badly_is_an_outlier_and_three_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for bad, verdict in ((1, "complete"), (3, "unlisted")):
        small = np.zeros(BLOCKS)
        small[:bad] = -100.0
        assert decided(weighed(("", small, -5.0)), monkeypatch).verdict == verdict


@pytest.mark.parametrize(("rarer", "likelier"), [(0.0, "nothing"), (4.0, "unlisted")])
def test_a_block_that_is_off_by_more_than_outliers_are_says_that_something_is_there(
    monkeypatch: pytest.MonkeyPatch, rarer: float, likelier: str
) -> None:
    """Noise is off by a little now and then, by a hundredfold hardly ever."""
    small = np.zeros(BLOCKS)
    small[0] = -400.0
    found = weighed(("", small, -5.0), rarer=rarer)
    assert next(iter(decided(found, monkeypatch).odds)) == likelier


@pytest.mark.parametrize(("shifted", "verdict"), [(0.0, "complete"), (-60.0, "unlisted")])
def test_blocks_in_which_the_inputs_may_have_turned_at_another_moment_say_nothing(
    monkeypatch: pytest.MonkeyPatch, shifted: float, verdict: str
) -> None:
    """Three blocks of twelve are off: by what the inputs do nearby, or by what they do nowhere."""
    small = np.zeros(BLOCKS)
    small[:3] = -100.0
    found = weighed(("", small, -5.0), shifted=shifted)
    assert decided(found, monkeypatch).verdict == verdict


def test_the_order_of_the_hypotheses_changes_nothing() -> None:
    sets = [("", 0.0, NOTHING), ("a", 1.0, NOTHING), ("b", 0.9, NOTHING)]
    one, other = weighed(*sets), weighed(*reversed(sets))
    assert [w.hypothesis.names for w in one] == [w.hypothesis.names for w in other]
    np.testing.assert_allclose([w.weight for w in one], [w.weight for w in other])


def test_an_effect_of_no_strength_is_not_there() -> None:
    """A fit may leave one at its bound; the set is that without it."""
    both, one = (cast("Hypothesis", Stub(names)) for names in (("a", "gone"), ("a",)))
    assert log_prior(both) == log_prior(one)


def test_a_look_alike_of_a_hundredth_of_its_usual_strength_has_a_hundredth_of_the_odds() -> None:
    """Of unlisted things beside either there are as many."""
    usual, weak = weighed(("a", 0.0, NOTHING), ("weak", 0.0, NOTHING))
    assert usual.hypothesis.names == ("a",)
    assert weak.weight / usual.weight == pytest.approx(0.01, rel=1e-9)
