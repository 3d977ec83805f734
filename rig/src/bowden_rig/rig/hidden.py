"""The effects of the diagnosis' catalogue as hidden truths of the rig.

Input: the name of an effect and its parameters, as the catalogue and model files name them. Output:
the rig with it, while drive and model have no such effect. `hil_tests.render` and the benchmark of
the diagnosis (`hil_tests.hidden_effects`) draw from here; the definitions are CONTRACTS.md's, and
the laws are this package's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from bowden_rig.rig.constants import CONTROL_PERIOD_S, least_substeps
from bowden_rig.rig.parameters import Rig, changed

Reduce = Callable[[float, Rig], float]


def _as_it_is(value: float, _rig: Rig) -> float:
    return value


def _ticks(delay_s: float, _rig: Rig) -> float:
    return round(delay_s / CONTROL_PERIOD_S)


def _shear(slip_m: float, rig: Rig) -> float:
    """Shear stiffness with which friction at pretension builds up over a slip of 5 um or more."""
    cable = rig.cable
    per_length = cable.friction * cable.pretension_n * cable.wrap_angle_rad(0.0, cable.length_m)
    return per_length / cable.length_m / max(slip_m, 5e-6)


#: Effect, then each of its parameters: the rig's number and how it follows from the parameter.
TABLE: Final[dict[str, dict[str, tuple[str, Reduce]]]] = {
    "viscous_friction": {"mu_v_s_per_m": ("cable.viscous_s_per_m", _as_it_is)},
    "stribeck_friction": {
        "a": ("cable.static_ratio", lambda a, _: 1.0 + a),
        "v_s_m_per_s": ("cable.stribeck_speed_m_per_s", _as_it_is),
    },
    "presliding_compliance": {"slip_m": ("cable.contact_stiffness_n_per_m2", _shear)},
    "frictional_lag": {"lag_s": ("cable.friction_lag_s", _as_it_is)},
    "direction_asymmetry": {"a": ("cable.direction_asymmetry", _as_it_is)},
    "tension_dependent_friction": {"p": ("cable.tension_exponent", _as_it_is)},
    "bearing_friction": {
        "torque_nm": ("motor.bearing_friction_nm", _as_it_is),
        "load_torque_nm": ("load.bearing_friction_nm", _as_it_is),
    },
    "thermal_friction": {"alpha_per_k": ("cable.friction_change_per_k", _as_it_is)},
    "wear": {
        "a": ("cable.wear_change", _as_it_is),
        "travel_m": ("cable.wear_travel_m", _as_it_is),
    },
    "dwell_strengthening": {
        "a": ("cable.dwell_gain", _as_it_is),
        "dwell_s": ("cable.dwell_time_s", _as_it_is),
        "distance_m": ("cable.dwell_slip_m", _as_it_is),
    },
    "position_dependent_friction": {
        "a": ("cable.place_gain", _as_it_is),
        "waves_per_turn": ("cable.place_per_turn", _as_it_is),
        "phase_rad": ("cable.place_phase_rad", _as_it_is),
        "bump_a": ("cable.bump_gain_change", _as_it_is),
        "centre_rad": ("cable.bump_centre_offset_rad", _as_it_is),
        "width_rad": ("cable.bump_width_rad", _as_it_is),
    },
    "wrap_angle_change": {"extra_wrap_rad": ("cable.extra_wrap_rad", _as_it_is)},
    "conduit_compliance": {"stiffness_n_per_m": ("cable.conduit_stiffness_n_per_m", _as_it_is)},
    "cable_stiffening": {
        # as the catalogue's law near pretension: d ln EA / dT = g / (2 T0) there
        "gain": ("cable.stiffening_per_n", lambda g, rig: g / (2.0 - g) / rig.cable.pretension_n),
    },
    "pretension_loss": {
        "a": ("cable.pretension_loss", _as_it_is),
        "tau_s": ("cable.pretension_loss_time_s", _as_it_is),
    },
    "viscoelastic_cable": {
        "a": ("cable.creep", _as_it_is),
        "tau_s": ("cable.creep_time_s", _as_it_is),
    },
    "termination_backlash": {"play_rad": ("load.play_rad", _as_it_is)},
    "pulley_eccentricity": {
        "e": ("motor.eccentricity", _as_it_is),
        "phase_rad": ("motor.eccentricity_phase_rad", _as_it_is),
        "load_e": ("load.eccentricity", _as_it_is),
        "load_phase_rad": ("load.eccentricity_phase_rad", _as_it_is),
    },
    "encoder_eccentricity": {
        "e_rad": ("sensing.encoder_eccentricity_rad", _as_it_is),
        "phase_rad": ("sensing.encoder_eccentricity_phase_rad", _as_it_is),
        "load_e_rad": ("sensing.load_encoder_eccentricity_rad", _as_it_is),
        "load_phase_rad": ("sensing.load_encoder_eccentricity_phase_rad", _as_it_is),
    },
    "encoder_offset": {
        "offset_rad": ("sensing.motor_encoder_offset_rad", _as_it_is),
        "load_offset_rad": ("sensing.load_encoder_offset_rad", _as_it_is),
    },
    "load_cell_gain": {"g": ("sensing.load_cell_gain_error", _as_it_is)},
    "load_cell_offset": {"offset_nm": ("sensing.load_cell_offset_nm", _as_it_is)},
    "load_cell_drift": {"drift_nm_per_s": ("sensing.load_cell_drift_nm_per_s", _as_it_is)},
    "load_cell_hysteresis": {"width_nm": ("sensing.load_cell_hysteresis_nm", _as_it_is)},
    "torque_constant_error": {"g": ("motor.torque_constant_error", _as_it_is)},
    "motor_torque_offset": {"offset_nm": ("motor.torque_offset_nm", _as_it_is)},
    "cogging": {
        "amplitude_nm": ("motor.cogging_nm", _as_it_is),
        "harmonic": ("motor.cogging_per_turn", lambda n, _: round(n)),
        "phase_rad": ("motor.cogging_phase_rad", _as_it_is),
    },
    # the rig's motor has inertia anyway: a model that states none misses all of it
    "motor_inertia": {"inertia_kg_m2": ("motor.inertia_kg_m2", _as_it_is)},
    "load_inertia": {"inertia_kg_m2": ("load.cell_side_inertia_kg_m2", _as_it_is)},
    "gravity_imbalance": {
        "amplitude_nm": ("load.gravity_nm", _as_it_is),
        "phase_rad": ("load.gravity_phase_rad", _as_it_is),
    },
    "time_delay": {
        "motor_encoder_delay_s": ("sensing.motor_encoder_delay_ticks", _ticks),
        "load_encoder_delay_s": ("sensing.load_encoder_delay_ticks", _ticks),
        "load_cell_delay_s": ("sensing.load_cell_delay_ticks", _ticks),
        "motor_torque_delay_s": ("sensing.motor_current_delay_ticks", _ticks),
    },
    "amplifier_lag": {
        "lag_s": ("motor.amplifier_bandwidth_hz", lambda lag, _: 1.0 / (2.0 * math.pi * lag)),
    },
}


def hide(rig: Rig, effect: str, parameters: Mapping[str, float]) -> Rig:
    """Return the rig with an effect, and steps as fine as it then needs.

    Parameters
    ----------
    rig : Rig
    effect : str
        A name of the catalogue.
    parameters : mapping of str to float
        Some or all of the effect's; the rest stay as the rig has them.

    Raises
    ------
    ValueError
        No such effect, no such parameter, or a value that no rig has.
    """
    if effect not in TABLE:
        raise ValueError(f"effect: found {effect!r}; accepted: {', '.join(TABLE)}")
    numbers = TABLE[effect]
    for name, value in parameters.items():
        if name not in numbers:
            raise ValueError(f"{effect}: found {name!r}; accepted: {', '.join(numbers)}")
        place, reduce = numbers[name]
        rig = changed(rig, f"{place}={reduce(value, rig)!r}")
    return replace(rig, substeps=max(rig.substeps, least_substeps(rig.cable, rig.elements)))
