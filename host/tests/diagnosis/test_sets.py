"""Sets of effects: one that does nothing beside the others is dropped."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from bowden.diagnosis.candidates import Candidate, candidates
from bowden.diagnosis.contribution import coordinates_without, idle, shares
from bowden.diagnosis.fitting import FRICTION, about_first, finish, start_of
from bowden.diagnosis.growing import refitted_from, start_without, without_idle
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material, as_searched, make_material
from bowden.diagnosis.odds import merit, penalty
from bowden.diagnosis.proposals import anew
from bowden.diagnosis.reach import foreseen
from bowden.diagnosis.screening import Screen
from bowden.diagnosis.search import search
from bowden.diagnosis.sets import Sets
from bowden.estimation.covariance import Covariance, Data
from bowden.estimation.nuisance import Nuisance
from bowden.estimation.parameters import Parameters
from bowden.model import Mode, Model, ModelError, parse_model
from bowden.workers import workers
from numpy.typing import NDArray

from ..rigs import TABLE_1
from .lab import CELL, GAIN, MODEL, OFFSET, TRUTH, material_with, measured

(WRAP,) = candidates(("wrap_angle_change",))
SPRING = candidates(("conduit_compliance",))[0]
PRESLIDING = candidates(("presliding_compliance",))[0]
(VISCOUS,) = candidates(("viscous_friction",))
HIDDEN_NM: Final = 0.03
_Numbers = Sequence[Sequence[tuple[Nuisance, float]]]


@pytest.fixture(scope="module")
def material() -> Iterator[Material]:
    with workers(1) as pool:
        yield material_with(pool, {OFFSET: {"offset_nm": HIDDEN_NM}})


@pytest.fixture(scope="module")
def base(material: Material) -> Hypothesis:
    return search(material, MODEL, [OFFSET], seed=1).base


def fitted(
    material: Material, base: Hypothesis, *effects: tuple[Candidate, dict[str, float]]
) -> Hypothesis:
    start = start_of(material, as_searched(MODEL), effects, {}, base.best)
    assert start is not None
    (found,) = finish(material, [start.begun()], base.best.noises)
    return found


def begun_beside(sets: Sets) -> list[Hypothesis]:
    """Begin to fit the hidden effect, where it ends, and two others."""
    found = []
    for effect, values in (
        (OFFSET, {"offset_nm": HIDDEN_NM}),
        (GAIN, {"g": 0.01}),
        (WRAP, {"extra_wrap_rad": 0.1}),
    ):
        start = start_of(sets.material, sets.searched, [(effect, values)], {}, sets.base.best)
        assert start is not None
        found.append(start.begun())
    return found


def test_promises_that_are_not_kept_hide_nothing_that_has_come_further(material: Material) -> None:
    """Fits begun from the file's values go by what screening promised, however they end."""
    sets = Sets(material, as_searched(MODEL))
    right, *wrong = begun_beside(sets)
    children = [*(replace(one, promised=2.0 * merit(right)) for one in wrong), right]
    assert max(map(foreseen, children)) == foreseen(right)  # it comes last
    assert sets.weighed([sets.base], children)[0].names == (OFFSET.name,)


def test_a_promise_of_derivatives_hides_nothing_that_is_likelier_already(
    material: Material, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit that ends far above what its derivatives promised says nothing of those behind it."""
    sets = Sets(material, as_searched(MODEL))
    right, *wrong = begun_beside(sets)
    promise = 2.0 * merit(right)
    monkeypatch.setattr(
        "bowden.diagnosis.sets.foreseen",
        lambda one: foreseen(one) if one.names == right.names else promise,
    )
    assert sets.weighed([sets.base], [*wrong, right])[0].names == right.names


def test_an_effect_that_does_nothing_beside_another_is_dropped(
    material: Material, base: Hypothesis
) -> None:
    both = fitted(material, base, (GAIN, {"g": 0.01}), (OFFSET, {"offset_nm": 0.02}))
    assert [both.effects[i] for i in idle(both)] == [GAIN]
    less = without_idle(material, as_searched(MODEL), both, {})
    assert less is not None
    assert less.names == (OFFSET.name,)
    # Known to a hundredth of itself: counts and noise of 12 s.
    assert less.values(0)["offset_nm"] == pytest.approx(HIDDEN_NM, rel=0.01)
    assert without_idle(material, as_searched(MODEL), both, {less.key: less}) is None


def test_a_law_is_doubted_no_more_than_the_data_leave_it(
    material: Material, base: Hypothesis
) -> None:
    """A bristle's law that the data bear out to a hundredth hides no mass of a tenth of it."""
    bristle = (PRESLIDING, {PRESLIDING.strengths[0].name: PRESLIDING.strengths[0].typical})
    effects = [bristle, (OFFSET, {"offset_nm": HIDDEN_NM})]
    start = start_of(material, as_searched(MODEL), effects, {}, base.best)
    assert start is not None
    both = start.unmoved()

    def doubted(law: float) -> Hypothesis:
        return replace(both, best=replace(both.best, scales=replace(both.best.scales, law=law)))

    alone = shares(both)
    assert shares(doubted(0.0), beside_laws=True) == pytest.approx(alone)
    offset = [shares(doubted(law), beside_laws=True)[1] for law in (0.3, 1.0)]
    assert offset[1] < offset[0] < alone[1]


def test_a_law_is_off_by_its_share_of_what_it_does(material: Material, base: Hypothesis) -> None:
    """What an offset of the cell does is in proportion to it, far and near."""
    one = fitted(material, base, (CELL, {"offset_nm": 0.02}))
    (effect,), (variance,) = one.contributions, one.law_variances()
    assert effect is not None
    expected = CELL.effect.form_error * np.abs(effect.beyond[0])
    # The prediction is rounded to a millionth of a unit step in the derivative's difference.
    np.testing.assert_allclose(np.sqrt(variance), expected, rtol=1e-4, atol=1e-9)
    assert one.law_variances(besides=0)[0].max() == 0.0


def test_a_law_is_not_off_by_what_another_calibration_does() -> None:
    """A conduit that gives way is a softer cable: how much so is the cable's stiffness' to tell."""
    model = parse_model(TABLE_1.replace("_n: 4000", "_n: {value: 4000, tolerance: 50 %}"))
    with workers(1) as pool:
        material = make_material([measured(TRUTH)], model, Mode.TORQUE_POSITION, 1, pool)
        base = search(material, model, [OFFSET], seed=1).base
        effects = [(SPRING, {"stiffness_n_per_m": 2000.0})]
        start = start_of(material, as_searched(model), effects, {}, base.best)
        assert start is not None
        one = start.unmoved()
        (effect,), (variance,) = one.contributions, one.law_variances()
    assert effect is not None
    strength = np.sqrt(variance) / SPRING.effect.form_error
    # To first order they do the same; a tolerance of a half and the derivatives' steps leave some.
    # A straight line from there to no spring at all misses 0.4.
    assert np.sqrt(np.mean(strength**2)) < 0.05 * np.sqrt(np.mean(effect.change[0] ** 2))


def test_a_set_without_an_effect_starts_with_the_numbers_of_the_others(
    material: Material, base: Hypothesis
) -> None:
    """Their places move up, and two of them call their numbers alike."""
    three = fitted(
        material,
        base,
        (GAIN, {"g": 0.01}),
        (CELL, {"offset_nm": 0.002}),
        (OFFSET, {"offset_nm": HIDDEN_NM}),
    )
    start = start_without(material, as_searched(MODEL), three, [0])
    assert start is not None
    less = start.unmoved()
    assert less.values(0) == pytest.approx(three.values(1))
    assert less.values(1) == pytest.approx(three.values(2))
    assert less.coordinates() == pytest.approx(three.coordinates())


def test_calibrated_numbers_take_over_what_an_effect_did(
    material: Material, base: Hypothesis
) -> None:
    """Only the product of coefficient and wrap angle shows: without the one the other does it."""
    offset, extra, wrap = (OFFSET, {"offset_nm": HIDDEN_NM}), 0.1, MODEL.transmission.wrap_rad
    less = fitted(material, base, offset)
    known = less.coordinates()
    for one in less.problem.parameters.each:
        if one.path in FRICTION:
            known[one.path] = one.coordinate(one.value(known[one.path]) / (1.0 + extra / wrap))
    effects = [offset, (WRAP, {"extra_wrap_rad": extra})]
    start = start_of(material, as_searched(MODEL), effects, known, less.best)
    assert start is not None
    both = start.unmoved()
    numbers = both.problem.parameters.each
    (mu,) = (one for one in numbers if one.path == "friction.mu_d")
    with_it = mu.value(both.coordinates()[mu.path])
    without = mu.value(coordinates_without(both, [1])[mu.path])
    # To first order in a change of some per cent; tolerances pull at it, too.
    assert without / with_it - 1.0 == pytest.approx(extra / wrap, rel=0.2)
    # So the smaller set, fitted from there, is no less likely but for the prior of one number more.
    refitted = refitted_from(material, as_searched(MODEL), less, both)
    (again,) = finish(material, [refitted], base.best.noises)
    assert again.best.cost < both.best.cost + 1.0


def test_nothing_starts_where_no_rig_is(
    material: Material, base: Hypothesis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a step along the other numbers takes more wrap away than a path has."""
    effects = [(WRAP, {"extra_wrap_rad": 0.1})]
    assert start_of(material, as_searched(MODEL), effects, {}, base.best) is not None

    def no_rig(_self: Parameters, _x: np.ndarray) -> Model:
        raise ModelError("extra_wrap_rad: found -7, accepted: -6.3 or more, the path's")

    monkeypatch.setattr(Parameters, "model_at", no_rig)
    assert start_of(material, as_searched(MODEL), effects, {}, base.best) is None


def test_a_screen_holds_numbers_of_its_blocks_not_of_every_pair_of_observations(
    base: Hypothesis,
) -> None:
    """Ten minutes at 1 kHz have 74 000 observations: a number of each pair would take 44 GB."""
    count = sum(data.observations.time_s.size for data in base.problem.data)
    tracemalloc.start()
    try:
        Screen(base)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < 8 * count**2


def test_a_gain_is_predicted_with_what_tolerances_no_longer_have_to_stretch() -> None:
    """An angle's offset shows in nothing but its zero, 13 tolerances away: an effect gains that."""
    offset = candidates(("encoder_offset",))[0]
    truth = TRUTH.with_effect(OFFSET.name, {"offset_nm": HIDDEN_NM})
    truth = truth.with_effect(offset.name, {"offset_rad": 0.02})
    with workers(1) as pool:
        readings = make_material([measured(truth)], MODEL, Mode.TORQUE_POSITION, 1, pool)
        calibrated = search(readings, MODEL, [], seed=1).base
        screen = Screen(fitted(readings, calibrated, (OFFSET, {"offset_nm": HIDDEN_NM})))
        (screened, *_) = screen.screen(offset)
        promised = screen.annealed(screened)
        both = fitted(
            readings,
            calibrated,
            (OFFSET, {"offset_nm": HIDDEN_NM}),
            (offset, {"offset_rad": 0.01}),
        )
    gained = screen.parent.best.cost - both.best.cost
    assert gained > 50.0
    # The prediction is linear, and so is an offset; a fit ends within 0.02 of the optimum.
    assert promised == pytest.approx(gained, rel=2e-3)


@pytest.mark.parametrize(
    ("name", "number", "hidden", "is_idle"),
    [
        # A thousandth of the torque: pretension and stiffness within their tolerances do the same
        # but for less than a single reading's error, though thousands of readings agree on it.
        ("load_cell_gain", "g", 0.001, True),
        ("load_cell_gain", "g", 0.01, False),
        # The angle's zero does the same exactly: 0.6 and 3.2 of its tolerances away.
        ("encoder_offset", "offset_rad", 0.001, True),
        ("encoder_offset", "offset_rad", 0.005, False),
    ],
)
def test_an_effect_has_to_do_what_calibration_cannot(
    name: str, number: str, hidden: float, *, is_idle: bool
) -> None:
    effect = candidates((name,))[0]
    truth = TRUTH.with_effect(name, {number: hidden})
    with workers(1) as pool:
        readings = make_material([measured(truth)], MODEL, Mode.TORQUE_POSITION, 1, pool)
        calibrated = search(readings, MODEL, [], seed=1).base
        found = fitted(readings, calibrated, (effect, {number: hidden}))
    assert found.values(0)[number] == pytest.approx(hidden, rel=0.05)
    assert idle(found) == ([0] if is_idle else [])


def test_what_a_solver_makes_of_long_steps_is_no_work_of_an_effect(
    material: Material, base: Hypothesis
) -> None:
    """A friction of speed takes the implicit solver, though next to none does next to nothing."""
    effects = [(VISCOUS, {VISCOUS.strengths[0].name: 1e-6})]
    start = start_of(material, as_searched(MODEL), effects, {}, base.best)
    assert start is not None
    # A tenth of what counts; at the search's long steps the solvers differ by a quarter.
    assert shares(start.unmoved())[0] < 0.1


def test_what_the_fine_model_cannot_run_is_no_hypothesis(
    material: Material, base: Hypothesis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A law so steep that only the coarse model runs it describes no rig."""
    steep = fitted(material, base, (OFFSET, {"offset_nm": HIDDEN_NM}))
    correction = Material.correction

    def able(
        self: Material, model: Model, numbers: _Numbers, data: tuple[Data, ...]
    ) -> list[NDArray[np.float64]]:
        if model.effects:
            raise ModelError("found no agreement, accepted: weaker effects")
        return correction(self, model, numbers, data)

    monkeypatch.setattr(Material, "correction", able)
    noises = base.best.noises
    assert [one.effects for one in finish(material, [steep, base], noises)] == [()]
    first, _ = about_first([steep, base])
    assert first is base
    with pytest.raises(ModelError, match="weaker effects"):
        about_first([steep])


def test_where_no_likelier_set_can_be_propagated_the_covariance_stays(
    material: Material, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At short steps a law may find no equilibrium; the sets are compared all the same."""
    sets = Sets(material, as_searched(MODEL))
    right, *wrong = begun_beside(sets)
    noise = Material.noise

    def able(self: Material, model: Model, numbers: _Numbers) -> list[Covariance]:
        if model.effects:
            raise ModelError("no equilibrium found, accepted: smaller steps")
        return noise(self, model, numbers)

    monkeypatch.setattr(Material, "noise", able)
    assert sets.weighed([right], wrong)[0].names == right.names
    assert sets.about is sets.base


@pytest.mark.parametrize("hidden_kg_m2", [1.2e-5, 3.3e-5])
def test_a_mass_is_screened_between_the_strengths_that_are_tried(hidden_kg_m2: float) -> None:
    """What each does differs in kind: next to the right one, each is a worse model than none."""
    (inertia,) = candidates(("motor_inertia",))
    truth = TRUTH.with_effect(OFFSET.name, {"offset_nm": HIDDEN_NM})
    truth = truth.with_effect(inertia.name, {"inertia_kg_m2": hidden_kg_m2})
    with workers(1) as pool:
        readings = make_material([measured(truth)], MODEL, Mode.TORQUE_POSITION, 1, pool)
        calibrated = search(readings, MODEL, [], seed=1).base
        tried = Screen(calibrated).screen(inertia)
        beside = Screen(fitted(readings, calibrated, (OFFSET, {"offset_nm": HIDDEN_NM})))
        again = anew(readings, tried, beside)
    best = max(again, key=lambda one: one.gain)
    # Strengths lie 39 % apart; a fit goes on from there.
    assert best.values["inertia_kg_m2"] == pytest.approx(hidden_kg_m2, rel=0.15)
    assert best.gain > 100.0 + max((one.gain for one in again if one is not best), default=0.0)


def test_a_mass_that_is_not_there_promises_nothing(material: Material, base: Hypothesis) -> None:
    (inertia,) = candidates(("motor_inertia",))
    beside = Screen(fitted(material, base, (OFFSET, {"offset_nm": HIDDEN_NM})))
    assert max((one.gain for one in beside.peaks(inertia)), default=0.0) < penalty(inertia.effect)


@pytest.mark.parametrize(("hidden_kg_m2", "damping"), [(1.2e-5, 1.0), (4.6e-5, 0.5)])
def test_a_mass_between_two_strengths_is_found(hidden_kg_m2: float, damping: float) -> None:
    """The next strengths tried are up to 39 % away, and resonate elsewhere: each of them is a worse
    model than none. The tolerance is a fourth of that; the fit goes on as the covariance moves."""
    (inertia,) = candidates(("motor_inertia",))
    values = {"inertia_kg_m2": hidden_kg_m2, "damping": damping}
    truth = TRUTH.with_effect("motor_inertia", values)
    with workers(1) as pool:
        readings = make_material([measured(truth)], MODEL, Mode.TORQUE_POSITION, 1, pool)
        found = Sets(readings, as_searched(MODEL))
        found.screen([inertia])
        (best, *_) = found.weighed([found.base], found.added([found.base]))
    assert best.names == ("motor_inertia",)
    assert best.values(0)["inertia_kg_m2"] == pytest.approx(hidden_kg_m2, rel=0.1)
    # The lighter one rings for a few periods only; the search's mesh has a fourth of the segments.
    assert best.values(0)["damping"] == pytest.approx(damping, rel=0.3)
