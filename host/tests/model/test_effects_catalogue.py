"""The catalogue as a whole: what every effect must keep, and how a model file may hold them."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from bowden.model import (
    Inputs,
    Mode,
    Model,
    ModelError,
    format_model,
    parse_model,
    simulate,
)
from bowden.model.effects import CATALOGUE, Effect, Variant
from bowden.model.effects.table import markdown_table
from bowden.model.trajectory import COLUMNS

from .effects_rig import given, plain

TP, PT, PP = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION
MODES = pytest.mark.parametrize("mode", [TP, PT, PP], ids=lambda mode: mode.value)
CONTRACTS = """
viscous_friction, stribeck_friction, presliding_compliance, frictional_lag, direction_asymmetry,
tension_dependent_friction, bearing_friction, thermal_friction, wear, dwell_strengthening,
position_dependent_friction, wrap_angle_change, conduit_compliance, cable_stiffening,
pretension_loss, viscoelastic_cable, termination_backlash, pulley_eccentricity,
encoder_eccentricity, encoder_offset, load_cell_gain, load_cell_offset, load_cell_drift,
load_cell_hysteresis, torque_constant_error, motor_torque_offset, cogging, motor_inertia,
load_inertia, gravity_imbalance, time_delay, amplifier_lag
"""
REFUSED: set[tuple[str, Mode]] = set()
"""What the model says it cannot run."""

VARIANTS = [
    pytest.param(effect, variant, id=f"{effect.name} {variant.where}".strip())
    for effect in CATALOGUE.values()
    for variant in effect.variants
    if variant.is_computed
]


def test_the_names_are_those_of_the_contract() -> None:
    assert list(CATALOGUE) == re.findall(r"\w+", CONTRACTS)
    assert all(name == effect.name for name, effect in CATALOGUE.items())


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda effect: effect.name)
def test_an_entry_says_what_a_fit_and_a_reader_need(effect: Effect) -> None:
    assert effect.title
    assert effect.law
    assert effect.signature
    assert effect.excited_by
    assert set(effect.confused_with) <= set(CATALOGUE) - {effect.name}
    names = [parameter.name for parameter in effect.parameters]
    assert len(set(names)) == len(names)
    assert len({frozenset(variant.names) for variant in effect.variants}) == len(effect.variants)
    for variant in effect.variants:
        assert any(p.off is not None for p in variant.parameters)
    for p in effect.parameters:
        assert p.low < p.high
        assert p.low <= p.typical <= p.high
        assert not p.problem(p.low), "what is plausible must be possible"
        assert not p.problem(p.high)
        assert p.problem(math.nan)
        if p.off is not None:
            assert not p.problem(p.off)
            assert p.off == (math.inf if p.scale == "reciprocal" else 0.0)
        else:
            assert p.scale != "reciprocal"
        assert p.scale == "linear" or p.low > 0
        if p.period is not None:
            assert (p.low, p.high) == (0.0, p.period)


@MODES
@pytest.mark.parametrize(("effect", "variant"), VARIANTS)
def test_at_off_nothing_is_left_of_it(effect: Effect, variant: Variant, mode: Mode) -> None:
    """Nested: whatever the shape, strength zero is the model without the effect."""
    model, inputs = plain(), given(mode)
    base = simulate(model, mode, inputs)
    rng = np.random.default_rng(sum(map(ord, effect.name)))
    for _ in range(2):
        values = {
            p.name: p.off
            if p.off is not None
            else _somewhere(p.low, p.high, whole=p.whole, rng=rng)
            for p in variant.parameters
        }
        found = simulate(model.with_effect(effect.name, values), mode, inputs)
        for name in COLUMNS:
            expected = getattr(base, name)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(getattr(found, name), expected, atol=1e-9 * scale, rtol=0)


def _somewhere(low: float, high: float, *, whole: bool, rng: np.random.Generator) -> float:
    value = float(rng.uniform(low, high))
    return float(round(value)) if whole else value


@MODES
@pytest.mark.parametrize(("effect", "variant"), VARIANTS)
def test_at_its_typical_strength_it_shows_and_repeats(
    effect: Effect, variant: Variant, mode: Mode
) -> None:
    model = plain().with_effect(effect.name, variant.typical)
    inputs = given(mode, rest_s=0.2 if "standstill" in effect.excited_by else 0.0)
    base = simulate(plain(), mode, inputs)
    if (effect.name, mode) in REFUSED:
        with pytest.raises(ModelError, match="accepted"):
            simulate(model, mode, inputs)
        return
    found = simulate(model, mode, inputs)
    again = simulate(model, mode, inputs)
    change = 0.0
    for name in COLUMNS:
        series = getattr(found, name)
        assert np.all(np.isfinite(series))
        np.testing.assert_array_equal(series, getattr(again, name))
        size = np.abs(getattr(base, name)).max()
        change = max(change, np.abs(series - getattr(base, name)).max() / size)
    if mode is PP and effect.name == "encoder_offset":
        assert change < 1e-9  # two angles are taken to agree at the first sample
    else:
        assert change > 1e-4
    for name in mode.columns:
        np.testing.assert_allclose(getattr(found, name), getattr(inputs, name), atol=1e-12)


@pytest.mark.parametrize(
    "pair",
    [
        ("load_cell_gain", "load_cell_offset"),
        ("time_delay", "encoder_eccentricity"),
        ("torque_constant_error", "cogging"),
        ("wear", "viscous_friction"),
    ],
)
def test_the_order_in_the_file_does_not_matter(pair: tuple[str, str]) -> None:
    first, second = (CATALOGUE[name] for name in pair)
    values = [effect.variants[0].typical for effect in (first, second)]
    one = plain().with_effect(first.name, values[0]).with_effect(second.name, values[1])
    two = plain().with_effect(second.name, values[1]).with_effect(first.name, values[0])
    found = [simulate(model, TP, given(TP)) for model in (one, two)]
    for name in COLUMNS:
        expected = getattr(found[0], name)
        np.testing.assert_allclose(
            getattr(found[1], name), expected, atol=1e-9 * np.abs(expected).max(), rtol=0
        )


def test_an_effect_is_appended_and_its_values_move_by_path() -> None:
    model = plain().with_effect("viscous_friction", {"mu_v_s_per_m": 0.3})
    model = model.with_effect("cogging", {"amplitude_nm": 0.01, "harmonic": 7, "phase_rad": 1.0})
    assert [one.effect.name for one in model.effects] == ["viscous_friction", "cogging"]
    moved = model.with_values({"effects[1].phase_rad": 2.0})
    assert moved.effects[1].values == {"amplitude_nm": 0.01, "harmonic": 7, "phase_rad": 2.0}
    assert parse_model(format_model(moved)).document == moved.document
    endless = model.with_effect("conduit_compliance", {"stiffness_n_per_m": math.inf})
    assert parse_model(format_model(endless)).document == endless.document


def test_both_places_of_an_effect_are_two_entries() -> None:
    model = plain().with_effect("encoder_offset", {"offset_rad": 0.1})
    both = model.with_effect("encoder_offset", {"load_offset_rad": 0.02})
    found = simulate(both, TP, given(TP))
    base = simulate(plain(), TP, given(TP))
    # The load really was 0.02 rad behind, so the motor 5.2 times that; its encoder adds 0.1 rad.
    shift = found.motor_angle_rad - base.motor_angle_rad
    np.testing.assert_allclose(shift, 0.1 - 5.2 * 0.02, atol=1e-9)


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ("[{name: coging}]", "effects[0].name: found 'coging', no known effect, did you mean"),
        ("[{name: encoder_offset}]", "effects[0].offset_rad: missing"),
        (
            "[{name: encoder_offset, offset_rad: 0.1, load_offset_rad: 0.1}]",
            "effects[0].load_offset_rad: found with offset_rad, accepted: another entry",
        ),
        (
            "[{name: encoder_offset, offset_rad: 0.1}, {name: encoder_offset, offset_rad: 0.2}]",
            "effects[1]: encoder_offset with offset_rad stands in effects[0] already",
        ),
        (
            "[{name: cogging, amplitude_nm: 0.01, harmonic: 6.5, phase_rad: 0}]",
            "effects[0].harmonic: found 6.5, accepted: 1 .. 1000, a whole number",
        ),
        ("[{name: wear, a: -2, travel_m: 1}]", "effects[0].a: found -2, accepted: -1 or more"),
        ("[{name: load_cell_gain, g: .inf}]", "effects[0].g: found inf, accepted: -0.9 .. 10"),
        ("[{name: load_cell_gain, g: none}]", "effects[0].g: found 'none', accepted: a number"),
        ("[{name: load_cell_gain, gain: 1}]", "effects[0].gain: unknown key"),
        (
            "[{name: conduit_compliance, stiffness_n_per_m: 0}]",
            "effects[0].stiffness_n_per_m: found 0",
        ),
    ],
)
def test_entries_that_mean_nothing(entries: str, says: str) -> None:
    text = format_model(plain()).replace("effects: []", f"effects: {entries}")
    with pytest.raises(ModelError) as caught:
        parse_model(text)
    assert any(says in problem for problem in caught.value.problems), caught.value.problems


@pytest.mark.parametrize("solver", ["mesh_free", "lumped"])
def test_a_solver_without_histories_refuses_them_by_name(solver: str) -> None:
    text = format_model(plain()).replace("segments: 30", f"solver: {solver}")
    model: Model = parse_model(text)
    with pytest.raises(ModelError, match=rf"found {solver} with wear, accepted: mesh"):
        model.with_effect("wear", {"a": 0.1, "travel_m": 1.0})
    # What lies outside the cables goes with every solver.
    gained = simulate(model.with_effect("load_cell_gain", {"g": 0.1}), TP, given(TP))
    base = simulate(model, TP, given(TP))
    np.testing.assert_allclose(gained.load_torque_nm, 1.1 * base.load_torque_nm)


def test_friction_by_temperature_needs_a_temperature() -> None:
    model = plain().with_effect("thermal_friction", {"alpha_per_k": 0.01})
    with pytest.raises(ModelError, match="conduit_temperature_c"):
        simulate(model, TP, Inputs(given(TP).time_s, None, *_two(TP)))
    broken = given(TP).time_s * np.nan
    with pytest.raises(ModelError, match="conduit_temperature_c: found values that are no finite"):
        simulate(
            model,
            TP,
            Inputs(given(TP).time_s, None, *_two(TP), conduit_temperature_c=broken),
        )


def _two(mode: Mode) -> tuple[np.ndarray, np.ndarray]:
    inputs = given(mode)
    assert inputs.load_angle_rad is not None
    assert inputs.motor_torque_nm is not None
    return inputs.load_angle_rad, inputs.motor_torque_nm


def test_the_page_has_the_catalogue_as_it_is() -> None:
    """If this fails: python -m bowden.model.effects.table, and put its output into the page."""
    page = Path(__file__).parents[3] / "docs" / "effects.md"
    assert markdown_table() in page.read_text(encoding="utf-8")


def test_the_example_of_the_page_works(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[3] / "docs" / "effects.md").read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    names: dict[str, Effect] = {}
    exec(compile(code, "docs/effects.md", "exec"), names)
    monkeypatch.setitem(CATALOGUE, "load_cell_bend", names["EFFECT"])
    model = plain().with_effect("load_cell_bend", {"c_per_nm": 0.02})
    true = simulate(plain(), TP, given(TP)).load_torque_nm
    read = simulate(model, TP, given(TP)).load_torque_nm
    np.testing.assert_allclose(read, true + 0.02 * true * np.abs(true))
    back = Inputs(given(PT).time_s, given(PT).motor_angle_rad, load_torque_nm=read)
    found = simulate(model, PT, back)
    base = simulate(plain(), PT, Inputs(back.time_s, back.motor_angle_rad, load_torque_nm=true))
    np.testing.assert_allclose(found.load_angle_rad, base.load_angle_rad, atol=1e-9)
