"""Every effect of the catalogue, hidden in the continuum: its law and how its numbers are drawn.

Written from the definitions in the contracts and from the physics, not from `bowden.model`.
Parameters are called and signed as in model files, so that a diagnosis can be held against them.
`hide(name, values)` makes the `Hidden`; `DRAWS[name](rng, pair)` draws the numbers.
"""

# ruff: noqa: ARG005  (a change of a channel gets the signals, whether it looks at them or not)

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil_tests.hidden_effects.continuum import Histories, Pair
from hil_tests.hidden_effects.hidden import Change, Hidden, Signals, Values, Vector

REFERENCE_C = 20.0


def late(delay_s: float) -> Change:
    """Return the change that a delay makes: what was `delay_s` ago."""

    def change(values: Vector, signals: Signals) -> Vector:
        return np.interp(signals.time_s - delay_s, signals.time_s, values)

    return change


def lagged(values: Vector, time_s: Vector, lag_s: float) -> Vector:
    """First-order lag, exact for a signal that is straight between samples."""
    found = np.empty_like(values)
    found[0] = values[0]
    for i in range(1, values.size):
        dt = time_s[i] - time_s[i - 1]
        slope = (values[i] - values[i - 1]) / dt
        fade = np.exp(-dt / lag_s)
        found[i] = values[i] - slope * lag_s + (found[i - 1] - values[i - 1] + slope * lag_s) * fade
    return found


def played(values: Vector, width: float) -> Vector:
    """Play (backlash) operator of a total width, starting in its middle."""
    found, at = np.empty_like(values), values[0]
    for i, value in enumerate(values):
        at = min(max(at, value - 0.5 * width), value + 0.5 * width)
        found[i] = at
    return found


def both(factor: Vector) -> Histories:
    """Return histories with one friction factor for both directions."""
    factor = np.maximum(factor, 0.02)
    return Histories(friction_plus=factor, friction_minus=factor)


def travel_m(signals: Signals, pair: Pair) -> Vector:
    """Way of the cables at the load since the start."""
    steps = np.abs(np.diff(signals.load_angle_rad, prepend=signals.load_angle_rad[0]))
    return np.asarray(np.cumsum(steps) * pair.ends.load_radius_m)


def _law(name: str, values: Values, **changes: float) -> Hidden:
    return Hidden(
        name, dict(values), pair=lambda pair: replace(pair, law=pair.law._replace(**changes))
    )


def _ends(name: str, values: Values, oversample: int = 1, **changes: float) -> Hidden:
    return Hidden(
        name,
        dict(values),
        pair=lambda pair: replace(pair, ends=pair.ends._replace(**changes)),
        oversample=oversample,
    )


def _viscous(p: Values) -> Hidden:
    gain = p["mu_v_s_per_m"]
    return Hidden(
        "viscous_friction",
        dict(p),
        pair=lambda pair: replace(pair, law=pair.law._replace(rate_gain=gain / pair.mu)),
    )


def _asymmetry(p: Values) -> Hidden:
    def histories(signals: Signals, pair: Pair) -> Histories:
        del pair
        one = np.ones(signals.time_s.size)
        return Histories(friction_plus=(1.0 + p["a"]) * one, friction_minus=(1.0 - p["a"]) * one)

    return Hidden("direction_asymmetry", dict(p), histories=histories)


def _bearing(p: Values) -> Hidden:
    if "torque_nm" in p:
        return _ends("bearing_friction", p, bearing_nm=p["torque_nm"])

    # Dry friction between cables and load cell, where the load moves: it takes from the cables'
    # torque what opposes the motion, elastically over 1 mrad as a bearing winds up.
    def felt(values: Vector, signals: Signals) -> Vector:
        angle = signals.load_angle_rad
        wound = angle - played(angle, 2e-3)
        return np.asarray(values - p["load_torque_nm"] * np.clip(wound / 1e-3, -1.0, 1.0))

    return Hidden("bearing_friction", dict(p), felt_torque=felt)


def _thermal(p: Values) -> Hidden:
    return Hidden(
        "thermal_friction",
        dict(p),
        histories=lambda signals, pair: both(
            1.0 + p["alpha_per_k"] * (signals.temperature_c - REFERENCE_C)
        ),
    )


def _wear(p: Values) -> Hidden:
    return Hidden(
        "wear",
        dict(p),
        histories=lambda signals, pair: both(
            1.0 - p["a"] * np.expm1(-travel_m(signals, pair) / p["travel_m"])
        ),
    )


def _dwell(p: Values) -> Hidden:
    def histories(signals: Signals, pair: Pair) -> Histories:
        age = np.zeros(signals.time_s.size)
        steps = np.abs(np.diff(signals.load_angle_rad)) * pair.ends.load_radius_m
        for i, (dt, way) in enumerate(zip(np.diff(signals.time_s), steps, strict=True)):
            grown = 1.0 - (1.0 - age[i]) * np.exp(-dt / p["dwell_s"])
            age[i + 1] = grown * np.exp(-way / p["distance_m"])
        return both(1.0 + p["a"] * age)

    return Hidden("dwell_strengthening", dict(p), histories=histories)


def _position(p: Values) -> Hidden:
    def histories(signals: Signals, pair: Pair) -> Histories:
        del pair
        angle = signals.load_angle_rad
        if "bump_a" in p:
            away = (angle - p["centre_rad"]) / p["width_rad"]
            return both(1.0 + p["bump_a"] * np.exp(-(away**2)))
        return both(1.0 + p["a"] * np.cos(p["waves_per_turn"] * angle + p["phase_rad"]))

    return Hidden("position_dependent_friction", dict(p), histories=histories)


def _wrap(p: Values) -> Hidden:
    return Hidden(
        "wrap_angle_change",
        dict(p),
        pair=lambda pair: replace(pair, extra_wrap_rad=pair.extra_wrap_rad + p["extra_wrap_rad"]),
    )


def _conduit(p: Values) -> Hidden:
    def softer(pair: Pair) -> Pair:
        compliance = 1.0 / pair.law.axial_stiffness_n + 1.0 / (
            p["stiffness_n_per_m"] * pair.length_m
        )
        return replace(pair, law=pair.law._replace(axial_stiffness_n=1.0 / compliance))

    return Hidden("conduit_compliance", dict(p), pair=softer)


def _stiffening(p: Values) -> Hidden:
    # Tangent EA sqrt(1 - g + g T / T0): EA is the stiffness at the pretension.
    def stiffer(pair: Pair) -> Pair:
        per_n = p["gain"] / (1.0 - p["gain"]) / pair.law.pretension_n
        return replace(pair, law=pair.law._replace(stiffening_per_n=per_n))

    return Hidden("cable_stiffening", dict(p), pair=stiffer)


def _pretension_loss(p: Values) -> Hidden:
    def histories(signals: Signals, pair: Pair) -> Histories:
        lost = p["a"] * np.log1p(signals.time_s / p["tau_s"])
        stretch = pair.law.pretension_n * pair.length_m / pair.law.axial_stiffness_n
        return Histories(extra_length_m=stretch * np.minimum(lost, 0.9))

    return Hidden("pretension_loss", dict(p), histories=histories)


def _pulley(p: Values) -> Hidden:
    if "e" in p:
        return _ends(
            "pulley_eccentricity",
            p,
            motor_eccentricity=p["e"],
            motor_eccentricity_phase_rad=p["phase_rad"],
        )
    return _ends(
        "pulley_eccentricity",
        p,
        load_eccentricity=p["load_e"],
        load_eccentricity_phase_rad=p["load_phase_rad"],
    )


def _encoder_eccentricity(p: Values) -> Hidden:
    name = "encoder_eccentricity"
    if "e_rad" in p:
        return Hidden(
            name,
            dict(p),
            read_motor_angle=lambda x, s: x + p["e_rad"] * np.sin(x + p["phase_rad"]),
        )
    return Hidden(
        name,
        dict(p),
        read_load_angle=lambda x, s: x + p["load_e_rad"] * np.sin(x + p["load_phase_rad"]),
    )


def _encoder_offset(p: Values) -> Hidden:
    if "offset_rad" in p:
        return Hidden("encoder_offset", dict(p), read_motor_angle=lambda x, s: x + p["offset_rad"])
    return Hidden("encoder_offset", dict(p), read_load_angle=lambda x, s: x + p["load_offset_rad"])


def _gravity(p: Values) -> Hidden:
    def felt(values: Vector, signals: Signals) -> Vector:
        return np.asarray(
            values - p["amplitude_nm"] * np.sin(signals.load_angle_rad + p["phase_rad"])
        )

    return Hidden("gravity_imbalance", dict(p), felt_torque=felt)


def _load_inertia(p: Values) -> Hidden:
    def felt(values: Vector, signals: Signals) -> Vector:
        speed = np.gradient(signals.load_angle_rad, signals.time_s)
        return np.asarray(values - p["inertia_kg_m2"] * np.gradient(speed, signals.time_s))

    return Hidden("load_inertia", dict(p), felt_torque=felt)


def _delay(p: Values) -> Hidden:
    (channel, delay_s), *_ = p.items()
    name = "time_delay"
    if channel == "motor_encoder_delay_s":
        return Hidden(name, dict(p), read_motor_angle=late(delay_s))
    if channel == "load_encoder_delay_s":
        return Hidden(name, dict(p), read_load_angle=late(delay_s))
    if channel == "load_cell_delay_s":
        return Hidden(name, dict(p), read_load_torque=late(delay_s))
    return Hidden(name, dict(p), true_torque=late(-delay_s))  # the record is late: truth is ahead


def _amplifier(p: Values) -> Hidden:
    return Hidden(
        "amplifier_lag", dict(p), true_torque=lambda x, s: lagged(x, s.time_s, p["lag_s"])
    )


def _reading(name: str, change: Callable[[Vector, Signals, Values], Vector]) -> Hide:
    return lambda p: Hidden(name, dict(p), read_load_torque=lambda x, s: change(x, s, p))


Hide = Callable[[Values], Hidden]

HIDE: dict[str, Hide] = {
    "viscous_friction": _viscous,
    "stribeck_friction": lambda p: _law(
        "stribeck_friction", p, stribeck_gain=p["a"], stribeck_speed_m_per_s=p["v_s_m_per_s"]
    ),
    "presliding_compliance": lambda p: _law("presliding_compliance", p, slip_m=p["slip_m"]),
    "frictional_lag": lambda p: _law("frictional_lag", p, lag_s=p["lag_s"]),
    "direction_asymmetry": _asymmetry,
    "tension_dependent_friction": lambda p: _law(
        "tension_dependent_friction", p, tension_exponent=p["p"]
    ),
    "bearing_friction": _bearing,
    "thermal_friction": _thermal,
    "wear": _wear,
    "dwell_strengthening": _dwell,
    "position_dependent_friction": _position,
    "wrap_angle_change": _wrap,
    "conduit_compliance": _conduit,
    "cable_stiffening": _stiffening,
    "pretension_loss": _pretension_loss,
    "viscoelastic_cable": lambda p: _ends(
        "viscoelastic_cable", p, creep_share=p["a"], creep_time_s=p["tau_s"]
    ),
    "termination_backlash": lambda p: _ends("termination_backlash", p, play_rad=p["play_rad"]),
    "pulley_eccentricity": _pulley,
    "encoder_eccentricity": _encoder_eccentricity,
    "encoder_offset": _encoder_offset,
    "load_cell_gain": _reading("load_cell_gain", lambda x, s, p: x * (1.0 + p["g"])),
    "load_cell_offset": _reading("load_cell_offset", lambda x, s, p: x + p["offset_nm"]),
    "load_cell_drift": _reading(
        "load_cell_drift", lambda x, s, p: x + p["drift_nm_per_s"] * s.time_s
    ),
    "load_cell_hysteresis": _reading(
        "load_cell_hysteresis", lambda x, s, p: played(x, p["width_nm"])
    ),
    "torque_constant_error": lambda p: Hidden(
        "torque_constant_error", dict(p), true_torque=lambda x, s: (1.0 + p["g"]) * x
    ),
    "motor_torque_offset": lambda p: Hidden(
        "motor_torque_offset", dict(p), true_torque=lambda x, s: x + p["offset_nm"]
    ),
    "cogging": lambda p: _ends(
        "cogging",
        p,
        cogging_nm=p["amplitude_nm"],
        cogging_per_turn=p["harmonic"],
        cogging_phase_rad=p["phase_rad"],
    ),
    "motor_inertia": lambda p: _ends(
        "motor_inertia", p, oversample=2, motor_inertia_kg_m2=p["inertia_kg_m2"]
    ),
    "load_inertia": _load_inertia,
    "gravity_imbalance": _gravity,
    "time_delay": _delay,
    "amplifier_lag": _amplifier,
}
"""Name, in the order of the contracts -> from parameter values to the hidden effect."""


def hide(name: str, values: Values) -> Hidden:
    """Make a hidden effect of the catalogue.

    Parameters
    ----------
    name : str
        As in the contracts; KeyError otherwise.
    values : mapping of str to float
    """
    return HIDE[name](values)


def outside_in(hidden: Sequence[Hidden]) -> list[Hidden]:
    """Return effects as they lie between a reading and the cables, the first one outside.

    As the catalogue's page has it, whatever their order: recorded = (1 + g) (true + offset). One
    that is in no catalogue is inmost.
    """
    order = list(HIDE)
    return sorted(hidden, key=lambda one: order.index(one.name) if one.name in HIDE else len(order))
