"""Random numbers for each effect of the catalogue: which variant, which shape, how strong at most.

The magnitude is set later, in units of the noise floor (`recordings`), within the limits
given here; effects that a calibration within the tolerances would swallow when small are
drawn large at once (`fixed`). Ranges: what the literature has for rigs like this, a little widened.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hil_tests.hidden_effects.continuum import Pair
from hil_tests.hidden_effects.hidden import Draw

Rng = np.random.Generator


def _phase(rng: Rng) -> float:
    return float(rng.uniform(0.0, 2.0 * np.pi))


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _sign(rng: Rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _simple(
    name: str, low: float, high: float, *, signed: bool = False, fixed: bool = False
) -> Callable[[Rng, Pair], Draw]:
    def draw(rng: Rng, pair: Pair) -> Draw:
        del pair
        value = _log(rng, low, high) * (_sign(rng) if signed else 1.0)
        return Draw({name: value}, name, low, high, fixed)

    return draw


def _stribeck(rng: Rng, pair: Pair) -> Draw:
    del pair
    return Draw({"a": 0.3, "v_s_m_per_s": _log(rng, 8e-3, 0.03)}, "a", 0.03, 0.5)


def _bearing(rng: Rng, pair: Pair) -> Draw:
    del pair
    if rng.random() < 0.6:
        return Draw({"torque_nm": 0.01}, "torque_nm", 1e-3, 0.06)
    return Draw({"load_torque_nm": 0.05}, "load_torque_nm", 2e-3, 0.3)


def _wear(rng: Rng, pair: Pair) -> Draw:
    del pair
    return Draw({"a": 0.2 * _sign(rng), "travel_m": _log(rng, 0.6, 4.0)}, "a", 0.02, 0.5)


def _dwell(rng: Rng, pair: Pair) -> Draw:
    del pair
    shape = {"a": 0.3, "dwell_s": _log(rng, 0.3, 2.0), "distance_m": _log(rng, 2e-3, 0.02)}
    return Draw(shape, "a", 0.03, 1.5)


def _position(rng: Rng, pair: Pair) -> Draw:
    del pair
    if rng.random() < 0.5:
        shape = {"a": 0.2, "waves_per_turn": _log(rng, 1.5, 12.0), "phase_rad": _phase(rng)}
        return Draw(shape, "a", 0.02, 0.6)
    shape = {
        "bump_a": 0.3,
        "centre_rad": float(rng.uniform(-0.2, 0.2)),
        "width_rad": _log(rng, 0.06, 0.25),
    }
    return Draw(shape, "bump_a", 0.03, 1.5)


def _wrap(rng: Rng, pair: Pair) -> Draw:
    share = float(rng.uniform(0.5, 0.8)) * (1.0 if rng.random() < 0.7 else -0.8)
    value = share * pair.wrap_rad
    return Draw({"extra_wrap_rad": value}, "extra_wrap_rad", 0.0, np.inf, fixed=True)


def _conduit(rng: Rng, pair: Pair) -> Draw:
    share = float(rng.uniform(0.6, 2.0))  # compliance of the conduit by that of the cable
    value = pair.law.axial_stiffness_n / (pair.length_m * share)
    return Draw({"stiffness_n_per_m": value}, "stiffness_n_per_m", 0.0, np.inf, fixed=True)


def _loss(rng: Rng, pair: Pair) -> Draw:
    del pair
    return Draw({"a": 0.05, "tau_s": _log(rng, 0.5, 6.0)}, "a", 4e-3, 0.15)


def _creep(rng: Rng, pair: Pair) -> Draw:
    del pair
    return Draw({"a": 0.2, "tau_s": _log(rng, 0.1, 3.0)}, "a", 0.02, 1.5)


def _pulley(rng: Rng, pair: Pair) -> Draw:
    del pair
    if rng.random() < 0.7:
        return Draw({"e": 0.01, "phase_rad": _phase(rng)}, "e", 1e-3, 0.03)
    return Draw({"load_e": 0.01, "load_phase_rad": _phase(rng)}, "load_e", 1e-3, 0.04)


def _encoder(rng: Rng, pair: Pair) -> Draw:
    del pair
    if rng.random() < 0.7:
        return Draw({"e_rad": 0.01, "phase_rad": _phase(rng)}, "e_rad", 1.5e-3, 0.04)
    return Draw({"load_e_rad": 0.01, "load_phase_rad": _phase(rng)}, "load_e_rad", 1e-3, 0.03)


def _cogging(rng: Rng, pair: Pair) -> Draw:
    del pair
    shape = {
        "amplitude_nm": 5e-3,
        "harmonic": float(rng.integers(4, 25)),
        "phase_rad": _phase(rng),
    }
    return Draw(shape, "amplitude_nm", 5e-4, 0.02)


def _gravity(rng: Rng, pair: Pair) -> Draw:
    del pair
    return Draw({"amplitude_nm": 0.1, "phase_rad": _phase(rng)}, "amplitude_nm", 3e-3, 0.8)


def _delay(rng: Rng, pair: Pair) -> Draw:
    del pair
    name = str(rng.choice(["motor_encoder_delay_s", "load_encoder_delay_s", "load_cell_delay_s"]))
    return Draw({name: 5e-3}, name, 1e-3, 0.03)


DRAWS: dict[str, Callable[[Rng, Pair], Draw]] = {
    "viscous_friction": _simple("mu_v_s_per_m", 0.02, 1.0),
    "stribeck_friction": _stribeck,
    "presliding_compliance": _simple("slip_m", 1e-4, 1e-3),
    "frictional_lag": _simple("lag_s", 8e-3, 0.06),
    "direction_asymmetry": _simple("a", 5e-3, 0.3, signed=True),
    "tension_dependent_friction": _simple("p", 0.01, 0.3),
    "bearing_friction": _bearing,
    "thermal_friction": _simple("alpha_per_k", 1e-3, 0.015, signed=True),
    "wear": _wear,
    "dwell_strengthening": _dwell,
    "position_dependent_friction": _position,
    "wrap_angle_change": _wrap,
    "conduit_compliance": _conduit,
    "cable_stiffening": _simple("gain", 0.03, 0.9),
    "pretension_loss": _loss,
    "viscoelastic_cable": _creep,
    "termination_backlash": _simple("play_rad", 5e-4, 0.03),
    "pulley_eccentricity": _pulley,
    "encoder_eccentricity": _encoder,
    "encoder_offset": _simple("offset_rad", 0.02, 0.1, signed=True),
    "load_cell_gain": _simple("g", 0.01, 0.08, signed=True),
    "load_cell_offset": _simple("offset_nm", 2e-3, 0.3, signed=True),
    "load_cell_drift": _simple("drift_nm_per_s", 2e-4, 0.02, signed=True),
    "load_cell_hysteresis": _simple("width_nm", 5e-3, 0.2),
    "torque_constant_error": _simple("g", 0.02, 0.2, signed=True),
    "motor_torque_offset": _simple("offset_nm", 1e-3, 0.05, signed=True),
    "cogging": _cogging,
    "motor_inertia": _simple("inertia_kg_m2", 3e-6, 6e-5),
    "load_inertia": _simple("inertia_kg_m2", 3e-4, 0.05),
    "gravity_imbalance": _gravity,
    "time_delay": _delay,
    "amplifier_lag": _simple("lag_s", 1e-3, 0.05),
}
