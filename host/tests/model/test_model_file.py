"""Model files: what they say comes out, what they cannot mean is refused, all at once, by path."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.model import ModelError, format_model, parse_model, table_1
from bowden.model.description import TABLE_1
from hypothesis import given, settings
from hypothesis import strategies as st

FRICTION = "friction: {law: stiction, mu_d: 0.21, mu_s: 0.63, stiction_length_m: 0.1}"


def changed(*changes: tuple[str, str]) -> str:
    text = TABLE_1
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def problems_of(text: str) -> tuple[str, ...]:
    with pytest.raises(ModelError) as caught:
        parse_model(text, source="rig.yaml")
    assert str(caught.value).startswith("rig.yaml: ")
    return caught.value.problems


def test_table_1_is_the_papers_with_ea_of_4000_newtons() -> None:
    pair = table_1().transmission
    assert pair.axial_stiffness_n == 4000
    assert pair.length_m == 2
    assert pair.wrap_rad == pytest.approx(7.142857)
    assert (pair.motor_pulley_radius_m, pair.load_pulley_radius_m) == (0.020, 0.104)
    assert (pair.friction.mu_d, pair.friction.mu_s) == (0.21, 0.63)
    assert pair.pretension_n == 10


def test_stiffness_from_end_to_end() -> None:
    text = changed(("axial_stiffness_n: 4000.0", "end_to_end_stiffness_n_per_m: 2000"))
    assert parse_model(text).transmission.axial_stiffness_n == 4000


def test_straight_pieces_have_no_curvature_at_all() -> None:
    text = changed(
        (
            "    - {length_m: 2.0, radius_m: 0.28}",
            "    - {length_m: 0.5, radius_m: .inf}\n    - {length_m: 1.5, radius_m: 0.28}",
        )
    )
    model = parse_model(text)
    assert model.transmission.piece_curvature_per_m.tolist() == [0.0, 1 / 0.28]
    assert parse_model(format_model(model)) == model


def test_an_initial_profile() -> None:
    text = changed(
        (
            "  motor_pulley",
            "    initial_profile: [{position_m: 0, tension_n: 12}, "
            "{position_m: 2, tension_n: 9}]\n  motor_pulley",
        )
    )
    pair = parse_model(text).transmission
    assert pair.initial_tension_n is not None
    assert pair.initial_tension_n.tolist() == [12, 9]


@pytest.mark.parametrize("tolerance", ["10 %", "0.5", "2.5e-1", "'7%'"])
def test_tolerances_survive_writing_and_reading(tolerance: str) -> None:
    model = parse_model(changed(("tolerance: 10 %", f"tolerance: {tolerance}")))
    again = parse_model(format_model(model))
    assert again == model
    assert again.free_parameters() == model.free_parameters()


def test_a_share_is_of_the_value_and_a_number_is_itself() -> None:
    assert table_1().free_parameters() == [("rig.cable.pretension_n", 10.0, 1.0)]
    text = changed(("tolerance: 10 %", "tolerance: 0.3"))
    assert parse_model(text).free_parameters() == [("rig.cable.pretension_n", 10.0, 0.3)]


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 100), st.floats(0.01, 0.5), st.floats(0.05, 10))
def test_values_by_path(pretension: float, mu_d: float, length: float) -> None:
    values = {
        "rig.cable.pretension_n": pretension,
        "friction.mu_d": mu_d,
        "friction.mu_s": 2 * mu_d,
        "rig.cable.length_m": length,
        "rig.cable.path[0].radius_m": 0.5,
    }
    moved = table_1().with_values(values)
    assert {path: moved.value(path) for path in values} == values
    assert moved.transmission.length_m == pytest.approx(length)
    assert moved.transmission.pretension_n == pretension
    assert moved.free_parameters()[0][0] == "rig.cable.pretension_n"
    assert parse_model(format_model(moved)) == moved


def test_values_of_effects_by_path() -> None:
    text = changed(
        (
            "effects: []",
            "effects: [{name: viscous_friction, mu_v_s_per_m: {value: 0.3, tolerance: 50 %}}]",
        )
    )
    model = parse_model(text)
    assert ("effects[0].mu_v_s_per_m", 0.3, 0.15) in model.free_parameters()
    moved = model.with_values({"effects[0].mu_v_s_per_m": 0.4})
    assert moved.transmission.friction.mu_v_s_per_m == 0.4


@pytest.mark.parametrize("path", ["rig.cable.pretension", "friction.law", "nowhere", ""])
def test_a_path_without_a_number_is_refused(path: str) -> None:
    with pytest.raises(ModelError, match="no number"):
        table_1().with_values({path: 1.0})


def test_an_impossible_value_by_path_is_refused() -> None:
    with pytest.raises(ModelError, match=r"rig\.cable\.pretension_n.*found -1"):
        table_1().with_values({"rig.cable.pretension_n": -1.0})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ("length_m: 2.0\n", "length_mm: 2000\n"),
            "rig.cable.length_mm: unknown key, did you mean length_m?",
        ),
        (
            ("radius_m: 0.28", "radius_m: 0"),
            "rig.cable.path[0].radius_m: found 0, accepted: a number above 0",
        ),
        (("4000.0", "'4000 N'"), "rig.cable.axial_stiffness_n: found '4000 N', accepted: a number"),
        (("4000.0", ".nan"), "rig.cable.axial_stiffness_n: found nan"),
        (("4000.0", ".inf"), "rig.cable.axial_stiffness_n: found inf"),
        (("4000.0", "true"), "rig.cable.axial_stiffness_n: found True"),
        (("4000.0", "4000\n    end_to_end_stiffness_n_per_m: 2000"), "rig.cable: found both"),
        (("    axial_stiffness_n: 4000.0\n", ""), "rig.cable: found none"),
        (("mu_d: 0.21", "mu_d: -0.21"), "friction.mu_d: found -0.21, accepted: 0 or more"),
        (("mu_s: 0.63", "mu_s: 0.1"), "friction: found mu_s 0.1 below mu_d 0.21"),
        (("law: stiction", "law: sticktion"), "friction.law: found 'sticktion'"),
        (("law: stiction", "law: coulomb"), "friction: found mu_s with law coulomb"),
        (("law: stiction", "law: dahl"), "friction: found mu_s with law dahl"),
        (("segments: 100", "segments: 0"), "numerics.segments: found 0"),
        (("segments: 100", "segments: 10.5"), "numerics.segments: found 10.5"),
        (
            ("segments: 100", "segments: 100, solver: mesh_free"),
            "numerics: found segments with solver mesh_free",
        ),
        (
            ("segments: 100", "damping_s: 1e-3, solver: mesh_free"),
            "numerics: found damping_s with solver mesh_free, accepted: solver: mesh or lumped",
        ),
        (
            ("segments: 100", "segments: 100, elements: 20, damping_s: 1e-3"),
            "numerics: found elements with solver mesh, accepted: solver: lumped",
        ),
        (("segments: 100", "solver: mesh_free"), "stiction length"),
        (("segments: 100", "solver: lumped"), "numerics.solver: found lumped with stiction"),
        (("path:\n    - {length_m: 2.0, radius_m: 0.28}", "path: []"), "rig.cable.path"),
        (("    - {length_m: 2.0", "    - {length_m: 1.9"), "found pieces of 1.9 m in path"),
        (
            ("value: 10.0, tolerance: 10 %", "value: 10.0, tolerance: 10 N"),
            "rig.cable.pretension_n.tolerance: found '10 N'",
        ),
        (
            ("value: 10.0, tolerance: 10 %", "value: 10.0, tolerance: 0"),
            "rig.cable.pretension_n.tolerance: found 0",
        ),
        (
            ("value: 10.0", "valeu: 10.0"),
            "rig.cable.pretension_n.valeu: unknown key, did you mean value?",
        ),
        (("effects: []", "effects: [{name: viscus_friction}]"), "did you mean viscous_friction?"),
        (
            ("effects: []", "effects: [{name: cogging, amplitude_nm: 0.01, harmonic: 7}]"),
            "effects[0].phase_rad: missing",
        ),
        (
            ("effects: []", "effects: [{name: viscous_friction}]"),
            "effects[0].mu_v_s_per_m: missing",
        ),
        (
            ("effects: []", "effects: [{name: viscous_friction, mu_v_s_per_m: -1}]"),
            "effects[0].mu_v_s_per_m: found -1, accepted: 0 or more",
        ),
        (("effects: []", "effects: viscous_friction"), "effects: found 'viscous_friction'"),
    ],
)
def test_what_a_file_cannot_mean(change: tuple[str, str], says: str) -> None:
    problems = problems_of(changed(change))
    assert any(says in problem for problem in problems), problems


def test_all_problems_come_at_once() -> None:
    text = changed(
        ("length_m: 2.0\n", "length: 2.0\n"),
        ("mu_d: 0.21", "mu_d: -1"),
        ("segments: 100", "segments: -3"),
        ("effects: []", "effects: [{name: nothing}]"),
    )
    assert len(problems_of(text)) == 5  # the first is an unknown key and a missing one


@pytest.mark.parametrize(
    "text", ["", "3", "- 1", "rig: [", "rig: {a: 1", "\t", "a: b: c", "rig: 1\nrig: 2", "\x00"]
)
def test_what_is_no_model_file_is_one_clear_line(text: str) -> None:
    problems = problems_of(text)
    assert all("\n" not in problem for problem in problems)


@settings(max_examples=100, deadline=None)
@given(
    st.recursive(
        st.one_of(st.none(), st.booleans(), st.floats(), st.text(max_size=5)),
        lambda inner: st.one_of(
            st.lists(inner, max_size=3),
            st.dictionaries(
                st.sampled_from(
                    [
                        "rig",
                        "cable",
                        "path",
                        "length_m",
                        "friction",
                        "law",
                        "effects",
                        "name",
                        "value",
                        "tolerance",
                        "numerics",
                    ]
                ),
                inner,
                max_size=4,
            ),
        ),
        max_leaves=12,
    )
)
def test_no_tree_of_any_shape_gives_a_traceback(tree: object) -> None:
    import json  # noqa: PLC0415  (JSON is YAML)

    with pytest.raises(ModelError):
        parse_model(json.dumps(tree))


def test_the_solver_follows_from_what_is_asked() -> None:
    coulomb = (FRICTION, "friction: {law: coulomb, mu_d: 0.21}")
    nothing = ("numerics: {segments: 100}", "numerics: {}")
    assert table_1().solver == "mesh"
    assert parse_model(changed(nothing)).solver == "mesh"
    assert parse_model(changed(coulomb, nothing)).solver == "mesh_free"
    assert parse_model(changed(coulomb)).solver == "mesh"
    viscous = ("effects: []", "effects: [{name: viscous_friction, mu_v_s_per_m: 0.3}]")
    assert parse_model(changed(coulomb, nothing, viscous)).solver == "mesh"
    dahl = (FRICTION, "friction: {law: dahl, mu_d: 0.21, presliding_m: 1.0e-4}")
    assert parse_model(changed(dahl, nothing)).solver == "lumped"


def test_effects_become_numbers_of_the_pair() -> None:
    effects = """effects:
- {name: wrap_angle_change, extra_wrap_rad: 1.0}
- {name: conduit_compliance, stiffness_n_per_m: 2000}
- {name: direction_asymmetry, a: 0.1}
- {name: tension_dependent_friction, p: 0.2}
- {name: stribeck_friction, a: 0.5, v_s_m_per_s: 0.02}
"""
    pair = parse_model(changed(("effects: []\n", effects))).transmission
    assert pair.wrap_rad == pytest.approx(8.142857)
    # 4000 N and 2000 N/m x 2 m in series.
    assert pair.axial_stiffness_n == pytest.approx(2000)
    assert pair.friction.direction_asymmetry == 0.1
    assert pair.friction.tension_exponent == 0.2
    assert (pair.friction.stribeck_gain, pair.friction.stribeck_speed_m_per_s) == (0.5, 0.02)
    assert np.isfinite(pair.length_m)
