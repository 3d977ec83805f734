"""Rigs drawn at random from a seed, and what the drive believes of them, which is wrong.

Output: `RenderRig`, for `trial`. Every number of the drive's model (friction, pretension,
stiffness, motor inertia) is wrong by up to 15 % each, independently; the wrap angle is in the
friction's error, because only their product counts. Two effects of moderate strength are hidden.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from hil_tests.rig.constants import least_substeps
from hil_tests.rig.parameters import Cable, Hand, Load, Motor, Rig, Sensing, changed

MODEL_ERROR: Final = 0.15
LENGTH_M: Final = 2.0
MOST_DELAY_TICKS: Final = 8  # 2 ms
HIDDEN_EFFECTS: Final = 2
PAPER_TUNNEL_NM: Final = 0.2  # of eq. (7), at the motor
SPARE: Final = 0.9  # of the motor's torque beyond friction that a lab plans with
APART_ABOVE: Final = 0.8  # of the motor's limit that friction alone takes

Random = np.random.Generator


@dataclass(frozen=True)
class Belief:
    """What the lab has told the drive of its cables and motor; SI units."""

    friction: float
    pretension_n: float
    axial_stiffness_n: float
    motor_inertia_kg_m2: float


@dataclass(frozen=True)
class Tunnel:
    """Eq. (7), at the motor: times the transmission ratio it is what is wanted at the load."""

    half_width_rad: float
    stiffness_nm_per_rad: float
    limit_nm: float


@dataclass(frozen=True)
class RenderRig:
    """A rig, the drive's belief, and what is to be rendered.

    Parameters
    ----------
    friction_nm : float
        2 r_in T0 m: torque at the motor that the friction of the moving pair takes.
    motor_limit_nm : float
    hidden : tuple of str
        Assignments that `parameters.changed` took: the effects that the drive knows nothing of.
    """

    seed: int
    rig: Rig
    belief: Belief
    tunnel: Tunnel
    friction_nm: float
    motor_limit_nm: float
    hidden: tuple[str, ...]

    @property
    def apart(self) -> bool:
        """Friction alone takes most of the motor's torque: counted apart."""
        return self.friction_nm > APART_ABOVE * self.motor_limit_nm

    @property
    def ratio(self) -> float:
        """Transmission ratio rho."""
        return self.rig.load.pulley_radius_m / self.rig.motor.pulley_radius_m


def draw(seed: int) -> RenderRig:
    """Draw a rig; the same seed gives the same."""
    random = np.random.default_rng([20240, seed])
    wrap_rad = random.uniform(1.0, 8.0)
    cable = Cable(
        path=((LENGTH_M, LENGTH_M / wrap_rad),),
        pretension_n=random.uniform(1.0, 20.0),
        friction=random.uniform(0.05, 0.25),
        axial_stiffness_n=_log(random, 2000.0, 8000.0),
        stiffest_n=300.0,
    )
    limit_nm = _log(random, 0.3, 3.0)
    motor = Motor(inertia_kg_m2=_log(random, 1e-5, 5e-5))
    motor = replace(motor, current_limit_a=2.0 * limit_nm / motor.torque_constant_nm_per_a)
    load = Load(inertia_kg_m2=_log(random, 1e-3, 1e-2))
    stiffness = _log(random, 5.0, 200.0)
    hand = Hand(
        motion="still",
        stiffness_nm_per_rad=stiffness,
        # between 0.2 and 1 of critical with the handle alone, as for a relaxed to a tense arm
        damping_nm_s_per_rad=2.0
        * random.uniform(0.2, 1.0)
        * math.sqrt(stiffness * load.inertia_kg_m2),
    )
    delay = int(random.integers(0, MOST_DELAY_TICKS + 1))
    sensing = Sensing(
        load_cell_noise_nm=_log(random, 0.2e-3, 2e-3),
        current_noise_a=_log(random, 0.5e-3, 5e-3),
        load_encoder_delay_ticks=delay,
        load_cell_delay_ticks=delay,
    )
    rig = Rig(cable, motor, load, hand, sensing)
    names = sorted(HIDDEN)
    chosen = random.choice(len(names), size=HIDDEN_EFFECTS, replace=False)
    hidden = tuple(a for i in sorted(chosen) for a in HIDDEN[names[i]](random, rig))
    for assignment in hidden:
        rig = changed(rig, assignment)
    rig = replace(rig, substeps=max(12, least_substeps(rig.cable, rig.elements)))
    belief = Belief(
        friction=cable.friction * _wrong(random),
        pretension_n=cable.pretension_n * _wrong(random),
        axial_stiffness_n=cable.axial_stiffness_n * _wrong(random),
        motor_inertia_kg_m2=motor.inertia_kg_m2 * _wrong(random),
    )
    m = cable.friction * wrap_rad
    friction_nm = 2.0 * motor.pulley_radius_m * cable.pretension_n * m
    return RenderRig(
        seed,
        rig,
        belief,
        Tunnel(0.05, 0.5, _tunnel_nm(limit_nm, friction_nm, m)),
        friction_nm,
        limit_nm,
        hidden,
    )


def _tunnel_nm(limit_nm: float, friction_nm: float, m: float) -> float:
    """Torque limit of the tunnel at the motor, as a lab sets it: what its motor can render.

    Driving the load the pair passes on tau - 2 r T0 m, and tau e^-m with one cable slack. Where
    friction leaves next to nothing a lab would still ask for a fifth of the motor's torque.
    """
    passed_on = SPARE * min(limit_nm - friction_nm, limit_nm * math.exp(-m))
    return min(PAPER_TUNNEL_NM, max(passed_on, 0.2 * limit_nm * math.exp(-m)))


def _log(random: Random, low: float, high: float) -> float:
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _wrong(random: Random) -> float:
    return float(1.0 + random.uniform(-MODEL_ERROR, MODEL_ERROR))


def _signed(random: Random, low: float, high: float) -> float:
    return float(random.choice((-1.0, 1.0)) * random.uniform(low, high))


def _phase(random: Random) -> float:
    return float(random.uniform(0.0, 2.0 * math.pi))


def _slip(random: Random, rig: Rig) -> tuple[str, ...]:
    """Presliding over 0.05 to 0.3 mm at pretension."""
    radius_m = rig.cable.path[0][1]
    shear = rig.cable.friction * rig.cable.pretension_n / radius_m / random.uniform(5e-5, 3e-4)
    return (f"cable.contact_stiffness_n_per_m2={min(shear, 1.5e6)}",)


Effect = Callable[[Random, Rig], tuple[str, ...]]

# Middles of the ranges in the effect library (science.md, section 2).
HIDDEN: Final[dict[str, Effect]] = {
    "viscous_friction": lambda r, _: (f"cable.viscous_s_per_m={r.uniform(0.05, 0.3)}",),
    "stribeck_friction": lambda r, _: (
        f"cable.static_ratio={r.uniform(1.1, 1.5)}",
        f"cable.stribeck_speed_m_per_s={r.uniform(0.002, 0.02)}",
    ),
    "presliding_compliance": _slip,
    "frictional_lag": lambda r, _: (f"cable.friction_lag_s={r.uniform(2e-3, 2e-2)}",),
    "direction_asymmetry": lambda r, _: (f"cable.direction_asymmetry={_signed(r, 0.05, 0.2)}",),
    "tension_dependent_friction": lambda r, _: (f"cable.tension_exponent={r.uniform(0.05, 0.2)}",),
    "bearing_friction": lambda r, _: (f"motor.bearing_friction_nm={r.uniform(2e-3, 1e-2)}",),
    "thermal_friction": lambda r, _: (
        f"cable.friction_change_per_k={-r.uniform(2e-3, 8e-3)}",
        f"cable.warming_change_k={r.uniform(5.0, 15.0)}",
        "cable.warming_time_s=3.0",
    ),
    "wear": lambda r, _: (
        f"cable.wear_change={_signed(r, 0.05, 0.2)}",
        "cable.wear_travel_m=0.5",
    ),
    "dwell_strengthening": lambda r, _: (f"cable.dwell_gain={r.uniform(0.1, 0.4)}",),
    "position_dependent_friction": lambda r, _: (
        f"cable.place_gain={r.uniform(0.05, 0.2)}",
        f"cable.place_per_turn={r.uniform(1.0, 6.0)}",
        f"cable.place_phase_rad={_phase(r)}",
    ),
    "wrap_angle_change": lambda r, rig: (
        f"cable.extra_wrap_rad={_signed(r, 0.05, 0.15) * LENGTH_M / rig.cable.path[0][1]}",
    ),
    "conduit_compliance": lambda r, _: (f"cable.conduit_stiffness_n_per_m={_log(r, 1e4, 1e5)}",),
    "cable_stiffening": lambda r, _: (f"cable.stiffening_per_n={r.uniform(0.01, 0.05)}",),
    "pretension_loss": lambda r, _: (
        f"cable.pretension_loss={r.uniform(0.03, 0.1)}",
        "cable.pretension_loss_time_s=1.0",
    ),
    "viscoelastic_cable": lambda r, _: (
        f"cable.creep={r.uniform(0.05, 0.3)}",
        f"cable.creep_time_s={_log(r, 0.03, 0.5)}",
    ),
    "termination_backlash": lambda r, _: (f"load.play_rad={r.uniform(1e-3, 1e-2)}",),
    "pulley_eccentricity": lambda r, _: (
        f"motor.eccentricity={r.uniform(2e-3, 2e-2)}",
        f"motor.eccentricity_phase_rad={_phase(r)}",
    ),
    "encoder_eccentricity": lambda r, _: (
        f"sensing.encoder_eccentricity_rad={r.uniform(2e-3, 1e-2)}",
        f"sensing.encoder_eccentricity_phase_rad={_phase(r)}",
    ),
    "encoder_offset": lambda r, _: (f"sensing.load_encoder_offset_rad={_signed(r, 2e-3, 1e-2)}",),
    "load_cell_gain": lambda r, _: (f"sensing.load_cell_gain_error={_signed(r, 0.01, 0.04)}",),
    "load_cell_offset": lambda r, _: (f"sensing.load_cell_offset_nm={_signed(r, 2e-3, 2e-2)}",),
    "load_cell_drift": lambda r, _: (f"sensing.load_cell_drift_nm_per_s={_signed(r, 1e-3, 5e-3)}",),
    "load_cell_hysteresis": lambda r, _: (
        f"sensing.load_cell_hysteresis_nm={_log(r, 5e-3, 2e-2)}",
    ),
    "torque_constant_error": lambda r, _: (
        f"motor.torque_constant_error={_signed(r, 0.03, 0.08)}",
    ),
    "motor_torque_offset": lambda r, _: (f"motor.torque_offset_nm={_signed(r, 1e-3, 6e-3)}",),
    "cogging": lambda r, _: (
        f"motor.cogging_nm={r.uniform(1e-3, 6e-3)}",
        f"motor.cogging_phase_rad={_phase(r)}",
    ),
    "motor_inertia": lambda r, rig: (
        f"motor.inertia_kg_m2={rig.motor.inertia_kg_m2 * r.uniform(1.3, 2.0)}",
    ),
    "load_inertia": lambda r, _: (f"load.cell_side_inertia_kg_m2={_log(r, 1e-4, 1e-3)}",),
    "gravity_imbalance": lambda r, _: (
        f"load.gravity_nm={r.uniform(0.02, 0.1)}",
        f"load.gravity_phase_rad={_phase(r)}",
    ),
    "time_delay": lambda r, _: (f"sensing.motor_current_delay_ticks={r.integers(1, 5)}",),
    "amplifier_lag": lambda r, _: (f"motor.amplifier_bandwidth_hz={_log(r, 100.0, 500.0)}",),
}
