"""Inertia, gravity, pulleys, cogging and friction that changes: each against a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Inputs, Mode, Trajectory, simulate
from bowden.model.effects.dwell_strengthening import rested
from bowden.model.experiments.variants import with_damping
from scipy.integrate import solve_ivp

from .effects_rig import given, plain, strokes
from .rigs import EA_N, LENGTH_M, R_LOAD_M, R_MOTOR_M, RHO, FloatArray

TP, PT, PP = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION
PLATEAU_NM = 3.12  # 2 r_load T0 m: what the moving pair takes at the load


def run(name: str, values: dict[str, float], inputs: Inputs, mode: Mode = TP) -> Trajectory:
    return simulate(plain().with_effect(name, values), mode, inputs)


def base(inputs: Inputs, mode: Mode = TP) -> Trajectory:
    return simulate(plain(), mode, inputs)


def swinging(hertz: float, seconds: float = 2.0, amplitude: float = 0.5) -> Inputs:
    t = np.arange(int(seconds * 1000)) * 1e-3
    angle = amplitude * np.sin(2 * np.pi * hertz * t)
    return Inputs(t, motor_torque_nm=np.zeros_like(t), load_angle_rad=angle)


# Inertia and weight ------------------------------------------------------------------------------


def test_a_rotor_without_friction_is_a_forced_oscillator() -> None:
    """J theta_m'' + k (theta_m - rho theta_l) = 0, k = 2 r^2 EA/L, from standstill; the load gets
    rho k (theta_m - rho theta_l). Against an integration by Runge and Kutta."""
    inertia = 1e-4
    k = 2 * R_MOTOR_M**2 * EA_N / LENGTH_M
    # Steps are as close as the mesh of a pair with friction: 200 segments ask for steps of 1/3 ms.
    model = with_damping(plain(200, mu_d=0.0), 0.0)
    model = model.with_effect("motor_inertia", {"inertia_kg_m2": inertia})
    t = np.arange(3000) * 1e-3

    def load(time: FloatArray) -> FloatArray:
        return np.asarray(0.1 * np.sin(4 * np.pi * time) * np.clip(time / 0.5, 0.0, 1.0) ** 3)

    found = simulate(model, TP, Inputs(t, None, load(t), np.zeros_like(t)))
    true = solve_ivp(
        lambda time, state: [state[1], -k / inertia * (state[0] - RHO * load(time))],
        (0.0, t[-1]),
        [0.0, 0.0],
        t_eval=t,
        rtol=1e-9,
        atol=1e-12,
        max_step=2e-3,
    ).y[0]
    stretch = true - RHO * load(t)
    # It rings at 126 rad/s from the corner at 0.5 s on: steps of 1/3 ms are (w h)^2 / 12, 0.015 %,
    # slow there, which after 2.5 s is 0.05 rad. They lose nothing of it.
    size = RHO * k * np.abs(stretch).max()
    np.testing.assert_allclose(found.load_torque_nm, RHO * k * stretch, atol=0.06 * size)
    rings = np.ptp(found.load_torque_nm[2500:]) / np.ptp(RHO * k * stretch[2500:])
    assert rings == pytest.approx(1.0, abs=0.02)  # peaks between samples: (w h / 2)^2 / 2 = 0.2 %


def test_a_rotor_on_a_soft_cable_rings_at_its_own_frequency() -> None:
    """A step of torque: theta_m = torque/k (1 - cos w_n t), w_n = sqrt(k/J)."""
    inertia, torque = 1e-4, 0.02
    k = 2 * R_MOTOR_M**2 * EA_N / LENGTH_M
    w = np.sqrt(k / inertia)
    t = np.arange(3000) * 1e-3
    inputs = Inputs(t, None, np.zeros_like(t), np.where(t > 0.05, torque, 0.0))
    model = with_damping(plain(mu_d=0.0), 0.0)
    model = model.with_effect("motor_inertia", {"inertia_kg_m2": inertia})
    angle = simulate(model, TP, inputs).motor_angle_rad
    assert angle.max() == pytest.approx(2.0 * torque / k, rel=0.02)
    crossings = np.flatnonzero(np.diff(np.sign(angle[60:] - torque / k)) != 0)[:5]
    assert np.diff(crossings).mean() * 1e-3 == pytest.approx(np.pi / w, rel=0.02)
    # Samples further apart: the mesh takes its own steps, of a 128th of the period.
    few = Inputs(t[::10], None, np.zeros(300), np.interp(t[::10], t, inputs.motor_torque_nm))
    swing = simulate(model, TP, few).motor_angle_rad * k / torque
    assert np.abs(swing - 1.0).max() == pytest.approx(1.0, abs=0.1)
    turns = np.count_nonzero(np.diff(np.sign(swing[6:106] - 1.0)) != 0) / 2  # in one second
    assert turns == pytest.approx(w / (2 * np.pi), abs=0.5)  # turns are counted by halves


@pytest.mark.parametrize("sample_s", [2.5e-4, 1e-3, 3e-3])
def test_dry_friction_ends_the_ringing_whatever_the_samples(sample_s: float) -> None:
    """A step of torque against a bearing F: each swing is 2 F/k smaller than the one before, until
    one ends within F/k of the balance; there it stays (Den Hartog, Mechanical Vibrations)."""
    inertia, torque = 1e-4, 0.02
    k = 2 * R_MOTOR_M**2 * EA_N / LENGTH_M
    dry = torque / 8.5
    t = np.arange(round(0.4 / sample_s)) * sample_s
    inputs = Inputs(t, None, np.zeros_like(t), np.where(t > 0.049, torque, 0.0))
    model = with_damping(plain(mu_d=0.0), 0.0)
    model = model.with_effect("motor_inertia", {"inertia_kg_m2": inertia})
    angle = simulate(
        model.with_effect("bearing_friction", {"torque_nm": dry}), TP, inputs
    ).motor_angle_rad
    swings = angle[1:-1][np.diff(angle)[1:] * np.diff(angle)[:-1] < 0]
    # In F/k from the start: 15, 4, 11 and 8, where it stays. Samples of w h = 0.38 or less miss a
    # turn by (w h / 2)^2 / 2 = 2 % of its swing, 7.5.
    np.testing.assert_allclose(swings[:3] * k / dry, [15.0, 4.0, 11.0], atol=0.2)
    at_rest = t > 0.05 + 5 * np.pi * np.sqrt(inertia / k)
    np.testing.assert_allclose(angle[at_rest] * k / dry, 8.0, atol=0.2)
    assert np.ptp(angle[at_rest]) == 0.0


@pytest.mark.parametrize("step_s", [3e-4, 5e-4, 1e-3])
def test_the_strands_end_the_ringing_whatever_the_steps(step_s: float) -> None:
    """Strands whose tension is early by tau: ringing falls as exp(-w^2 tau t / 2), and a rotor at
    constant speed feels no drag."""
    inertia, tau_s, speed = 1e-4, 5e-4, 2.0
    k = 2 * R_MOTOR_M**2 * EA_N / LENGTH_M
    w = np.sqrt(k / inertia)
    t = np.arange(round(1.0 / step_s)) * step_s
    model = with_damping(plain(mu_d=0.0), tau_s)
    model = model.with_effect("motor_inertia", {"inertia_kg_m2": inertia})
    load = speed / RHO * t
    found = simulate(model, TP, Inputs(t, None, load, np.zeros_like(t)))
    rings = found.motor_angle_rad - RHO * load
    early, late = np.abs(rings[t < 0.1]).max(), np.abs(rings[(t > 0.45) & (t < 0.55)]).max()
    # Ten per cent for what is between two peaks of the window.
    assert np.log(early / late) == pytest.approx(0.5 * w**2 * tau_s * 0.45, rel=0.1)
    period = t > t[-1] - 2 * np.pi / w
    assert np.abs(rings[period].mean()) < 1e-2 * early


def test_a_late_cell_changes_nothing_of_the_ringing() -> None:
    """A delay puts samples between the samples; what the cables do stays, and is read later."""
    t = np.arange(1000) * 1e-3
    stop = Inputs(t, None, np.minimum(0.5 * t, 0.15), np.zeros_like(t))
    # 200 segments ask for steps as close as the bound below, whatever the samples.
    model = plain(200, mu_d=0.0).with_effect("motor_inertia", {"inertia_kg_m2": 3e-5})
    found = simulate(model, TP, stop).load_torque_nm
    late = model.with_effect("time_delay", {"load_cell_delay_s": 3e-4})
    read = simulate(late, TP, stop).load_torque_nm
    shifted = np.interp(t - 3e-4, t, found)
    ringing = t > 0.3
    # Between samples of the shifted series the line is off by (w h)^2 / 8 = 0.7 %, w h = 0.23.
    size = np.abs(shifted[ringing]).max()
    np.testing.assert_allclose(read[ringing], shifted[ringing], atol=0.01 * size)


@pytest.mark.parametrize("model_of", ["coulomb", "viscous"])
def test_a_gap_and_uneven_steps_do_not_shake_the_rotor(model_of: str) -> None:
    """A rotor at constant speed, taut cables sliding, feels no torque of its own."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.choice([1e-3, 1.9e-3, 0.3e-3, 8e-3], 2000, p=[0.7, 0.1, 0.19, 0.01]))
    t = np.where(t > 1.0, t + 0.7, t) - t[0]
    inputs = Inputs(t, None, 0.2 * t, np.zeros_like(t))
    rig = plain()
    if model_of == "viscous":
        rig = rig.with_effect("viscous_friction", {"mu_v_s_per_m": 0.1})
    still = simulate(rig, TP, inputs)
    found = simulate(rig.with_effect("motor_inertia", {"inertia_kg_m2": 2e-5}), TP, inputs)
    late = t > 0.5  # it has settled: w_n^2 tau / 2 = 12/s
    gap = np.abs(found.load_torque_nm - still.load_torque_nm)[late]
    assert gap.max() < 0.01 * PLATEAU_NM


def test_the_cell_behind_a_handle_reads_the_cables_less_its_inertia_and_weight() -> None:
    inputs = swinging(2.0)
    w, angle = 4 * np.pi, inputs.load_angle_rad
    true = base(inputs).load_torque_nm
    heavy = run("load_inertia", {"inertia_kg_m2": 5e-3}, inputs).load_torque_nm
    expected = true + 5e-3 * w**2 * angle  # - J alpha
    np.testing.assert_allclose(heavy[50:-50], expected[50:-50], atol=0.01 * 5e-3 * w**2 * 0.5)
    tilted = run("gravity_imbalance", {"amplitude_nm": 0.4, "phase_rad": 0.3}, inputs)
    np.testing.assert_allclose(tilted.load_torque_nm, true - 0.4 * np.sin(angle + 0.3), atol=1e-9)


def test_a_weight_given_to_the_cell_moves_the_load() -> None:
    """Position-torque: the cell reads 0, so the cables carry G sin(theta_l + phase): with the
    motor at standstill the load hangs where that balances the cables, from a virgin rig without
    friction
    at theta_l = G sin(phase + theta_l) / k_load."""
    t = np.arange(200) * 1e-3
    still = np.zeros_like(t)
    model = plain(mu_d=0.0).with_effect(
        "gravity_imbalance", {"amplitude_nm": 0.3, "phase_rad": np.pi / 2}
    )
    found = simulate(model, PT, Inputs(t, still, load_torque_nm=still))
    k = 2 * R_LOAD_M**2 * EA_N / LENGTH_M
    angle = found.load_angle_rad[-1]
    # tau_l = k (theta_m / rho - theta_l) by the cables on the load.
    assert -k * angle == pytest.approx(0.3 * np.cos(angle), rel=1e-5)


# The motor's pulley and magnets ------------------------------------------------------------------


def test_an_eccentric_pulley_winds_the_integral_of_its_arm() -> None:
    e, phase = 0.03, 0.8
    found = run("pulley_eccentricity", {"e": e, "phase_rad": phase}, given(PP), PP)
    shaft = given(PP).motor_angle_rad
    assert shaft is not None
    fine = np.linspace(0.0, shaft[700], 20001)
    arm = 1 + e * np.sin(fine + phase)
    wound = float(np.sum((arm[1:] + arm[:-1]) / 2 * np.diff(fine)))
    # The plain pair, its motor at the angle that winds as much, has the same tensions ...
    straight = shaft + e * (np.cos(phase) - np.cos(shaft + phase))
    assert straight[700] == pytest.approx(wound, rel=1e-8)
    plain_run = base(replace(given(PP), motor_angle_rad=straight), PP)
    np.testing.assert_allclose(found.motor_tension_a_n, plain_run.motor_tension_a_n, atol=1e-9)
    # ... and the torque is tension times the arm: no work is lost in the pulley.
    arm = 1 + e * np.sin(shaft + phase)
    np.testing.assert_allclose(found.motor_torque_nm, plain_run.motor_torque_nm * arm, atol=1e-12)
    lost = _work(found.motor_torque_nm, shaft) - _work(plain_run.motor_torque_nm, straight)
    assert abs(lost) < 1e-5 * abs(_work(found.motor_torque_nm, shaft))


def _work(torque: FloatArray, angle: FloatArray) -> float:
    return float(np.sum((torque[1:] + torque[:-1]) / 2 * np.diff(angle)))


def test_an_amplifier_that_lags_leaves_cogging_as_it_is() -> None:
    """Magnets pull at the rotor: of a steady current nothing is late."""
    inputs = strokes(0.0, 0.3, -0.3)
    values = {"amplitude_nm": 0.005, "harmonic": 7, "phase_rad": 1.0}
    alone = simulate(plain().with_effect("cogging", values), TP, inputs)
    both = plain().with_effect("amplifier_lag", {"lag_s": 0.03}).with_effect("cogging", values)
    found = simulate(both, TP, inputs)
    np.testing.assert_allclose(found.load_torque_nm, alone.load_torque_nm, atol=1e-9)  # of 0.1 N m


def test_cogging_is_locked_to_the_motor_that_it_moves() -> None:
    a, n, phase = 0.03, 7.0, 0.4
    values = {"amplitude_nm": a, "harmonic": n, "phase_rad": phase}
    found = run("cogging", values, given(TP))
    ripple = a * np.cos(n * found.motor_angle_rad + phase)
    true = base(replace(given(TP), motor_torque_nm=given(TP).motor_torque_nm + ripple))
    # The passes end when they change 1e-6 of the torque; the angle follows with 1 to 2 N m/rad.
    np.testing.assert_allclose(found.motor_angle_rad, true.motor_angle_rad, atol=1e-6)
    np.testing.assert_allclose(found.load_torque_nm, true.load_torque_nm, atol=2e-5)
    held = run("cogging", values, given(PP), PP).motor_torque_nm
    turned = given(PP).motor_angle_rad
    assert turned is not None
    expected = base(given(PP), PP).motor_torque_nm - a * np.cos(n * turned + phase)
    np.testing.assert_allclose(held, expected, atol=1e-12)


# Friction that changes ---------------------------------------------------------------------------
#
# A moving pair without slack takes 2 r_load T0 (L/R) mu, whatever mu has been: PHYSICS. With the
# mesh's implicit steps a slowly changing mu is followed within a sample.


def test_friction_follows_the_temperature() -> None:
    inputs = replace(strokes(0, 0.5, -0.5, 0.5), conduit_temperature_c=np.full(1201, 30.0))
    found = run("thermal_friction", {"alpha_per_k": -0.01}, inputs).load_torque_nm
    assert found[780] == pytest.approx(0.9 * PLATEAU_NM, rel=1e-4)
    assert found[1180] == pytest.approx(-0.9 * PLATEAU_NM, rel=1e-4)


def test_friction_wears_in_with_travel() -> None:
    inputs = strokes(0, 0.5, -0.5, 0.5)
    found = run("wear", {"a": -0.3, "travel_m": 0.2}, inputs).load_torque_nm
    for at, turned in ((399, 0.5), (799, 1.5), (1199, 2.5)):
        mu = 1 - 0.3 * (1 - np.exp(-turned * R_LOAD_M / 0.2))
        assert abs(found[at]) == pytest.approx(PLATEAU_NM * mu, rel=2e-3)


def test_friction_grows_at_rest_and_is_rubbed_off() -> None:
    t = np.array([0.0, 1.0, 3.0, 3.001, 4.0])
    place = np.array([0.0, 0.0, 0.0, 0.004, 0.004])
    z = rested(t, place, 2.0, 0.001, 0.0)
    assert z[1] == pytest.approx(1 - np.exp(-0.5))
    assert z[2] == pytest.approx(1 - np.exp(-1.5))
    assert z[3] == pytest.approx(z[2] * np.exp(-4.0), rel=0.02)  # no time to rest in 1 ms
    assert z[4] == pytest.approx(1 - (1 - z[3]) * np.exp(-0.999 / 2.0))
    # A second stroke after a rest starts with more friction than it ends with.
    inputs = strokes(0, 0.5, 0.5, 0.5, 0.5, 0.45, -0.5)
    found = run("dwell_strengthening", {"a": 0.4, "dwell_s": 0.3, "distance_m": 0.01}, inputs)
    reversal = found.load_torque_nm[1600:]
    speed = 0.95 * R_LOAD_M / 0.4
    steady = PLATEAU_NM * (1 + 0.4 / (1 + speed * 0.3 / 0.01))
    assert reversal[-1] == pytest.approx(steady, rel=2e-3)
    assert reversal.max() > 1.05 * steady


def test_friction_that_grows_only_at_rest_is_rubbed_off_by_travel_however_slow() -> None:
    t = np.array([0.0, 3.0, 5.0, 5.1])
    place = np.array([0.0, 0.0, 0.004, 0.006])
    z = rested(t, place, 2.0, 0.001, 1e-4)
    assert z[1] == pytest.approx(1 - np.exp(-1.5))
    # At 2 mm/s it grows 400 times slower than at standstill: by less than 1e-3 in all that time.
    assert z[2] == pytest.approx(z[1] * np.exp(-4.0), abs=1e-3)
    assert z[3] == pytest.approx(z[2] * np.exp(-2.0), abs=1e-3)
    # After a rest in mid-stroke the pair breaks away with more friction, and is back to mu_d soon.
    inputs = strokes(0, 0.5, 0.5, 0.5, 0.5, 0.45, -0.5)
    found = run("dwell_strengthening", {"rise": 0.4, "rest_s": 0.3, "travel_m": 0.01}, inputs)
    reversal = found.load_torque_nm[1600:]
    assert reversal[-1] == pytest.approx(PLATEAU_NM, rel=2e-3)
    assert reversal.max() > 1.1 * PLATEAU_NM


def test_friction_along_the_stroke_is_that_of_the_place() -> None:
    angle = strokes(0, 0.7, -0.7, 0.7)
    wave = {"a": 0.2, "waves_per_turn": 5.0, "phase_rad": 0.4}
    bump = {"bump_a": 0.3, "centre_rad": 0.1, "width_rad": 0.15}
    for values in (wave, bump):
        found = run("position_dependent_friction", values, angle).load_torque_nm
        place = angle.load_angle_rad
        assert place is not None
        factor = 1 + 0.2 * np.cos(5 * place + 0.4)
        if values is bump:
            factor = 1 + 0.3 * np.exp(-(((place - 0.1) / 0.15) ** 2))
        # From 0.2 rad after a reversal the whole cable slides, in either direction.
        for part, sign in ((slice(540, 800), 1), (slice(940, 1200), -1)):
            np.testing.assert_allclose(found[part], sign * PLATEAU_NM * factor[part], rtol=0.01)


def test_a_cable_whose_stiffness_was_measured_slack_is_the_parabola_of_its_strain() -> None:
    """Without friction, T = E e + beta e^2 with E the file's EA and slack_gain = 4 beta T0/E^2."""
    slippery = plain(mu_d=0.0)
    gain, pretension_n = 1.5, slippery.transmission.pretension_n
    inputs = given(PP)
    assert inputs.motor_angle_rad is not None
    assert inputs.load_angle_rad is not None
    motor = RHO * inputs.load_angle_rad + 0.1 * np.sin(9.0 * inputs.time_s)
    found = simulate(
        slippery.with_effect("cable_stiffening", {"slack_gain": gain}),
        PP,
        replace(inputs, motor_angle_rad=motor),
    )
    beta = gain * EA_N**2 / (4.0 * pretension_n)
    at_first = (np.sqrt(EA_N**2 + 4.0 * beta * pretension_n) - EA_N) / (2.0 * beta)
    pulled_m = R_MOTOR_M * motor - R_LOAD_M * inputs.load_angle_rad
    strain = at_first + (pulled_m - pulled_m[0]) / LENGTH_M
    expected = EA_N * strain + beta * strain**2
    np.testing.assert_allclose(found.motor_tension_a_n, expected, rtol=1e-6)
    np.testing.assert_allclose(found.load_tension_a_n, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("tau_s", "stiffer"),
    [(1e-6, 1.0), (1e5, 1.5)],  # all of it has come, or none of it yet
)
def test_a_cable_pulled_slowly_is_as_stiff_as_its_file_says(tau_s: float, stiffer: float) -> None:
    inputs = given(TP)
    found = run("viscoelastic_cable", {"slow_a": 0.5, "slow_tau_s": tau_s}, inputs)
    pair = plain()
    path = "rig.cable.axial_stiffness_n"
    plainly = simulate(pair.with_values({path: stiffer * pair.value(path)}), TP, inputs)
    # 1e-4: steps by Newton's method here, from event to event there.
    for name in ("motor_angle_rad", "load_torque_nm"):
        one, other = getattr(found, name), getattr(plainly, name)
        np.testing.assert_allclose(one, other, atol=1e-4 * np.ptp(other))


@pytest.mark.parametrize("end", ["motor_end_n_per_m", "load_end_n_per_m"])
def test_a_conduit_held_softly_at_an_end_is_a_spring_in_series(end: str) -> None:
    """Without friction, theta_m - rho theta_l = tau (L/EA + 1/K)/(2 r^2), whichever end."""
    stiffness = 8000.0
    slippery = plain(mu_d=0.0).with_effect("conduit_compliance", {end: stiffness})
    inputs = given(TP)
    assert inputs.motor_torque_nm is not None
    assert inputs.load_angle_rad is not None
    found = simulate(slippery, TP, replace(inputs, motor_torque_nm=0.5 * inputs.motor_torque_nm))
    gives = (LENGTH_M / EA_N + 1.0 / stiffness) / (2.0 * R_MOTOR_M**2)
    expected = RHO * inputs.load_angle_rad + 0.5 * inputs.motor_torque_nm * gives
    np.testing.assert_allclose(found.motor_angle_rad, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("load_cell_gain", {"g": 0.1}),
        ("load_cell_hysteresis", {"width_nm": 0.1}),
        ("torque_constant_error", {"g": 0.1}),
        ("motor_inertia", {"inertia_kg_m2": 5e-5}),
        ("load_inertia", {"inertia_kg_m2": 5e-3}),
        ("amplifier_lag", {"lag_s": 0.01}),
        ("time_delay", {"load_encoder_delay_s": 0.007}),
        ("wear", {"a": 0.3, "travel_m": 0.5}),
        ("dwell_strengthening", {"a": 0.3, "dwell_s": 0.1, "distance_m": 0.01}),
        ("viscous_friction", {"mu_v_s_per_m": 0.3}),
        ("conduit_compliance", {"stiffness_n_per_m": 5000}),
        ("conduit_compliance", {"motor_end_n_per_m": 5000}),
        ("conduit_compliance", {"load_end_n_per_m": 5000}),
    ],
)
def test_what_has_no_side_is_mirror_symmetric(name: str, values: dict[str, float]) -> None:
    inputs = given(TP)
    assert inputs.motor_torque_nm is not None
    assert inputs.load_angle_rad is not None
    mirrored = replace(
        inputs, motor_torque_nm=-inputs.motor_torque_nm, load_angle_rad=-inputs.load_angle_rad
    )
    one, two = run(name, values, inputs), run(name, values, mirrored)
    np.testing.assert_allclose(two.load_torque_nm, -one.load_torque_nm, atol=1e-9)
    np.testing.assert_allclose(two.motor_angle_rad, -one.motor_angle_rad, atol=1e-9)
