"""Each effect that can be hidden in the rig does what its definition says, with the right sign.

Reference values are closed forms of the pair (capstan, series springs, first-order lags) with
Table I's numbers: EA 4000 N, L 2 m, T0 10 N, mu 0.21, R 0.28 m, r 0.020 and 0.104 m.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bowden_rig.rig import mechanics
from bowden_rig.rig import state as at
from bowden_rig.rig.cable import CREEP
from bowden_rig.rig.constants import CONTROL_PERIOD_S
from bowden_rig.rig.hidden import TABLE, hide
from bowden_rig.rig.parameters import Cable, Load, Motor, Operator, Rig, Sensing
from bowden_rig.rig.plant import Plant
from bowden_rig.rig.sensors import SensorBoard

from hil_tests.test_plant import COULOMB, LOCKED, PLATEAU_NM, run, stroke

SMOOTH = Cable(friction=0.0, viscous_s_per_m=0.0, material_damping_s=1e-3)
# material damping of 1 ms asks for finer steps; the motor's own damping settles the rest
SLIPPERY = Rig(
    cable=SMOOTH,
    motor=Motor(bearing_viscous_nm_s_per_rad=0.01, current_limit_a=50.0),
    operator=Operator(motion="locked"),
    elements=8,
    substeps=48,
)
STIFFNESS_NM = 2.0 * 0.02**2 * 4000.0 / 2.0  # of both cables at the motor, load locked
QUIET = Sensing(load_cell_noise_nm=0.0, current_noise_a=0.0)


def plateaus(rig: Rig) -> tuple[float, float]:
    """Load torque in the middle of outward and of inward strokes, motor without torque."""
    rows, _ = run(rig, 4.0, lambda _: 0.0, stroke)
    rows = rows[len(rows) // 2 :]
    middle = np.abs(rows[:, at.LOAD_ANGLE]) < 0.1
    out = middle & (rows[:, at.LOAD_SPEED] > 0.0)
    back = middle & (rows[:, at.LOAD_SPEED] < 0.0)
    torque = rows[:, at.LOAD_TORQUE]
    return float(np.mean(torque[out])), float(np.mean(torque[back]))


def settled(rig: Rig, torque_nm: float, duration_s: float = 1.0) -> Plant:
    return run(rig, duration_s, lambda _: torque_nm)[1]


@pytest.mark.parametrize(
    ("effect", "parameters", "outward", "inward"),
    [
        ("direction_asymmetry", {"a": 0.1}, 1.1, 0.9),
        ("wrap_angle_change", {"extra_wrap_rad": 0.7}, 1.0 + 0.7 / 7.142857, 1.0 + 0.7 / 7.142857),
        # 25 degC is five kelvin above the reference
        ("thermal_friction", {"alpha_per_k": -0.02}, 0.9, 0.9),
        ("position_dependent_friction", {"a": 0.2, "waves_per_turn": 1.0}, 1.2, 1.2),
        ("position_dependent_friction", {"bump_a": 0.2, "width_rad": 2.0}, 1.2, 1.2),
        # after 4 s of strokes nearly all of it has come
        ("wear", {"a": 0.2, "travel_m": 0.02}, 1.2, 1.2),
        # 0.05 s and 5 m of slip at 0.2 m/s: always as if rested
        ("dwell_strengthening", {"a": 0.2, "dwell_s": 0.05, "distance_m": 50.0}, 1.2, 1.2),
        # mu_v times 2.2 rad/s 0.104 m, on 0.21
        ("viscous_friction", {"mu_v_s_per_m": 0.1}, 1.109, 1.109),
        ("stribeck_friction", {"a": 0.3, "v_s_m_per_s": 10.0}, 1.3, 1.3),
    ],
)
def test_friction_of_the_sliding_pair_is_scaled(
    effect: str, parameters: dict[str, float], outward: float, inward: float
) -> None:
    out_nm, in_nm = plateaus(hide(COULOMB, effect, parameters))
    # 2 %: the motor's inertia, and the middle of the stroke is a range of angles and speeds
    assert out_nm == pytest.approx(-PLATEAU_NM * outward, rel=0.02)
    assert in_nm == pytest.approx(PLATEAU_NM * inward, rel=0.02)


def test_at_standstill_friction_bears_what_it_bore_sliding() -> None:
    # Out by half a radian, softly stopped, then still: nothing slides, so nothing is let go.
    def stopped(t: float) -> float:
        share = min(max((t - 0.1) / 0.6, 0.0), 1.0)
        return 0.5 * share * share * (3.0 - 2.0 * share)

    rows, _ = run(hide(COULOMB, "direction_asymmetry", {"a": 0.3}), 1.0, lambda _: 0.0, stopped)
    sliding = rows[round(0.6 / CONTROL_PERIOD_S), at.LOAD_TORQUE]
    still = rows[-1, at.LOAD_TORQUE]
    assert sliding == pytest.approx(-1.3 * PLATEAU_NM, rel=0.01)
    # 1.5 %: the cables' own mass and damping push no more
    assert still == pytest.approx(sliding, rel=0.015)


def test_friction_that_falls_with_tension_bends_the_capstan() -> None:
    p = 0.3
    rig = hide(COULOMB, "tension_dependent_friction", {"p": p})
    _, plant = run(rig, 2.0, lambda _: 0.0, stroke)
    b = plant.tension_n()[1]
    # dT/ds = mu (T / T0)^-p T / R: T^p grows by p mu T0^p a radian; half an element at each end
    wrap = 1.5 / 0.21
    assert b[-1] ** p - b[0] ** p == pytest.approx(p * 0.21 * 10.0**p * wrap, rel=0.02)


def test_bearing_at_the_motor_takes_its_torque_before_the_cables_do() -> None:
    plant = settled(hide(SLIPPERY, "bearing_friction", {"torque_nm": 0.02}), 0.05)
    s = plant.scalars
    cables = 0.02 * (s[at.MOTOR_TENSION_A] - s[at.MOTOR_TENSION_B])
    # what is left over; settling, the bearing unwinds by 1 or 2 % of its friction
    assert cables == pytest.approx(0.03, abs=5e-4)
    assert settled(hide(SLIPPERY, "bearing_friction", {"torque_nm": 0.02}), 0.01).scalars[
        at.MOTOR_ANGLE
    ] == pytest.approx(0.0, abs=1e-4)  # within the bearing's wind-up


def test_conduit_gives_in_series_with_its_cable() -> None:
    soft = settled(hide(SLIPPERY, "conduit_compliance", {"stiffness_n_per_m": 2000.0}), 0.1)
    plain = settled(SLIPPERY, 0.1)
    assert plain.scalars[at.MOTOR_ANGLE] == pytest.approx(0.1 / STIFFNESS_NM, rel=1e-3)
    # the cable's own EA / L is 2000 N/m as well: twice the give
    assert soft.scalars[at.MOTOR_ANGLE] == pytest.approx(0.2 / STIFFNESS_NM, rel=1e-3)


def test_stiffening_cable_has_its_stiffness_at_pretension_and_more_above() -> None:
    beta = 0.05
    rig = replace(SLIPPERY, cable=replace(SMOOTH, stiffening_per_n=beta), substeps=96)
    small = settled(rig, 0.01)
    assert small.scalars[at.MOTOR_ANGLE] == pytest.approx(0.01 / STIFFNESS_NM, rel=1e-3)
    s = settled(rig, 0.2).scalars
    # T = ((1 + beta T0) exp(beta k x / (1 + beta T0)) - 1) / beta, x = +-r theta
    k, at_rest = 2000.0, 1.0 + beta * 10.0
    for sign, place in ((1.0, at.MOTOR_TENSION_A), (-1.0, at.MOTOR_TENSION_B)):
        grown = math.exp(beta * k * sign * 0.02 * s[at.MOTOR_ANGLE] / at_rest)
        assert s[place] == pytest.approx((at_rest * grown - 1.0) / beta, rel=2e-3)


def test_viscoelastic_cable_creeps_by_its_share_with_its_time() -> None:
    rig = hide(SLIPPERY, "viscoelastic_cable", {"a": 0.3, "tau_s": 0.5})
    rows, plant = run(rig, 4.0, lambda _: 0.1)
    angle = rows[:, at.MOTOR_ANGLE] * STIFFNESS_NM / 0.1
    assert angle[-1] == pytest.approx(1.3, rel=1e-3)
    # the step itself takes 10 ms of 500: 2 % of the creep
    assert angle[round(0.5 / CONTROL_PERIOD_S)] == pytest.approx(1.3 - 0.3 / math.e, abs=0.01)
    assert np.all(plant.springs[CREEP, 0] > 0.0)


def test_pretension_creeps_away_as_the_logarithm_of_time() -> None:
    rig = hide(SLIPPERY, "pretension_loss", {"a": 0.05, "tau_s": 0.1})
    assert settled(rig, 0.0, 2.0).tension_n() == pytest.approx(
        10.0 * (1.0 - 0.05 * math.log1p(20.0)), rel=1e-3
    )


def test_load_pulley_floats_in_its_play_and_then_hands_the_torque_on() -> None:
    rig = hide(SLIPPERY, "termination_backlash", {"play_rad": 0.02})
    rows, plant = run(rig, 2.0, lambda t: 0.05 * t / 2.0)
    lead = rows[:, at.PULLEY_ANGLE] - rows[:, at.LOAD_ANGLE]
    floating = (lead < 0.0099) & (rows[:, at.MOTOR_ANGLE] > 0.005)
    assert np.any(floating)
    assert np.max(np.abs(rows[floating, at.LOAD_TORQUE])) < 2e-3
    # full width 0.02 rad: half of it to this side; the stop gives 0.26 N m / 5000 N m/rad
    assert lead[-1] == pytest.approx(0.01, abs=1e-4)
    assert plant.scalars[at.LOAD_TORQUE] == pytest.approx(5.2 * 0.05, rel=0.01)


def test_stop_at_the_end_of_the_play_pushes_but_never_pulls() -> None:
    c = Plant(hide(SLIPPERY, "termination_backlash", {"play_rad": 0.02})).packed_constants[0]
    for side in (1.0, -1.0):
        for speed in (-10.0, 0.0, 10.0):  # leaving the stop, pressed on it, hitting it
            s = np.zeros(at.SCALARS)
            s[at.PULLEY_ANGLE], s[at.PULLEY_SPEED] = side * 0.0101, side * speed
            torque = side * mechanics.turn_pulley(c, s, 0.0)
            assert torque >= 0.0
            assert (torque == 0.0) == (speed < 0.0)  # damping alone would hold it back


def test_presliding_slip_is_where_the_bristles_reach_their_limit() -> None:
    rig = hide(COULOMB, "presliding_compliance", {"slip_m": 3e-4})
    plant = run(rig, 2.0, lambda _: 0.0, stroke)[1]
    tension = plant.tension_n()
    mean = 0.5 * (tension[:, 1:] + tension[:, :-1])
    # full-blown sliding: each bristle is bent by its slip in proportion to tension over T0
    assert np.abs(plant.masses[2]) == pytest.approx(3e-4 * mean / 10.0, rel=0.02)


def test_lagging_friction_comes_late_after_a_reversal_and_in_full() -> None:
    def triangle(t: float) -> float:
        return 0.4 * abs((2.0 * t + 0.5) % 2.0 - 1.0) - 0.2  # 0.8 rad/s

    def rise_s(lag_s: float) -> tuple[float, float]:
        rig = COULOMB if lag_s == 0.0 else hide(COULOMB, "frictional_lag", {"lag_s": lag_s})
        rows, _ = run(rig, 2.0, lambda _: 0.0, triangle)
        reversal = round(1.25 / CONTROL_PERIOD_S)
        after = rows[reversal : reversal + 1900, at.LOAD_TORQUE]
        level = abs(float(after[-1]))
        arrived = np.abs(after - after[-1]) < 0.05 * level
        return float(np.argmax(arrived)) * CONTROL_PERIOD_S, level

    quick, plain = rise_s(0.0)
    slow, lagged = rise_s(0.03)
    assert lagged == pytest.approx(plain, rel=0.02)
    assert slow > quick + 0.02


def test_gravity_and_inertia_are_between_cables_and_load_cell() -> None:
    heavy = hide(LOCKED, "gravity_imbalance", {"amplitude_nm": 0.3, "phase_rad": 0.5 * math.pi})
    s = settled(heavy, 0.0, 0.1).scalars
    assert s[at.CELL_TORQUE_MEAN] == pytest.approx(s[at.LOAD_TORQUE] - 0.3, abs=1e-9)
    swung = hide(replace(SLIPPERY, operator=Operator()), "load_inertia", {"inertia_kg_m2": 1e-3})
    rows, _ = run(swung, 3.0, lambda _: 0.0, stroke)
    rows = rows[4000:]
    acceleration = np.gradient(rows[:, at.LOAD_SPEED], CONTROL_PERIOD_S)
    off = rows[:, at.CELL_TORQUE_MEAN] - rows[:, at.LOAD_TORQUE]
    # -J alpha at the peaks of a 0.7 rad stroke at 0.5 Hz; half a period between mean and end
    far = np.abs(acceleration) > 5.0
    assert off[far] == pytest.approx(-1e-3 * acceleration[far], rel=0.1, abs=5e-4)


def test_errors_of_the_motor_torque_add_to_what_the_drive_believes() -> None:
    def torque(effect: str, parameters: dict[str, float]) -> float:
        return float(settled(hide(LOCKED, effect, parameters), 0.1, 0.05).scalars[at.MOTOR_TORQUE])

    assert torque("torque_constant_error", {"g": 0.1}) == pytest.approx(0.11, rel=1e-6)
    assert torque("motor_torque_offset", {"offset_nm": -0.02}) == pytest.approx(0.08, rel=1e-6)
    rig = hide(LOCKED, "cogging", {"amplitude_nm": 0.01, "harmonic": 12.0, "phase_rad": 0.3})
    s = settled(rig, 0.1, 0.5).scalars
    expected = 0.1 + 0.01 * math.cos(12.0 * s[at.MOTOR_ANGLE] + 0.3)
    assert s[at.MOTOR_TORQUE] == pytest.approx(expected, rel=1e-3)  # it stands still by now


def test_motor_offset_is_there_only_while_the_bridge_is_on() -> None:
    plant = Plant(hide(LOCKED, "motor_torque_offset", {"offset_nm": 0.05}))
    plant.advance(0.0, False, 0.0, 0.0)
    assert plant.scalars[at.MOTOR_TORQUE] == 0.0


@pytest.mark.parametrize("end", ["", "load_"])
def test_eccentric_pulley_winds_the_integral_of_its_arm(end: str) -> None:
    name = {"": "e", "load_": "load_e"}[end]
    phase = {"": "phase_rad", "load_": "load_phase_rad"}[end]
    rig = hide(
        replace(SLIPPERY, operator=Operator()), "pulley_eccentricity", {name: 0.05, phase: 1.0}
    )
    _, plant = run(rig, 1.5, lambda _: 0.0, lambda t: 0.4 * min(t, 1.0))
    s = plant.scalars
    motor, load = s[at.MOTOR_ANGLE], s[at.LOAD_ANGLE]

    def wound(radius: float, e: float, angle: float) -> float:
        return radius * (angle + e * (math.cos(1.0) - math.cos(angle + 1.0)))

    # at standstill, without torque and friction, both ends have wound the same length
    at_motor, at_load = (0.05, 0.0) if end == "" else (0.0, 0.05)
    assert wound(0.02, at_motor, motor) == pytest.approx(wound(0.104, at_load, load), rel=2e-3)


def reading(effect: str, parameters: dict[str, float], **truth: float) -> tuple[int, ...]:
    places = {
        "motor": at.MOTOR_ANGLE,
        "load": at.LOAD_ANGLE,
        "cell": at.CELL_TORQUE_MEAN,
        "current": at.CURRENT_MEAN,
    }
    s = np.zeros(at.SCALARS)
    for name, value in truth.items():
        s[places[name]] = value
    board = SensorBoard(hide(Rig(sensing=QUIET), effect, parameters).sensing, 0, 0)
    board.read(np.zeros(at.SCALARS), 0)
    return tuple(board.read(s, 250)[1:5])


def test_encoders_read_what_their_errors_make_of_the_angle() -> None:
    per_motor, per_load = 2000 / (2.0 * math.pi), 10000 / (2.0 * math.pi)
    assert reading("encoder_offset", {"offset_rad": 0.1}, motor=1.0)[0] == round(1.1 * per_motor)
    assert reading("encoder_offset", {"load_offset_rad": -0.1}, load=1.0)[1] == round(
        0.9 * per_load
    )
    e = {"e_rad": 0.05, "phase_rad": 0.7}
    assert reading("encoder_eccentricity", e, motor=1.0)[0] == round(
        (1.0 + 0.05 * math.sin(1.7)) * per_motor
    )
    e = {"load_e_rad": 0.05, "load_phase_rad": 0.7}
    assert reading("encoder_eccentricity", e, load=1.0)[1] == round(
        (1.0 + 0.05 * math.sin(1.7)) * per_load
    )


def test_delayed_channels_still_read_the_first_sample() -> None:
    for name, channel, truth in (
        ("motor_encoder_delay_s", 0, "motor"),
        ("load_encoder_delay_s", 1, "load"),
        ("motor_torque_delay_s", 2, "current"),
        ("load_cell_delay_s", 3, "cell"),
    ):
        assert reading("time_delay", {name: CONTROL_PERIOD_S}, **{truth: 1.0})[channel] == 0
        assert reading("time_delay", {name: 0.0}, **{truth: 1.0})[channel] != 0


def test_load_cell_with_play_follows_where_the_play_is_used_up() -> None:
    board = SensorBoard(
        hide(Rig(sensing=QUIET), "load_cell_hysteresis", {"width_nm": 0.2}).sensing, 0, 0
    )
    s, seen = np.zeros(at.SCALARS), []
    for torque in (0.0, 1.0, 0.9, 0.7):
        s[at.CELL_TORQUE_MEAN] = torque
        seen.append(board.read(s, 0).load_cell_counts * 200e-6)
    assert seen == pytest.approx([0.0, 0.9, 0.9, 0.8], abs=1e-4)


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("presliding_compliance", {"slip_m": 5e-4}),
        ("frictional_lag", {"lag_s": 0.02}),
        ("cable_stiffening", {"gain": 0.6}),
        ("viscoelastic_cable", {"a": 0.5, "tau_s": 0.05}),
        ("conduit_compliance", {"stiffness_n_per_m": 1e4}),
        ("termination_backlash", {"play_rad": 0.02}),
        ("gravity_imbalance", {"amplitude_nm": 0.5, "phase_rad": 1.0}),
        ("pulley_eccentricity", {"load_e": 0.05, "load_phase_rad": 1.0}),
        ("tension_dependent_friction", {"p": 0.3}),
        ("dwell_strengthening", {"a": 1.0}),
    ],
)
def test_no_effect_makes_energy_in_a_rig_left_alone(
    effect: str, parameters: dict[str, float]
) -> None:
    free = Rig(load=Load(bearing_friction_nm=0.01), operator=Operator(motion="free"))
    plant = Plant(hide(free, effect, parameters))
    plant.scalars[at.LOAD_SPEED] = 6.0  # a knock on the handle
    plant.scalars[at.MOTOR_SPEED] = -40.0
    energy_j = [plant.stored_energy_j()]
    for _ in range(2000):
        plant.advance(0.0, False, 0.0, 0.0)
        energy_j.append(plant.stored_energy_j())
    # semi-implicit Euler conserves energy only on average, as in test_plant: 0.1 % of the knock
    knock_j = energy_j[0] - energy_j[-1]
    assert knock_j > 0.0
    assert np.max(np.array(energy_j[1:]) - np.minimum.accumulate(energy_j)[:-1]) < 1e-3 * knock_j


@pytest.mark.parametrize("effect", sorted(TABLE))
def test_effects_and_parameters_that_are_none_are_refused(effect: str) -> None:
    with pytest.raises(ValueError, match=r"found 'lustre'; accepted: "):
        hide(Rig(), effect, {"lustre": 1.0})


def test_an_effect_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match=r"effect: found 'rust'; accepted: viscous_friction"):
        hide(Rig(), "rust", {})
