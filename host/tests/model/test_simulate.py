"""`simulate`, `simulate_batch`, closed loops and the single-front model, as callers see them."""

from __future__ import annotations

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
    simulate_batch,
    table_1,
)
from bowden.model.agrawal import simulate_passive_load
from bowden.model.closed_loop import PiFollower, Tunnel, Watched, simulate_closed_loop
from bowden.model.description import TABLE_1

from .rigs import RHO, FloatArray, through, times

TP, PT, PP = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION
STICTION = "friction: {law: stiction, mu_d: 0.21, mu_s: 0.63, stiction_length_m: 0.1}"


def coulomb(numerics: str = "{segments: 50}", effects: str = "[]") -> Model:
    text = TABLE_1.replace(STICTION, "friction: {law: coulomb, mu_d: 0.21}")
    text = text.replace("numerics: {segments: 100}", f"numerics: {numerics}")
    return parse_model(text.replace("effects: []", f"effects: {effects}"))


T: FloatArray = (np.arange(2000) * 1e-3).astype(np.float64)
ANGLE: FloatArray = np.deg2rad(40) * np.sin(np.pi * T)
ZERO = np.zeros_like(T)


@pytest.mark.parametrize(
    ("inputs", "mode", "says"),
    [
        (Inputs(T, motor_torque_nm=ZERO, load_torque_nm=ZERO), TP, "load_angle_rad: missing"),
        (Inputs(T, motor_torque_nm=ZERO, load_torque_nm=ZERO), PT, "motor_angle_rad: missing"),
        (Inputs(T, motor_torque_nm=ZERO, load_torque_nm=ZERO), PP, "motor_angle_rad: missing"),
        (Inputs(T[:0], ZERO[:0], ZERO[:0]), PP, "at least 2"),
        (Inputs(T[:1], ZERO[:1], ZERO[:1]), PP, "at least 2"),
        (Inputs(T, ZERO[:-1], ZERO), PP, "motor_angle_rad: found shape (1999,)"),
        (Inputs(T, ZERO + np.nan, ZERO), PP, "motor_angle_rad: found values that are no finite"),
        (Inputs(T[::-1], ZERO, ZERO), PP, "accepted: increasing"),
        (Inputs(0 * T, ZERO, ZERO), PP, "accepted: increasing"),
        (Inputs(T.reshape(2, -1), ZERO.reshape(2, -1), ZERO.reshape(2, -1)), PP, "shape"),
    ],
)
def test_inputs_that_a_mode_cannot_use(inputs: Inputs, mode: Mode, says: str) -> None:
    with pytest.raises(ModelError) as caught:
        simulate(table_1(), mode, inputs)
    assert says in str(caught.value)


def test_two_torques_are_no_mode() -> None:
    with pytest.raises(ValueError, match="torque-torque"):
        Mode("torque-torque")


@pytest.mark.parametrize("numerics", ["{segments: 200}", "{}"])
def test_both_solvers_start_virgin_at_the_first_sample(numerics: str) -> None:
    given = Inputs(T, motor_torque_nm=ZERO, load_angle_rad=ANGLE + 0.3)
    found = simulate(coulomb(numerics), TP, given)
    assert found.load_angle_rad[0] == 0.3
    assert found.motor_angle_rad[0] == pytest.approx(RHO * 0.3)
    assert found.load_torque_nm[0] == pytest.approx(0, abs=1e-12)
    assert found.load_torque_nm[400] == pytest.approx(-3.12, rel=1e-6)


def test_uneven_steps_and_gaps_are_taken_as_they_come() -> None:
    keep = np.sort(np.random.default_rng(1).choice(T.size - 2, 800, replace=False)) + 1
    keep = np.concatenate([[0], keep[(keep < 600) | (keep > 650)], [T.size - 1]])
    whole = simulate(coulomb(), TP, Inputs(T, motor_torque_nm=ZERO, load_angle_rad=ANGLE))
    thin = simulate(
        coulomb(), TP, Inputs(T[keep], motor_torque_nm=ZERO[keep], load_angle_rad=ANGLE[keep])
    )
    # Friction depends on the path, not the time; a reversal between samples is lost.
    assert np.abs(thin.load_torque_nm - whole.load_torque_nm[keep]).max() < 0.2
    assert thin.load_torque_nm[-1] == pytest.approx(whole.load_torque_nm[-1], rel=1e-6)


def test_a_batch_is_its_parts_in_order() -> None:
    given = Inputs(T, motor_torque_nm=ZERO, load_angle_rad=ANGLE)
    values = np.linspace(5, 20, 7)
    models = [coulomb().with_values({"rig.cable.pretension_n": v}) for v in values]
    found = simulate_batch(models, TP, given)
    for value, one in zip(values, found, strict=True):
        assert np.abs(one.load_torque_nm).max() == pytest.approx(0.312 * value, rel=1e-9)
    halves = [given, Inputs(T, motor_torque_nm=ZERO, load_angle_rad=ANGLE / 2)]
    assert len(simulate_batch([coulomb()], TP, halves)) == 2
    with pytest.raises(ValueError, match="3 models and 2 inputs"):
        simulate_batch(models[:3], TP, halves)


def test_a_tunnel_on_the_load_angle_is_the_same_as_its_torque_given() -> None:
    torque = np.array([Tunnel().torque_nm(float(a))[0] for a in ANGLE])
    assert torque.min() == -0.2
    assert np.all(torque[np.abs(ANGLE) <= 0.05] == 0)
    open_loop = simulate(coulomb(), TP, Inputs(T, motor_torque_nm=torque, load_angle_rad=ANGLE))
    closed = simulate_closed_loop(coulomb(), Tunnel(), T, ANGLE)
    np.testing.assert_allclose(closed.load_torque_nm, open_loop.load_torque_nm, atol=1e-9)
    np.testing.assert_allclose(closed.motor_angle_rad, open_loop.motor_angle_rad, atol=1e-9)


@pytest.mark.parametrize("watched", [Watched.MOTOR_ANGLE, Watched.SCALED_MOTOR_ANGLE])
def test_a_tunnel_on_the_motor_angle_applies_what_it_prescribes(watched: Watched) -> None:
    tunnel = Tunnel(watched)
    found = simulate_closed_loop(coulomb(), tunnel, T, ANGLE)
    scale = RHO if watched is Watched.SCALED_MOTOR_ANGLE else 1.0
    prescribed = np.array([tunnel.torque_nm(float(a) / scale)[0] for a in found.motor_angle_rad])
    # The line is that of the sample's start: at a corner it is off by a sample's motion.
    assert (
        np.abs(found.motor_torque_nm - prescribed).max()
        < 0.5 * np.abs(np.diff(found.motor_angle_rad)).max() / scale
    )


def test_a_stiff_follower_tends_to_equal_shares() -> None:
    """Experiment 3: exactly half each for an ideal follower, the motor's share less for a soft."""
    stiff = simulate_closed_loop(coulomb(), PiFollower(5000.0, 0.0), T, ANGLE)
    assert stiff.motor_torque_nm[400] == pytest.approx(0.3, rel=2e-3)
    assert stiff.load_torque_nm[400] == pytest.approx(-1.56, rel=2e-3)
    soft = simulate_closed_loop(coulomb(), PiFollower(2.0, 0.0), T, ANGLE)
    assert soft.motor_torque_nm[400] < 0.28


def test_a_follower_obeys_its_own_law() -> None:
    gains = PiFollower(5.0, 10.0)
    found = simulate_closed_loop(coulomb(), gains, T, ANGLE)
    error = RHO * ANGLE - found.motor_angle_rad
    integral = np.concatenate([[0.0], np.cumsum(error[1:] * np.diff(T))])
    law = gains.kp_nm_per_rad * error + gains.ki_nm_per_rad_s * integral
    np.testing.assert_allclose(found.motor_torque_nm, law, atol=1e-9)


def test_a_loop_closes_over_rate_terms_and_stiction_too() -> None:
    viscous = coulomb(effects="[{name: viscous_friction, mu_v_s_per_m: 0.3}]")
    for model in (viscous, table_1()):
        found = simulate_closed_loop(model, PiFollower(5.0, 0.0), T, ANGLE)
        law = 5.0 * (RHO * ANGLE - found.motor_angle_rad)
        np.testing.assert_allclose(found.motor_torque_nm, law, atol=1e-6)


@pytest.mark.parametrize("gains", [(0.0, 1.0), (1.0, -1.0), (float("nan"), 0.0)])
def test_impossible_gains(gains: tuple[float, float]) -> None:
    with pytest.raises(ModelError, match="gains"):
        PiFollower(*gains)


def test_one_front_is_all_there_is_until_the_load_moves_a_resting_cable() -> None:
    """A stiff load hardly moves: one front and two agree. A soft one moves cables that rest."""
    model = coulomb().with_values({"rig.cable.pretension_n": 2.0})
    motor = through(0, 1.5, -1.5, 1.5, steps=500)
    t = times(motor)

    def gap(stiffness: float) -> float:
        one = simulate_passive_load(model, t, motor, stiffness)
        two = simulate_passive_load(model, t, motor, stiffness, one_front=False)
        for found in (one, two):
            np.testing.assert_allclose(
                found.load_torque_nm, stiffness * found.load_angle_rad, atol=1e-9
            )
        return float(
            np.abs(one.motor_torque_nm - two.motor_torque_nm).max() / np.ptp(two.motor_torque_nm)
        )

    assert gap(50.0) < 0.01
    assert gap(0.5) > 0.05


@pytest.mark.parametrize("stiffness", [0.0, -1.0, float("inf")])
def test_a_load_that_is_no_spring_is_refused(stiffness: float) -> None:
    with pytest.raises(ModelError, match="load stiffness"):
        simulate_passive_load(coulomb(), T, ANGLE, stiffness)


def test_one_front_needs_coulomb_friction() -> None:
    viscous = coulomb(effects="[{name: viscous_friction, mu_v_s_per_m: 0.3}]")
    with pytest.raises(ModelError, match="rate or tension"):
        simulate_passive_load(viscous, T, ANGLE, 1.0)


def test_what_steps_the_bare_pair_refuses_effects_around_it() -> None:
    gained = coulomb().with_effect("load_cell_gain", {"g": 0.1})
    with pytest.raises(
        ModelError, match=r"effects\[0\]: found load_cell_gain, which a closed loop"
    ):
        simulate_closed_loop(gained, Tunnel(), T, ANGLE)
    worn = coulomb().with_effect("wear", {"a": 0.1, "travel_m": 1.0})
    with pytest.raises(ModelError, match="found wear, which a passive load leaves out"):
        simulate_passive_load(worn, T, ANGLE, 1.0)


def test_the_model_is_not_changed_by_a_run() -> None:
    model = coulomb()
    before = format_model(model)
    simulate(model, TP, Inputs(T, motor_torque_nm=ZERO, load_angle_rad=ANGLE))
    assert format_model(model) == before
