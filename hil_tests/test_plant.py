"""The rig's mechanics against the closed forms of a cable in a rough conduit.

Reference values: capstan equation and the pull-pull balance derived from it, Table I with
EA = 4000 N, Coulomb friction 0.21, no viscous term. m = mu L / R = 1.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bowden_rig.rig import state as at
from bowden_rig.rig.constants import CONTROL_PERIOD_S, largest_stable_step_s
from bowden_rig.rig.parameters import Cable, Load, Motor, Operator, Rig
from bowden_rig.rig.plant import Plant
from numpy.typing import NDArray

CAPSTAN = math.exp(1.5)
COULOMB = Rig(cable=Cable(viscous_s_per_m=0.0), motor=Motor(current_limit_a=50.0))
LOCKED = replace(COULOMB, operator=Operator(motion="locked"))
PLATEAU_NM = 3.12  # 2 r_load T0 m

Series = Callable[[float], float]


def run(
    rig: Rig, duration_s: float, torque_nm: Series, wanted_rad: Series = lambda _: 0.0
) -> tuple[NDArray[np.float64], Plant]:
    """Scalars after each control period, shape (ticks, SCALARS), and the plant at the end."""
    plant = Plant(rig)
    rows = np.empty((round(duration_s / CONTROL_PERIOD_S), at.SCALARS))
    for k in range(len(rows)):
        t = k * CONTROL_PERIOD_S
        angle = wanted_rad(t)
        speed = (wanted_rad(t + CONTROL_PERIOD_S) - angle) / CONTROL_PERIOD_S
        current = torque_nm(t) / rig.motor.torque_constant_nm_per_a
        plant.advance(current, True, angle, speed)
        rows[k] = plant.scalars
    return rows, plant


def stroke(t: float) -> float:
    """0.7 rad at 0.5 Hz, swelling over the first second."""
    e = min(t, 1.0)
    return 0.7 * e * e * (3.0 - 2.0 * e) * math.sin(math.pi * t)


@pytest.mark.parametrize(
    ("torque_nm", "outward_nm", "inward_nm"),
    [
        (0.0, -3.12, 3.12),
        # ideal compensation of half the friction: tau_l = rho tau_m -+ 2 r_load T0 m
        # outward; inward the motor resists: cable b is slack, a is back-driven through e^m
        (0.3, -1.56, 5.2 * 0.3 * CAPSTAN),
        (-0.2, -5.2 * 0.2 * CAPSTAN, 2.08),
    ],
)
def test_sliding_load_torque_is_the_closed_form(
    torque_nm: float, outward_nm: float, inward_nm: float
) -> None:
    rows, _ = run(COULOMB, 4.0, lambda t: torque_nm * min(t / 0.3, 1.0), stroke)
    rows = rows[len(rows) // 2 :]
    middle = np.abs(rows[:, at.LOAD_ANGLE]) < 0.3
    out = middle & (rows[:, at.LOAD_SPEED] > 0.0)
    back = middle & (rows[:, at.LOAD_SPEED] < 0.0)
    # 1 %: motor inertia adds 6 mN m at the load, 32 elements 0.03 %
    assert np.mean(rows[out, at.LOAD_TORQUE]) == pytest.approx(outward_nm, rel=0.01)
    assert np.mean(rows[back, at.LOAD_TORQUE]) == pytest.approx(inward_nm, rel=0.01)


def test_default_friction_is_within_three_percent_of_coulomb() -> None:
    rows, _ = run(Rig(), 4.0, lambda _: 0.0, stroke)
    rows = rows[len(rows) // 2 :]
    middle = np.abs(rows[:, at.LOAD_ANGLE]) < 0.3
    friction = float(np.mean(np.abs(rows[middle, at.LOAD_TORQUE])))
    assert PLATEAU_NM < friction < 1.03 * PLATEAU_NM


def test_tension_falls_along_a_sliding_cable_as_on_a_capstan() -> None:
    _, plant = run(COULOMB, 2.0, lambda _: 0.0, stroke)  # at the middle, moving outward
    a, b = plant.tension_n()
    assert plant.scalars[at.LOAD_SPEED] > 1.0
    # outward, with the motor back-driven: the load pulls cable b, cable a pays out behind it
    assert b[-1] / b[0] == pytest.approx(CAPSTAN, rel=0.02)
    assert a[0] / a[-1] == pytest.approx(CAPSTAN, rel=0.02)
    wrap = np.linspace(0.0, 1.5, len(b) - 2, endpoint=False) + 1.5 / 64
    assert np.allclose(np.log(b[1:-1] / b[0])[1:], wrap[1:] + 1.5 / 64, atol=0.05)


def test_locked_load_first_pull_reaches_only_part_of_the_conduit() -> None:
    rows, plant = run(LOCKED, 2.0, lambda t: 0.125 * t / 2.0)
    s = plant.scalars
    assert s[at.MOTOR_TENSION_A] == pytest.approx(13.4484, rel=2e-3)
    assert s[at.MOTOR_TENSION_B] == pytest.approx(7.1984, rel=2e-3)
    # 3 %: the liner shears elastically before the cable slides, which the closed form leaves out
    assert s[at.MOTOR_ANGLE] == pytest.approx(8.0942e-3, rel=0.03)
    assert np.max(np.abs(rows[:, at.LOAD_TORQUE])) < 1e-6
    depth_m = np.sum(np.abs(plant.tension_n() - 10.0) > 0.3, axis=1) * 2.0 / 32
    assert depth_m[0] == pytest.approx(0.395, abs=0.07)  # one element
    assert depth_m[1] == pytest.approx(0.438, abs=0.07)


def test_stiff_liner_approaches_the_coulomb_closed_form() -> None:
    stiff = replace(LOCKED, cable=replace(LOCKED.cable, contact_stiffness_n_per_m2=1e7))
    _, plant = run(stiff, 2.0, lambda t: 0.125 * t / 2.0)
    assert plant.scalars[at.MOTOR_ANGLE] == pytest.approx(8.0942e-3, rel=6e-3)


def test_locked_load_feels_the_motor_late_and_then_a_plateau() -> None:
    rows, _ = run(LOCKED, 4.0, lambda t: t / 4.0)
    felt_nm = {
        tau: float(np.interp(tau, rows[:, at.MOTOR_TORQUE], rows[:, at.LOAD_TORQUE]))
        for tau in (0.40, 0.46, 0.55, 0.79, 0.85, 0.95)
    }
    assert abs(felt_nm[0.40]) < 1e-3
    # closed form: first response at 0.50056 N m; the liner's shear smears the front by
    # sqrt(EA / stiffness) = 52 mm, 4 % in tension, to both sides
    assert abs(felt_nm[0.46]) < 5e-3
    assert felt_nm[0.55] > 2e-3
    # slack from 0.76948 N m: cable b carries nothing, the load receives r_load T0 of cable a
    assert felt_nm[0.79] == pytest.approx(1.04, rel=0.03)
    assert felt_nm[0.85] == pytest.approx(1.04, rel=0.01)
    assert felt_nm[0.95] == pytest.approx(
        5.2 * 0.95 / CAPSTAN, rel=0.02
    )  # through: one cable, e^-m


def test_cyclic_locked_load_closes_the_loop_of_the_closed_form() -> None:
    rows, _ = run(LOCKED, 2.25, lambda t: 0.125 * math.sin(2.0 * math.pi * t))
    angle, torque = rows[-4000:, at.MOTOR_ANGLE], rows[-4000:, at.MOTOR_TORQUE]
    area_j = 0.5 * abs(np.sum(torque * np.roll(angle, -1) - angle * np.roll(torque, -1)))
    # presliding stiffness turns some of the loop into elastic back and forth: wider and thinner
    assert np.ptp(angle) == pytest.approx(16.138e-3, rel=0.03)
    assert area_j == pytest.approx(1.3448e-3, rel=0.07)


def test_rest_stays_at_rest() -> None:
    rows, plant = run(replace(COULOMB, operator=Operator(motion="still")), 0.5, lambda _: 0.0)
    assert np.all(rows[:, [at.MOTOR_ANGLE, at.LOAD_ANGLE, at.LOAD_TORQUE]] == 0.0)
    assert np.all(plant.tension_n() == 10.0)


def test_mirrored_inputs_give_exactly_mirrored_motion() -> None:
    def torque(t: float) -> float:
        return 0.3 * math.sin(9.0 * t)

    there, _ = run(Rig(), 1.5, torque, stroke)
    mirror, _ = run(Rig(), 1.5, lambda t: -torque(t), lambda t: -stroke(t))
    signed = [at.MOTOR_ANGLE, at.LOAD_ANGLE, at.MOTOR_TORQUE, at.LOAD_TORQUE]
    assert np.array_equal(there[:, signed], -mirror[:, signed])
    assert np.array_equal(there[:, at.MOTOR_TENSION_A], mirror[:, at.MOTOR_TENSION_B])


@pytest.mark.parametrize(
    "cable",
    [
        Cable(),
        Cable(viscous_s_per_m=0.0, material_damping_s=0.0),
        Cable(pretension_n=2.0),
        Cable(static_ratio=2.0, stribeck_speed_m_per_s=0.01),
        Cable(path=((1.0, 0.1), (1.0, math.inf))),
    ],
)
def test_energy_never_appears_in_a_rig_left_alone(cable: Cable) -> None:
    free = Rig(
        cable=cable,
        load=Load(bearing_friction_nm=0.01),
        motor=Motor(bearing_friction_nm=1e-3),
        operator=Operator(motion="free"),
    )
    plant = Plant(free)
    plant.scalars[at.LOAD_SPEED] = 6.0  # a knock on the handle
    plant.scalars[at.MOTOR_SPEED] = -40.0
    energy_j = [plant.stored_energy_j()]
    for _ in range(2000):
        plant.advance(0.0, False, 0.0, 0.0)
        energy_j.append(plant.stored_energy_j())
    # semi-implicit Euler conserves energy only on average: a mode swings by omega dt / 2 of its
    # own energy, and the axial modes hold little of it; 0.1 % of the knock covers that
    knock_j = energy_j[0] - energy_j[-1]
    assert knock_j > 0.0
    assert np.max(np.array(energy_j[1:]) - np.minimum.accumulate(energy_j)[:-1]) < 1e-3 * knock_j


def test_powered_rig_stores_no_more_than_was_put_in() -> None:
    plant = Plant(Rig())
    start_j = plant.stored_energy_j()
    for k in range(6000):
        t = k * CONTROL_PERIOD_S
        speed = (stroke(t + CONTROL_PERIOD_S) - stroke(t)) / CONTROL_PERIOD_S
        plant.advance(5.0 * math.sin(7.0 * t), True, stroke(t), speed)
        work_j = plant.scalars[at.MOTOR_WORK] + plant.scalars[at.OPERATOR_WORK]
        assert plant.stored_energy_j() - start_j <= work_j + 1e-6


def test_halving_the_step_and_the_elements_changes_little() -> None:
    def load_torque(elements: int, substeps: int) -> NDArray[np.float64]:
        rig = replace(COULOMB, elements=elements, substeps=substeps)
        rows, _ = run(rig, 2.0, lambda _: -0.1, stroke)
        return rows[:, at.LOAD_TORQUE]

    default = load_torque(32, 12)
    step_error_nm = float(np.sqrt(np.mean((default - load_torque(32, 24)) ** 2)))
    element_error_nm = float(np.sqrt(np.mean((default - load_torque(64, 24)) ** 2)))
    assert step_error_nm < 0.005 * PLATEAU_NM
    assert element_error_nm < 0.02 * PLATEAU_NM


def test_unstable_step_is_refused_and_names_one_that_is_not() -> None:
    with pytest.raises(ValueError, match=r"rig\.substeps: found 4; accepted: at least 7"):
        Plant(Rig(substeps=4))
    Plant(Rig(substeps=7))
    assert largest_stable_step_s(Cable(material_damping_s=0.0), 32) == pytest.approx(
        49.4e-6, rel=1e-3
    )


def test_hidden_torque_constant_error_scales_the_true_torque() -> None:
    wrong = replace(LOCKED, motor=replace(LOCKED.motor, torque_constant_error=0.1))
    rows, _ = run(wrong, 0.1, lambda _: 0.1)
    assert rows[-1, at.MOTOR_TORQUE] == pytest.approx(0.11, rel=1e-6)


def test_static_friction_above_sliding_friction_breaks_away_higher() -> None:
    sticky = replace(
        LOCKED, cable=replace(LOCKED.cable, static_ratio=1.5, stribeck_speed_m_per_s=0.005)
    )
    _, plant = run(sticky, 2.0, lambda t: 0.125 * t / 2.0)
    _, plain = run(LOCKED, 2.0, lambda t: 0.125 * t / 2.0)
    assert plant.scalars[at.MOTOR_ANGLE] < 0.9 * plain.scalars[at.MOTOR_ANGLE]


@pytest.mark.parametrize("eccentricity", [0.0, 0.3])
def test_energy_is_kept_where_nothing_rubs(eccentricity: float) -> None:
    """Also an eccentric pulley does no work of its own: radius and wound length belong together."""
    smooth = Rig(
        cable=Cable(friction=0.0, viscous_s_per_m=0.0, material_damping_s=0.0, pretension_n=40.0),
        motor=Motor(eccentricity=eccentricity),
        operator=Operator(motion="free"),
    )
    plant = Plant(smooth)
    start_j = plant.stored_energy_j()
    plant.scalars[at.MOTOR_SPEED] = 20.0
    knock_j = plant.stored_energy_j() - start_j
    kept = []
    for _ in range(4000):
        plant.advance(0.0, False, 0.0, 0.0)
        kept.append((plant.stored_energy_j() - start_j) / knock_j)
    # semi-implicit Euler swings by omega dt / 2 of a mode's energy: 230 rad/s (motor against
    # cables) gives 0.3 %, the axial modes that the knock excites more; no drift over a second
    assert np.max(np.abs(np.array(kept) - 1.0)) < 0.05
    assert np.mean(kept[-1000:]) == pytest.approx(1.0, abs=0.01)
