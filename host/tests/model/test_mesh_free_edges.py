"""The mesh-free solver on straight pieces and without friction, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from bowden.model.errors import ModelError
from bowden.model.trajectory import Mode
from bowden.model.transmission import FrictionLaw

from .mesh_free_rig import (
    EA,
    MU,
    R_IN,
    RHO,
    T0,
    C,
    L,
    M,
    R,
    phi,
    run,
    table_1,
    through,
    torque_with_load_locked,
)

# ---- straight pieces and no friction


def test_straight_path_at_the_motor_is_a_spring_in_series() -> None:
    straight = 0.7
    rig = table_1(
        piece_length_m=np.array([straight, L]), piece_curvature_per_m=np.array([0.0, 1 / R])
    )
    for tension in (20.0, 4.0):
        sign = np.sign(tension - T0)
        travel = sign * C * T0 * phi(tension / T0) + (tension - T0) * straight / EA
        angle = through(0.0, travel / R_IN)
        answer = run(rig, Mode.POSITION_POSITION, angle, np.zeros_like(angle))
        assert answer.motor_tension_a_n[-1] == pytest.approx(tension, rel=1e-9)


def test_straight_path_between_bends_is_a_spring_at_one_tension() -> None:
    bend, straight = 1.0, 0.8
    rig = table_1(
        piece_length_m=np.array([bend, straight, bend]),
        piece_curvature_per_m=np.array([1 / R, 0.0, 1 / R]),
    )
    at_spring = 12.0  # tension of the straight piece; the front is in the second bend
    tension = at_spring * np.exp(MU * bend / R)
    travel = (
        C * (tension - at_spring)
        - T0 * bend / EA
        + (at_spring - T0) * straight / EA
        + C * T0 * phi(at_spring / T0)
    )
    angle = through(0.0, travel / R_IN)
    answer = run(rig, Mode.POSITION_POSITION, angle, np.zeros_like(angle))
    assert answer.motor_tension_a_n[-1] == pytest.approx(tension, rel=1e-9)


@pytest.mark.parametrize("how", ["no friction", "straight", "hardly curved"])
def test_without_friction_the_pair_is_a_lever_and_a_spring(how: str) -> None:
    changes: dict[str, Any] = {
        "no friction": {"friction": FrictionLaw(0.0, 0.0)},
        "straight": {"piece_curvature_per_m": np.array([0.0])},
        "hardly curved": {"piece_curvature_per_m": np.array([1e-10])},
    }[how]
    torque, angle = through(0.0, 0.15, -0.1, 0.05), through(0.0, 0.5, -0.5, 0.2)
    answer = run(table_1(**changes), Mode.TORQUE_POSITION, torque, angle)
    np.testing.assert_allclose(answer.load_torque_nm, RHO * torque, atol=1e-9)
    windup = torque * L / (2 * EA * R_IN**2)
    np.testing.assert_allclose(answer.motor_angle_rad, RHO * angle + windup, atol=1e-9)


# ---- what it accepts


def test_a_given_profile_is_kept_until_it_is_reached() -> None:
    high = T0 * np.exp(0.5 * M)
    at = np.linspace(0.0, L, 400)
    tension = high * np.exp(-0.5 * MU * at / R)  # falls at half the slope friction can hold
    rig = table_1(initial_position_m=at, initial_tension_n=tension)
    pulled = 1.3 * high
    # the front is where pulled e^-Th meets high e^-Th/2, at Th = 2 ln 1.3
    front = pulled / 1.3**2
    travel = C * ((pulled - front) - 2 * (high - front))
    angle = through(0.0, travel / R_IN)
    answer = run(rig, Mode.POSITION_POSITION, angle, np.zeros_like(angle))
    # the profile is read as straight lines between its points, here within (ln ratio)^2 / 8
    assert answer.motor_tension_a_n[-1] == pytest.approx(pulled, rel=1e-6)
    assert answer.load_tension_a_n[-1] == pytest.approx(tension[-1], rel=1e-12)


def test_a_profile_that_friction_cannot_hold_is_refused() -> None:
    rig = table_1(initial_position_m=np.array([0.0, L]), initial_tension_n=np.array([10.0, 90.0]))
    with pytest.raises(ModelError, match="friction cannot hold"):
        torque_with_load_locked(rig, np.zeros(3))
    straight = table_1(
        piece_curvature_per_m=np.array([0.0]),
        initial_position_m=np.array([0.0, L]),
        initial_tension_n=np.array([10.0, 11.0]),
    )
    with pytest.raises(ModelError, match="path is straight"):
        torque_with_load_locked(straight, np.zeros(3))


@pytest.mark.parametrize(
    ("law", "word"),
    [
        (FrictionLaw(0.2, 0.2, mu_v_s_per_m=0.1), "speed"),
        (FrictionLaw(0.2, 0.2, tension_exponent=0.1), "tension"),
        (FrictionLaw(0.2, 0.2, direction_asymmetry=0.1), "asymmetry"),
        (FrictionLaw(0.2, 0.6, stiction_length_m=0.1), "stiction length"),
    ],
)
def test_laws_without_an_exact_solution_are_refused(law: FrictionLaw, word: str) -> None:
    with pytest.raises(ModelError, match=word):
        torque_with_load_locked(table_1(friction=law), np.zeros(3))


def test_an_absurd_wrap_is_refused() -> None:
    with pytest.raises(ModelError, match="wrap"):
        torque_with_load_locked(table_1(piece_curvature_per_m=np.array([1e4])), np.zeros(3))
