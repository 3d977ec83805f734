"""Effects that feel what the cables are yet to answer: agreement, and what it costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Inputs, Mode, Model, ModelError, Trajectory, looks_ahead, simulate
from bowden.model import simulation as simulation_module
from bowden.model.histories import TorqueSlope
from bowden.model.mesh.solver import simulate_mesh
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from .effects_rig import given, plain
from .rigs import EA_N, LENGTH_M, R_MOTOR_M, RHO, FloatArray, printed, through, times

TP, PT = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE
STIFFNESS_NM_PER_RAD = 2 * R_MOTOR_M**2 * EA_N / LENGTH_M  # of both cables, at the motor
COGGING = {"amplitude_nm": 0.02, "harmonic": 7, "phase_rad": 1.0}


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """One entry for each run of the solver."""
    made: list[None] = []

    def counted(*args: object) -> Trajectory:
        made.append(None)
        return simulate_mesh(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(simulation_module, "simulate_mesh", counted)
    return made


def cogging(share: float = 1.0, **others: dict[str, float]) -> Model:
    values = COGGING | {"amplitude_nm": share * COGGING["amplitude_nm"]}
    model = plain().with_effect("cogging", values)
    for name, more in others.items():
        model = model.with_effect(name, more)
    return model


# A torque with its slope -------------------------------------------------------------------------


@pytest.mark.parametrize("law", [{}, {"tension_exponent": -0.2}], ids=["events", "implicit"])
@pytest.mark.parametrize("mode", [TP, PT])
@settings(max_examples=20)
@drawn(steepness=st.floats(-0.1, 2.0), about=st.floats(-1.0, 1.0), pretension_n=st.floats(2, 20))
def test_a_torque_with_a_slope_is_that_torque_at_the_angle_found(
    law: dict[str, float], mode: Mode, steepness: float, about: float, pretension_n: float
) -> None:
    """Run again with the torque that the slope gave at each angle: the same angles come out.

    Also with slack cables, and where the torque drives the pulley on: by less than half of what one
    cable alone resists that slides whole, 0.5 * 0.21 of both. With friction that rises with the
    tension, 10^0.2 times at ten times the pretension, that is 0.5 * 0.12: more has no equilibrium.
    """
    steepness = max(steepness, -0.05 if law else -0.1)
    pair = printed(10, pretension_n=pretension_n, **law)
    held = through(0.0, 0.5, -0.4, 0.2, steps=240)
    torque = through(0.0, 0.15, -0.2, 0.1, steps=240)
    at_load = RHO if mode is PT else 1.0
    away = 1.0 if mode is PT else -1.0  # a load's torque holds against its angle
    slope = TorqueSlope(
        np.full(held.size, away * steepness * STIFFNESS_NM_PER_RAD * at_load**2),
        np.full(held.size, about / RHO if mode is PT else about),
    )
    series = (torque, held) if mode is TP else (RHO * held, at_load * torque)
    found = simulate_mesh(pair, mode, times(held), *series, None, slope)
    angle = found.motor_angle_rad if mode is TP else found.load_angle_rad
    given_nm = series[mode is PT]
    felt: FloatArray = given_nm + slope.nm_per_rad * (angle - slope.about_rad)
    series = (felt, series[1]) if mode is TP else (series[0], felt)
    again = simulate_mesh(pair, mode, times(held), *series)
    other = again.motor_angle_rad if mode is TP else again.load_angle_rad
    # Within a sample one torque goes straight in time, the other in place: where a cable goes slack
    # or a pulley turns, friction remembers which. That falls with the sample: with 180 of them a
    # median was 1.1e-4 that with 720 is 2.4e-5.
    apart = np.abs(other - angle) / np.ptp(angle)
    assert np.median(apart) < 1e-4
    assert np.sqrt(np.mean(apart**2)) < 0.01


def test_a_passive_slope_is_a_spring_at_the_motor() -> None:
    """Without friction both are springs in series: theta = rho theta_l K / (K + k), K of cables."""
    load = through(0.0, 0.05, -0.04, steps=50)  # no cable goes slack
    none = np.zeros_like(load)
    slope = TorqueSlope(np.full(load.size, -0.5 * STIFFNESS_NM_PER_RAD), none)
    found = simulate_mesh(printed(10, mu_d=0.0), TP, times(load), none, load, None, slope)
    np.testing.assert_allclose(found.motor_angle_rad, RHO * load / 1.5, atol=1e-9)


# Passes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "others",
    [
        {},
        {"viscoelastic_cable": {"a": 0.2, "tau_s": 0.5}},
        {"encoder_eccentricity": {"e_rad": 0.03, "phase_rad": 0.5}},
    ],
    ids=lambda others: "+".join(others) or "alone",
)
def test_a_neighbour_is_found_in_one_pass(
    others: dict[str, dict[str, float]], runs: list[None]
) -> None:
    inputs = given(TP)
    near = simulate(cogging(1.02, **others), TP, inputs)
    runs.clear()
    alone = simulate(cogging(**others), TP, inputs)
    assert len(runs) > 1
    runs.clear()
    found = simulate(cogging(**others), TP, inputs, near)
    assert len(runs) == 1
    # Passes end within 1e-5 of the largest torque, 0.2 N m, which meets 1.6 N m/rad at the motor.
    np.testing.assert_allclose(found.motor_angle_rad, alone.motor_angle_rad, atol=5e-6)
    np.testing.assert_allclose(found.load_torque_nm, alone.load_torque_nm, atol=5e-5)


def test_a_far_neighbour_changes_the_cost_only(runs: list[None]) -> None:
    inputs = given(TP)
    alone = simulate(cogging(), TP, inputs)
    far = replace(alone, motor_angle_rad=np.zeros_like(alone.motor_angle_rad))
    runs.clear()
    found = simulate(cogging(), TP, inputs, far)
    assert len(runs) > 1
    np.testing.assert_allclose(found.motor_angle_rad, alone.motor_angle_rad, atol=5e-6)


def test_a_neighbour_at_other_samples_serves_as_well(runs: list[None]) -> None:
    inputs = given(TP)
    thinned = Inputs(
        *(None if one is None else one[::3] for one in vars(inputs).values())  # type: ignore[arg-type]
    )
    near = simulate(cogging(), TP, thinned)
    runs.clear()
    found = simulate(cogging(), TP, inputs, near)
    assert len(runs) <= 2
    alone = simulate(cogging(), TP, inputs)
    np.testing.assert_allclose(found.motor_angle_rad, alone.motor_angle_rad, atol=5e-6)


def test_only_what_feels_an_answer_looks_ahead() -> None:
    assert looks_ahead(cogging(), TP)
    assert not looks_ahead(cogging(), PT)  # there the motor's angle is given
    assert not looks_ahead(plain(), TP)


def test_cogging_steeper_than_the_cables_is_refused() -> None:
    """A motor that snaps from step to step has several answers: none is called the answer."""
    steep = plain().with_effect("cogging", {"amplitude_nm": 0.1, "harmonic": 48, "phase_rad": 0.0})
    with pytest.raises(ModelError, match="no agreement in 16 passes, accepted: weaker effects"):
        simulate(steep, TP, given(TP))
