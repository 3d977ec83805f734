"""Effects that are in no catalogue, to test the verdict "unlisted".

None is similar to a catalogue effect: each depends on something that is in no catalogue law (the
direction at a place, random moments, the square or cube of a torque, a resonance), so that the
best catalogue effect leaves a good part of the gap.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.continuum import Histories, Pair
from hil_tests.hidden_effects.effects import both
from hil_tests.hidden_effects.hidden import Draw, Hidden, Signals, Values, Vector

Rng = np.random.Generator
Samples = NDArray[np.intp]


def _passages(angle: Vector, place: float) -> Samples:
    """Find the samples at which the angle passes a place on its way up."""
    return np.flatnonzero((angle[:-1] < place) & (angle[1:] >= place))


def _pulses(signals: Signals, starts: Samples, width_s: float) -> Vector:
    """Half a sine of `width_s` after each start."""
    found = np.zeros(signals.time_s.size)
    for start in starts:
        away = (signals.time_s - signals.time_s[start]) / width_s
        found += np.where((away > 0.0) & (away < 1.0), np.sin(np.pi * np.clip(away, 0.0, 1.0)), 0.0)
    return found


def _tension_pulse(p: Values) -> Hidden:
    """Once a stroke, when a strand passes a splice on the way up, both cables are tightened."""

    def histories(signals: Signals, pair: Pair) -> Histories:
        stretch = pair.law.pretension_n * pair.length_m / pair.law.axial_stiffness_n
        starts = _passages(signals.load_angle_rad, p["place_rad"])
        return Histories(extra_length_m=-p["size"] * stretch * _pulses(signals, starts, 0.12))

    return Hidden("tension_pulse_once_a_stroke", dict(p), histories=histories)


def _cell_temperature(p: Values) -> Hidden:
    return Hidden(
        "cell_temperature_crosstalk",
        dict(p),
        read_load_torque=lambda x, s: x + p["size"] * (s.temperature_c - s.temperature_c[0]) / 10.0,
    )


def _encoder_slip(p: Values) -> Hidden:
    def read(values: Vector, signals: Signals) -> Vector:
        rng = np.random.default_rng(int(p["moments"]))
        times = np.sort(rng.uniform(2.0, signals.time_s[-1], 6))
        jumps = p["size"] * rng.choice([-1.0, 1.0], 6)
        return np.asarray(values + jumps @ (signals.time_s[None, :] > times[:, None]))

    return Hidden("intermittent_encoder_slip", dict(p), read_motor_angle=read)


def _friction_flicker(p: Values) -> Hidden:
    """Friction switches between two levels at random moments: a strand that catches and lets go."""

    def histories(signals: Signals, pair: Pair) -> Histories:
        del pair
        rng = np.random.default_rng(int(p["moments"]))
        times = np.cumsum(rng.exponential(1.2, 80))
        high = np.searchsorted(times, signals.time_s) % 2
        return both(np.asarray(1.0 + p["size"] * (high - 0.5), dtype=np.float64))

    return Hidden("friction_flicker", dict(p), histories=histories)


def _cell_cubic(p: Values) -> Hidden:
    return Hidden(
        "load_cell_square_law",
        dict(p),
        read_load_torque=lambda x, _: x + p["size"] * (x / 3.0) ** 2,
    )


def _cell_ringing(p: Values) -> Hidden:
    """Let the cell ring at 9 Hz, hardly damped: a loose mount."""

    def read(values: Vector, signals: Signals) -> Vector:
        del signals
        omega, damping, dt = 2.0 * np.pi * 9.0, 0.05, 1e-3
        state, speed, found = values[0], 0.0, np.empty_like(values)
        for i, value in enumerate(values):
            speed += dt * (omega**2 * (value - state) - 2.0 * damping * omega * speed)
            state += dt * speed
            found[i] = state
        return np.asarray(values + p["size"] * (found - values))

    return Hidden("load_cell_ringing", dict(p), read_load_torque=read)


def _hum(p: Values) -> Hidden:
    def read(values: Vector, signals: Signals) -> Vector:
        swell = 1.0 + 0.6 * np.sin(2.0 * np.pi * 0.23 * signals.time_s)
        return np.asarray(
            values + p["size"] * swell * np.sin(2.0 * np.pi * 6.3 * signals.time_s + 1.0)
        )

    return Hidden("floor_vibration_on_the_cell", dict(p), read_load_torque=read)


def _first_pass(p: Values) -> Hidden:
    """Dry lubricant at one place sticks once after each three seconds away: then it is smooth."""

    def histories(signals: Signals, pair: Pair) -> Histories:
        del pair
        factor, last = np.ones(signals.time_s.size), -9.0
        sticking = False
        for i, (t, angle) in enumerate(zip(signals.time_s, signals.load_angle_rad, strict=True)):
            if abs(angle - p["place_rad"]) < 0.08:
                sticking = sticking or t - last > 3.0
                if sticking:
                    factor[i] += p["size"]
                last = t
            else:
                sticking = False
        return both(factor)

    return Hidden("lubricant_sticks_once", dict(p), histories=histories)


def _speed_burst(p: Values) -> Hidden:
    """Friction jumps up while the cable is between two speeds: a resonance of the liner."""

    def histories(signals: Signals, pair: Pair) -> Histories:
        speed = (
            np.abs(np.gradient(signals.load_angle_rad, signals.time_s)) * pair.ends.load_radius_m
        )
        inside = np.exp(-(np.log(np.maximum(speed, 1e-6) / p["speed_m_per_s"]) ** 2) / 0.05)
        return both(1.0 + p["size"] * inside)

    return Hidden("friction_resonance_in_speed", dict(p), histories=histories)


HIDE: dict[str, Callable[[Values], Hidden]] = {
    "tension_pulse_once_a_stroke": _tension_pulse,
    "cell_temperature_crosstalk": _cell_temperature,
    "intermittent_encoder_slip": _encoder_slip,
    "friction_flicker": _friction_flicker,
    "load_cell_square_law": _cell_cubic,
    "load_cell_ringing": _cell_ringing,
    "floor_vibration_on_the_cell": _hum,
    "lubricant_sticks_once": _first_pass,
    "friction_resonance_in_speed": _speed_burst,
}
"""Name -> from parameter values to the hidden effect."""

LIMITS = {
    "tension_pulse_once_a_stroke": (0.03, 1.5),
    "cell_temperature_crosstalk": (2e-3, 0.2),
    "intermittent_encoder_slip": (5e-3, 0.2),
    "friction_flicker": (0.02, 0.8),
    "load_cell_square_law": (2e-3, 0.5),
    "load_cell_ringing": (0.02, 1.0),
    "floor_vibration_on_the_cell": (2e-3, 0.1),
    "lubricant_sticks_once": (0.1, 2.5),
    "friction_resonance_in_speed": (0.05, 1.5),
}


def draw(name: str, rng: Rng) -> Draw:
    """Draw the numbers of an unlisted effect; its strength is called `size`."""
    low, high = LIMITS[name]
    shape = {
        "size": 0.3 * high,
        "place_rad": float(rng.uniform(-0.06, 0.1)),
        "moments": float(rng.integers(1, 10**6)),
        "speed_m_per_s": float(np.exp(rng.uniform(np.log(0.02), np.log(0.08)))),
    }
    return Draw(shape, "size", low, high)
