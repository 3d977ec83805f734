"""The lumped transmission: slow, it is the mesh-free one; fast, it is masses on springs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from bowden.model.errors import ModelError
from bowden.model.friction.bouc_wen import BoucWen, Branch
from bowden.model.friction.dahl import Dahl
from bowden.model.friction.lugre import LuGre
from bowden.model.lumped import Lumped, simulate_lumped
from bowden.model.mesh_free.solver import simulate_mesh_free
from bowden.model.trajectory import Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
RIG = Transmission(
    axial_stiffness_n=4000.0,
    piece_length_m=np.array([0.8, 0.4, 0.8]),
    piece_curvature_per_m=np.array([4.0, 0.0, 3.0]),
    pretension_n=10.0,
    motor_pulley_radius_m=0.02,
    load_pulley_radius_m=0.104,
    friction=FrictionLaw(0.21, 0.21),
)
TIME = np.arange(1200) * 0.01  # 12 s: slow against the 1.5 ms that a wave takes
ANGLE = 0.5 * np.sin(2 * np.pi * 0.125 * TIME)
TORQUE = 0.35 * np.sin(2 * np.pi * 0.1 * TIME)
DRIVES = {
    "moving load": (Mode.TORQUE_POSITION, 0 * TIME, ANGLE),
    "both": (Mode.TORQUE_POSITION, TORQUE, ANGLE),
    "locked load": (Mode.TORQUE_POSITION, 2 * TORQUE, 0 * TIME),
    "moving motor": (Mode.POSITION_TORQUE, 5 * ANGLE, 4 * TORQUE),
    "two positions": (Mode.POSITION_POSITION, 5.2 * ANGLE, ANGLE),
}


def difference(a: Trajectory, b: Trajectory) -> float:
    """Largest RMS difference of the four series, over their ranges."""
    worst = 0.0
    for name in ("motor_angle_rad", "load_angle_rad", "motor_torque_nm", "load_torque_nm"):
        one, other = getattr(a, name), getattr(b, name)
        if np.ptp(other) > 0:
            worst = max(worst, float(np.sqrt(np.mean((one - other) ** 2)) / np.ptp(other)))
    return worst


@pytest.mark.parametrize("drive", DRIVES)
def test_slow_motion_is_the_quasi_static_answer(drive: str) -> None:
    mode, first, second = DRIVES[drive]
    exact = simulate_mesh_free(RIG, mode, TIME, first, second)
    errors = [
        difference(simulate_lumped(RIG, Lumped(elements=n), mode, TIME, first, second), exact)
        for n in (5, 10, 40)
    ]
    assert errors[2] < 0.004  # a front is known within one of 40 elements; what is left is inertia
    assert errors[2] < errors[1] < errors[0]


@pytest.mark.parametrize(
    "law",
    [
        Dahl,
        LuGre,
        BoucWen,
        lambda x: BoucWen(x, Branch(2.0, 1.2), Branch(1.0, 2.0)),
    ],
    ids=["Dahl", "LuGre", "Bouc-Wen", "Bouc-Wen, two shapes"],
)
def test_each_law_tends_to_coulomb(law: Callable[[float], Dahl | LuGre | BoucWen]) -> None:
    mode, first, second = DRIVES["both"]
    exact = simulate_mesh_free(RIG, mode, TIME, first, second)
    errors = []
    for presliding in (1e-3, 1e-4, 1e-5):
        lumped = Lumped(law=law(presliding))
        errors.append(difference(simulate_lumped(RIG, lumped, mode, TIME, first, second), exact))
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 0.01  # 20 elements


def test_mirror() -> None:
    mode, first, second = DRIVES["both"]
    one = simulate_lumped(RIG, Lumped(), mode, TIME, first, second)
    other = simulate_lumped(RIG, Lumped(), mode, TIME, -first, -second)
    np.testing.assert_allclose(one.motor_angle_rad, -other.motor_angle_rad, atol=1e-9)
    np.testing.assert_allclose(one.motor_tension_a_n, other.motor_tension_b_n, atol=1e-6)


def test_a_free_motor_swings_at_its_natural_frequency() -> None:
    """No friction, load locked: two cables of stiffness EA/L hold the motor's inertia."""
    inertia = 2e-5
    rig = dataclasses.replace(RIG, friction=FrictionLaw(0.0, 0.0))
    lumped = Lumped(elements=10, damping_s=0.0, motor_inertia_kg_m2=inertia)
    stiffness = 2 * 4000.0 / 2.0
    cable = 2 * 0.0022 * 2.0 / 3  # a third of a spring's mass swings with its end (Rayleigh)
    natural = np.sqrt(stiffness / (inertia / 0.02**2 + cable))
    step = 2e-5
    time = np.arange(0, 0.2, step)
    torque = np.full_like(time, 0.05)
    swing = simulate_lumped(rig, lumped, Mode.TORQUE_POSITION, time, torque, 0 * time)
    about = swing.motor_angle_rad - 0.05 / (stiffness * 0.02**2)
    crossings = np.flatnonzero(np.diff(np.sign(about)) != 0)
    # between samples, linearly
    at = crossings - about[crossings] / (about[crossings + 1] - about[crossings])
    period = 2 * step * (at[-1] - at[0]) / (len(at) - 1)
    assert 2 * np.pi / period == pytest.approx(natural, rel=5e-3)  # Rayleigh's third is 0.2 % off
    # implicit Euler takes exp(-h w^2 t/2) of the amplitude, the integrator's own damping
    one, turns = round(period / step), int(time[-1] / period) - 1
    later = about[turns * one : (turns + 1) * one]
    kept = np.exp(-0.5 * step * natural**2 * turns * period)
    assert np.max(later) / np.max(about[:one]) == pytest.approx(kept, rel=0.02)


@pytest.mark.parametrize("elements", [1, 20])
def test_one_kilohertz_is_stable_under_violent_input(elements: int) -> None:
    time = np.arange(2000) * 1e-3
    rng = np.random.default_rng(5)
    torque = 2.0 * np.sign(rng.normal(size=2000))
    angle = np.cumsum(rng.normal(size=2000)) * 0.01
    lumped = Lumped(elements=elements, motor_inertia_kg_m2=5e-6)
    answer = simulate_lumped(RIG, lumped, Mode.TORQUE_POSITION, time, torque, angle)
    assert np.all(np.isfinite(answer.motor_angle_rad))
    assert np.all(answer.load_tension_a_n >= 0)
    still = np.concatenate((torque[:100], np.zeros(1900)))
    rest = simulate_lumped(RIG, lumped, Mode.TORQUE_POSITION, time, still, 0 * angle)
    assert np.ptp(rest.motor_angle_rad[-500:]) < 1e-9  # it comes to a standstill


def test_no_pretension_and_slack_at_both_cables() -> None:
    rig = dataclasses.replace(RIG, pretension_n=0.0)
    mode, first, second = DRIVES["both"]
    answer = simulate_lumped(rig, Lumped(), mode, TIME, first, second)
    exact = simulate_mesh_free(rig, mode, TIME, first, second)
    assert difference(answer, exact) < 0.01
    assert np.mean(answer.slack == exact.slack) > 0.95


def test_what_it_refuses() -> None:
    for wrong in ({"elements": 0}, {"cable_mass_kg_per_m": 0.0}, {"damping_s": -1.0}):
        with pytest.raises(ModelError, match=next(iter(wrong))):
            Lumped(**wrong)  # type: ignore[arg-type]
    profile = dataclasses.replace(
        RIG, initial_position_m=np.array([0.0, 2.0]), initial_tension_n=np.array([10.0, 11.0])
    )
    with pytest.raises(ModelError, match="uniform"):
        simulate_lumped(profile, Lumped(), Mode.TORQUE_POSITION, TIME, 0 * TIME, 0 * TIME)
