"""Rigs drawn at random from a seed, and what the drive assumes of them, which is wrong.

Output: `RenderRig`, for `trial`. Every number of the drive's model (friction, pretension,
stiffness, motor inertia) is wrong by up to 15 % each, independently; the wrap angle is in the
friction's error, because only their product counts. Two effects of moderate strength are hidden.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from bowden_rig.rig.constants import least_substeps
from bowden_rig.rig.hidden import hide
from bowden_rig.rig.parameters import Cable, Load, Motor, Operator, Rig, Sensing

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
    """What the lab has told the drive of its cables and motor; SI units.

    `friction_deviation` is how well it knows friction times pretension: relative, one sigma.
    """

    friction: float
    pretension_n: float
    axial_stiffness_n: float
    motor_inertia_kg_m2: float
    friction_deviation: float = MODEL_ERROR * math.sqrt(2.0 / 3.0)  # two even factors


@dataclass(frozen=True)
class Tunnel:
    """Eq. (7), at the motor: times the transmission ratio it is what is wanted at the load."""

    half_width_rad: float
    stiffness_nm_per_rad: float
    limit_nm: float


@dataclass(frozen=True)
class RenderRig:
    """A rig, the drive's assumption, and what is to be rendered.

    Parameters
    ----------
    friction_nm : float
        2 r_in T0 m: torque at the motor that the friction of the moving pair takes.
    motor_limit_nm : float
    hidden : mapping of str to mapping of str to float
        Effects of the catalogue that the drive has no model of, and their parameters.
    """

    seed: int
    rig: Rig
    belief: Belief
    tunnel: Tunnel
    friction_nm: float
    motor_limit_nm: float
    hidden: Mapping[str, Mapping[str, float]]

    @property
    def apart(self) -> bool:
        """Friction alone takes most of the motor's torque: counted apart."""
        return self.friction_nm > APART_ABOVE * self.motor_limit_nm

    @property
    def ratio(self) -> float:
        """Transmission ratio rho."""
        return self.rig.load.pulley_radius_m / self.rig.motor.pulley_radius_m


def draw(seed: int, without: Collection[str] = ()) -> RenderRig:
    """Draw a rig; the same seed gives the same.

    Parameters
    ----------
    seed : int
    without : collection of str
        Hidden effects that are left out; all else stays as drawn.
    """
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
    operator = Operator(
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
        conduit_temperature_c=random.uniform(15.0, 40.0),
    )
    rig = Rig(cable, motor, load, operator, sensing)
    rig = replace(rig, substeps=max(rig.substeps, least_substeps(rig.cable, rig.elements)))
    chosen = sorted(random.choice(sorted(MODERATE), size=HIDDEN_EFFECTS, replace=False).tolist())
    hidden = {name: MODERATE[name](random, rig) for name in chosen}
    hidden = {name: given for name, given in hidden.items() if name not in without}
    for name, parameters in hidden.items():
        rig = hide(rig, name, parameters)
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


def told_truth(rig: RenderRig) -> Belief:
    """Return what a lab that knew its rig would tell the drive, without the hidden effects."""
    cable, motor = rig.rig.cable, rig.rig.motor
    return Belief(
        friction=cable.friction,
        pretension_n=cable.pretension_n,
        axial_stiffness_n=cable.axial_stiffness_n,
        motor_inertia_kg_m2=motor.inertia_kg_m2,
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


Draw = Callable[[Random, Rig], dict[str, float]]

# Middles of the ranges of effects on such rigs: 0.1 to 0.3 of friction, 1 to 2 % of a radius ...
MODERATE: Final[dict[str, Draw]] = {
    "viscous_friction": lambda r, _: {"mu_v_s_per_m": r.uniform(0.05, 0.3)},
    "stribeck_friction": lambda r, _: {
        "a": r.uniform(0.1, 0.5),
        "v_s_m_per_s": r.uniform(0.002, 0.02),
    },
    "presliding_compliance": lambda r, _: {"slip_m": r.uniform(5e-5, 3e-4)},
    "frictional_lag": lambda r, _: {"lag_s": r.uniform(2e-3, 2e-2)},
    "direction_asymmetry": lambda r, _: {"a": _signed(r, 0.05, 0.2)},
    "tension_dependent_friction": lambda r, _: {"p": r.uniform(0.05, 0.2)},
    "bearing_friction": lambda r, _: {"torque_nm": r.uniform(2e-3, 1e-2)},
    "thermal_friction": lambda r, _: {"alpha_per_k": _signed(r, 2e-3, 8e-3)},
    "wear": lambda r, _: {"a": _signed(r, 0.05, 0.2), "travel_m": 0.5},
    "dwell_strengthening": lambda r, _: {"a": r.uniform(0.1, 0.4)},
    "position_dependent_friction": lambda r, _: {
        "a": r.uniform(0.05, 0.2),
        "waves_per_turn": r.uniform(1.0, 6.0),
        "phase_rad": _phase(r),
    },
    "wrap_angle_change": lambda r, rig: {
        "extra_wrap_rad": _signed(r, 0.05, 0.15) * LENGTH_M / rig.cable.path[0][1]
    },
    "conduit_compliance": lambda r, _: {"stiffness_n_per_m": _log(r, 1e4, 1e5)},
    "cable_stiffening": lambda r, _: {"gain": r.uniform(0.2, 0.6)},
    "pretension_loss": lambda r, _: {"a": r.uniform(0.03, 0.1), "tau_s": 1.0},
    "viscoelastic_cable": lambda r, _: {"a": r.uniform(0.05, 0.3), "tau_s": _log(r, 0.03, 0.5)},
    "termination_backlash": lambda r, _: {"play_rad": r.uniform(1e-3, 1e-2)},
    "pulley_eccentricity": lambda r, _: {"e": r.uniform(2e-3, 2e-2), "phase_rad": _phase(r)},
    "encoder_eccentricity": lambda r, _: {"e_rad": r.uniform(2e-3, 1e-2), "phase_rad": _phase(r)},
    "encoder_offset": lambda r, _: {"load_offset_rad": _signed(r, 2e-3, 1e-2)},
    "load_cell_gain": lambda r, _: {"g": _signed(r, 0.01, 0.04)},
    "load_cell_offset": lambda r, _: {"offset_nm": _signed(r, 2e-3, 2e-2)},
    "load_cell_drift": lambda r, _: {"drift_nm_per_s": _signed(r, 1e-3, 5e-3)},
    "load_cell_hysteresis": lambda r, _: {"width_nm": _log(r, 5e-3, 2e-2)},
    "torque_constant_error": lambda r, _: {"g": _signed(r, 0.03, 0.08)},
    "motor_torque_offset": lambda r, _: {"offset_nm": _signed(r, 1e-3, 6e-3)},
    "cogging": lambda r, _: {
        "amplitude_nm": r.uniform(1e-3, 6e-3),
        "harmonic": float(r.integers(4, 25)),
        "phase_rad": _phase(r),
    },
    "motor_inertia": lambda r, rig: {
        "inertia_kg_m2": rig.motor.inertia_kg_m2 * r.uniform(1.3, 2.0)
    },
    "load_inertia": lambda r, _: {"inertia_kg_m2": _log(r, 1e-4, 1e-3)},
    "gravity_imbalance": lambda r, _: {
        "amplitude_nm": r.uniform(0.02, 0.1),
        "phase_rad": _phase(r),
    },
    "time_delay": lambda r, _: {"motor_torque_delay_s": r.uniform(2.5e-4, 1e-3)},
    "amplifier_lag": lambda r, _: {"lag_s": _log(r, 3e-4, 1.5e-3)},
}
