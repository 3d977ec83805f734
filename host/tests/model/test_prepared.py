"""A prepared simulation answers as a model read from a file with these numbers does."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bowden.model import (
    Inputs,
    Mode,
    Model,
    ModelError,
    format_model,
    parse_model,
    prepare,
    simulate,
    simulate_many,
    table_1,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

TIME_S = np.arange(0.0, 2.0, 0.01)
INPUTS = Inputs(
    TIME_S,
    load_angle_rad=0.5 * np.sin(2 * np.pi * TIME_S),
    motor_torque_nm=0.4 * np.sin(2 * np.pi * 0.7 * TIME_S),
)
MODE = Mode.TORQUE_POSITION
PATHS = ("rig.cable.pretension_n", "friction.mu_d", "rig.cable.path[0].radius_m")


def rig(*effects: str) -> Model:
    text = format_model(table_1()).replace("segments: 100", "segments: 12")
    return parse_model(text.replace("effects: []", f"effects: [{', '.join(effects)}]"), "rig.yaml")


def read_anew(model: Model, paths: tuple[str, ...], values: list[float]) -> Model:
    """The numbers written into the text of the file, by key, and the text read as any file is."""
    text = format_model(model)
    for path, value in zip(paths, values, strict=True):
        key = path.rsplit(".", 1)[-1]
        text, count = re.subn(rf"(\b{key}: (?:{{value: )?)[0-9.e+-]+", rf"\g<1>{value!r}", text)
        assert count == 1, path
    return parse_model(text, "rig.yaml")


@settings(max_examples=25, deadline=None)
@example(1.5, 0.62890625, 2.0, [])  # refused: no equilibrium found
@given(
    st.floats(1.0, 30.0),
    st.floats(0.0, 0.63),
    st.floats(0.1, 2.0),
    st.sampled_from(
        [
            [],
            ["{name: gravity_imbalance, amplitude_nm: 0.1, phase_rad: 1.0}"],
            ["{name: conduit_compliance, stiffness_n_per_m: 8.0e+4}"],
        ]
    ),
)
def test_a_run_is_that_of_the_file_with_these_numbers_bit_for_bit(
    pretension: float, mu: float, radius: float, effects: list[str]
) -> None:
    model, values = rig(*effects), [pretension, mu, radius]
    ready = prepare(model, MODE, INPUTS, PATHS)
    try:
        read = simulate(read_anew(model, PATHS, values), MODE, INPUTS)
    except ModelError as refused:  # one in thousands: the prepared one has to say the same
        with pytest.raises(ModelError, match=re.escape(str(refused))):
            ready.run(values)
        return
    found = ready.run(values)
    for name, series in vars(read).items():
        np.testing.assert_array_equal(getattr(found, name), series, err_msg=name)


def test_numbers_of_effects_vary_too_and_tolerances_stay() -> None:
    model = rig("{name: viscous_friction, mu_v_s_per_m: {value: 0.3, tolerance: 50 %}}")
    paths = ("effects[0].mu_v_s_per_m",)
    ready = prepare(model, MODE, INPUTS, paths)
    assert ready.start.tolist() == [0.3]
    assert ready.with_values([0.5]) == read_anew(model, paths, [0.5])
    assert ready.with_values([0.5]).free_parameters()[-1] == (paths[0], 0.5, 0.25)


def test_a_longer_cable_stretches_its_path() -> None:
    ready = prepare(table_1(), MODE, INPUTS, ["rig.cable.length_m"])
    assert ready.with_values([2.5]).transmission.piece_length_m.tolist() == [2.5]


def values_of(draw: st.DrawFn, many: int) -> NDArray[np.float64]:
    rows = [[draw(st.floats(5, 15)), draw(st.floats(0.05, 0.4)), 0.3] for _ in range(many)]
    return np.array(rows)


@settings(max_examples=10, deadline=None)
@given(st.data(), st.integers(1, 5), st.sampled_from(list(Mode)))
def test_many_are_each_of_them_in_the_order_given(
    data: st.DataObject, many: int, mode: Mode
) -> None:
    truth = simulate(rig(), MODE, INPUTS)
    inputs = Inputs(**{name: getattr(truth, name) for name in ("time_s", *mode.columns)})
    ready = prepare(rig(), mode, inputs, PATHS)
    rows = data.draw(st.composite(values_of)(many))
    found = simulate_many(ready, rows)
    assert found.shape == (many, TIME_S.size, 2)
    for row, answer in zip(rows, found, strict=True):
        alone = ready.run(row)
        for place, name in enumerate(mode.predicted):
            np.testing.assert_array_equal(answer[:, place], getattr(alone, name))


def test_an_impossible_set_leaves_the_others_alone() -> None:
    ready = prepare(rig(), MODE, INPUTS, PATHS)
    found = simulate_many(ready, [[10.0, 0.21, 0.28], [-1.0, 0.21, 0.28], [10.0, 0.7, 0.28]])
    assert np.all(np.isfinite(found[0]))
    assert np.all(np.isnan(found[1:]))
    with pytest.raises(ModelError, match=r"rig\.cable\.pretension_n: found -1, accepted: 0"):
        ready.run([-1.0, 0.21, 0.28])
    with pytest.raises(ModelError, match=r"found mu_s 0\.63 below mu_d 0\.7"):
        ready.run([10.0, 0.7, 0.28])


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e400])
def test_no_number_is_refused(value: float) -> None:
    ready = prepare(rig(), MODE, INPUTS, ["friction.mu_d"])
    with pytest.raises(ModelError, match=r"friction\.mu_d"):
        ready.run([value])


def test_an_impossible_number_of_an_effect_is_refused() -> None:
    model = rig("{name: viscous_friction, mu_v_s_per_m: 0.3}")
    ready = prepare(model, MODE, INPUTS, ["effects[0].mu_v_s_per_m"])
    with pytest.raises(ModelError, match=r"effects\[0\]\.mu_v_s_per_m: found -1"):
        ready.run([-1.0])


def test_what_does_not_go_together_is_refused() -> None:
    model = rig().with_values({"friction.mu_s": 0.21})
    text = format_model(model).replace("segments: 12", "solver: mesh_free")
    ready = prepare(parse_model(text), MODE, INPUTS, ["friction.mu_s"])
    ready.run([0.21])
    with pytest.raises(ModelError, match="mesh_free"):
        ready.run([0.3])


@pytest.mark.parametrize(
    "path",
    ["friction.law", "rig..cable.pretension_n", "rig.cable.path[00].radius_m", "", "x[", "["],
)
def test_a_path_without_a_number_is_refused(path: str) -> None:
    with pytest.raises(ModelError, match="no number"):
        prepare(rig(), MODE, INPUTS, [path])
    with pytest.raises(ModelError, match="no number"):
        rig().with_values({path: 1.0})


def test_values_of_another_shape_are_refused() -> None:
    ready = prepare(rig(), MODE, INPUTS, PATHS)
    with pytest.raises(ValueError, match=r"accepted: \(m, 3\)"):
        simulate_many(ready, [10.0, 0.2, 0.3])


def test_inputs_that_the_mode_cannot_use_are_refused_at_once() -> None:
    with pytest.raises(ModelError, match="load_torque_nm: missing"):
        prepare(rig(), Mode.POSITION_TORQUE, Inputs(TIME_S, motor_angle_rad=TIME_S))
