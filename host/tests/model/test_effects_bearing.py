"""Friction of a pulley's bearing: what it takes, how it turns over, what a file may leave out."""

from __future__ import annotations

import numpy as np
from bowden.model import Inputs, Mode, Trajectory, simulate

from .effects_rig import given, plain, strokes

TP = Mode.TORQUE_POSITION


def run(values: dict[str, float], inputs: Inputs) -> Trajectory:
    return simulate(plain().with_effect("bearing_friction", values), TP, inputs)


def test_a_bearing_may_leave_out_its_viscous_part() -> None:
    inputs = given(TP)
    short, whole = (
        run(values, inputs)
        for values in ({"torque_nm": 0.01}, {"torque_nm": 0.01, "viscous_nm_s_per_rad": 0.0})
    )
    np.testing.assert_array_equal(short.load_torque_nm, whole.load_torque_nm)


def test_the_load_s_bearing_turns_over_along_twice_its_wind_up() -> None:
    """After a turn it holds F (1 - x / w), from F one way to -F the other, x the way since."""
    dry_nm, wind_up_rad = 0.1, 2e-3
    inputs = strokes(0.0, 0.1, -0.1, steps=2000)
    values = {"load_torque_nm": dry_nm, "load_wind_up_rad": wind_up_rad}
    took = simulate(plain(), TP, inputs).load_torque_nm - run(values, inputs).load_torque_nm
    angle = inputs.load_angle_rad
    assert angle is not None
    back = np.arange(angle.size) > int(np.argmax(angle))
    expected = dry_nm * np.clip(1.0 - (angle.max() - angle[back]) / wind_up_rad, -1.0, 1.0)
    np.testing.assert_allclose(took[back], expected, atol=1e-12)  # rounding of two torques


def test_a_bearing_without_a_wind_up_in_the_file_has_a_short_one() -> None:
    inputs = strokes(0.0, 0.01, -0.01)
    short, told = (
        run(values, inputs)
        for values in (
            {"load_torque_nm": 0.1},
            {"load_torque_nm": 0.1, "load_wind_up_rad": 1e-4, "load_viscous_nm_s_per_rad": 0.0},
        )
    )
    np.testing.assert_array_equal(short.load_torque_nm, told.load_torque_nm)
