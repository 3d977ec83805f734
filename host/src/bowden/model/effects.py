"""Named effects of a model file: which of them the offline model can compute, and how.

Imports nothing of ours but `transmission`; `description` asks it to apply a model file's `effects`
list to the numbers of the pair.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from bowden.model.errors import ModelError
from bowden.model.transmission import Transmission

CATALOGUE = (
    "viscous_friction",
    "stribeck_friction",
    "presliding_compliance",
    "frictional_lag",
    "direction_asymmetry",
    "tension_dependent_friction",
    "bearing_friction",
    "thermal_friction",
    "wear",
    "dwell_strengthening",
    "position_dependent_friction",
    "wrap_angle_change",
    "conduit_compliance",
    "cable_stiffening",
    "pretension_loss",
    "viscoelastic_cable",
    "termination_backlash",
    "pulley_eccentricity",
    "encoder_eccentricity",
    "encoder_offset",
    "load_cell_gain",
    "load_cell_offset",
    "load_cell_drift",
    "load_cell_hysteresis",
    "torque_constant_error",
    "motor_torque_offset",
    "cogging",
    "motor_inertia",
    "load_inertia",
    "gravity_imbalance",
    "time_delay",
    "amplifier_lag",
)


def _viscous(pair: Transmission, p: Mapping[str, float]) -> Transmission:
    law = replace(pair.friction, mu_v_s_per_m=pair.friction.mu_v_s_per_m + p["mu_v_s_per_m"])
    return replace(pair, friction=law)


def _stribeck(pair: Transmission, p: Mapping[str, float]) -> Transmission:
    law = replace(
        pair.friction,
        stribeck_gain=p["a"],
        stribeck_speed_m_per_s=p["v_s_m_per_s"],
    )
    return replace(pair, friction=law)


def _tension(pair: Transmission, p: Mapping[str, float]) -> Transmission:
    return replace(pair, friction=replace(pair.friction, tension_exponent=p["p"]))


def _asymmetry(pair: Transmission, p: Mapping[str, float]) -> Transmission:
    return replace(pair, friction=replace(pair.friction, direction_asymmetry=p["a"]))


def _wrap(pair: Transmission, p: Mapping[str, float]) -> Transmission:
    if pair.wrap_rad == 0:
        raise ModelError("extra_wrap_rad: found a straight path, accepted: one with a bend")
    factor = 1.0 + p["extra_wrap_rad"] / pair.wrap_rad
    return replace(pair, piece_curvature_per_m=pair.piece_curvature_per_m * factor)


def _conduit(pair: Transmission, p: Mapping[str, float]) -> Transmission:
    # A spring in series with the cable, spread along it: 1/EA' = 1/EA + 1/(K_conduit L).
    series = 1.0 / pair.axial_stiffness_n + 1.0 / (p["stiffness_n_per_m"] * pair.length_m)
    return replace(pair, axial_stiffness_n=1.0 / series)


APPLIED: dict[
    str, tuple[tuple[str, ...], Callable[[Transmission, Mapping[str, float]], Transmission]]
] = {
    "viscous_friction": (("mu_v_s_per_m",), _viscous),
    "stribeck_friction": (("a", "v_s_m_per_s"), _stribeck),
    "tension_dependent_friction": (("p",), _tension),
    "direction_asymmetry": (("a",), _asymmetry),
    "wrap_angle_change": (("extra_wrap_rad",), _wrap),
    "conduit_compliance": (("stiffness_n_per_m",), _conduit),
}
"""Effects that the pair's equations know: the parameters each needs, and what it does with them."""
