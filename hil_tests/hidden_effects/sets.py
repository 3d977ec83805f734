"""Sets of recordings of one rig, as labs make them: locked load, tunnel, nested strokes, multisine.

Each recording starts at standstill at zero, with the same rig and the same hidden truth; the
sampling is even or jitters by a fifth of a period. Drawn from a random generator alone;
`recordings` makes the rig and the hidden effects, and `benchmarks.diagnosis --recordings N` asks
for sets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil_tests.hidden_effects import excitation
from hil_tests.hidden_effects.hidden import Signals, Vector
from hil_tests.hidden_effects.recordings import (
    WARMS,
    Case,
    Truth,
    as_is,
    as_recorded,
    draw_names,
    draw_rig,
    hide,
    most_torque_nm,
    random_of,
    thermometer,
)
from hil_tests.hidden_effects.strength import Read, read_out

KINDS = ("complete", "single", "pair", "several", "unlisted")  # a smooth law follows one range
RATES_HZ = (200.0, 500.0, 1000.0, 2000.0)
UNEVEN = 0.2  # of a period, at most

Rng = np.random.Generator
Motion = Callable[[Rng, Vector, float], tuple[Vector, Vector]]


def _locked(rng: Rng, time_s: Vector, most_nm: float) -> tuple[Vector, Vector]:
    """Load locked, the motor winds the cables up: torque levels with ramps between them."""
    angle = np.zeros_like(time_s)
    return excitation.motor_torque(rng, time_s, angle, most_nm), angle


def _tunnel(rng: Rng, time_s: Vector, most_nm: float) -> tuple[Vector, Vector]:
    """Handle strokes through a tunnel around the middle."""
    angle = excitation.handle(rng, time_s)
    beyond = np.maximum(np.abs(angle) - excitation.TUNNEL_EDGE_RAD, 0.0)
    wall = np.minimum(excitation.TUNNEL_NM_PER_RAD * beyond, min(most_nm, 0.2))
    return -np.sign(angle) * wall, angle


def _nested(rng: Rng, time_s: Vector, most_nm: float) -> tuple[Vector, Vector]:
    """Strokes that become smaller and smaller, then large again, at torques that alternate."""
    amplitude, speed = float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.3, 1.5))
    sizes = amplitude * 0.75 ** np.arange(6)
    ends = np.concatenate([[0.0], *[(x, -x) for x in sizes]])
    lasts = np.abs(np.diff(ends)) / speed + 0.1
    at = np.concatenate([[0.0, 0.4], 0.4 + np.cumsum(lasts)])
    one = np.concatenate([[0.0], ends])
    turns = int(np.ceil(time_s[-1] / at[-1]))
    knots = np.concatenate([at[:-1] + at[-1] * k for k in range(turns)])
    angle = np.interp(time_s, knots, np.tile(one[:-1], turns))
    width = round(excitation.ROUNDING_S / (time_s[1] - time_s[0]))
    angle = np.convolve(np.pad(angle, (width, 0)), np.ones(width) / width)[width : -width + 1]
    level = float(rng.uniform(-1.0, 1.0)) * most_nm
    torque = np.interp(time_s % 8.0, [0.0, 1.0, 4.0, 5.0, 8.0], [0.0, level, level, 0.0, 0.0])
    return torque, angle


def _multisine(rng: Rng, time_s: Vector, most_nm: float) -> tuple[Vector, Vector]:
    """Handle and motor torque as sums of sines that share no frequency, fading in."""

    def sum_of(count: int, low_hz: float, high_hz: float, peak: float) -> Vector:
        frequencies = np.exp(rng.uniform(np.log(low_hz), np.log(high_hz), count))
        phases = rng.uniform(0.0, 2.0 * np.pi, count)
        waves = np.sin(2.0 * np.pi * np.outer(time_s, frequencies) + phases)
        total = (waves / np.sqrt(frequencies)).sum(axis=1)
        return np.asarray(total * peak / np.max(np.abs(total)))

    fade = np.clip((time_s - 0.3) / 1.0, 0.0, 1.0)
    fade = fade**2 * (3.0 - 2.0 * fade)
    angle = fade * sum_of(4, 0.08, 1.2, float(rng.uniform(0.15, 0.5)))
    return fade * sum_of(5, 0.05, 2.0, float(rng.uniform(0.3, 0.9)) * most_nm), angle


MOTIONS: dict[str, Motion] = {
    "locked load": _locked,
    "tunnel": _tunnel,
    "nested strokes": _nested,
    "multisine": _multisine,
}


def draw_set(
    seed: int,
    kind: str,
    effect: str | Sequence[str] | None = None,
    length_s: float = 20.0,
    count: int = 4,
    *,
    stiction: bool = False,
) -> Case:
    """Draw a rig, what is hidden in it, and several recordings of it.

    Parameters
    ----------
    seed : int
    kind : "complete", "single", "pair", "several", "unlisted"
    effect : str or several of them, optional
    length_s : float
        Of each recording, s.
    count : int
        Of recordings, 1 .. 4: no motion comes twice.
    stiction : bool
        Whether the rig's mu_s is above its mu_d.

    Returns
    -------
    Case
        The first recording in `columns`, the others in `more`. `truth.strength` is the weakest
        effect's in the recording that shows it best.
    """
    names = [effect] if isinstance(effect, str) else list(effect or ())
    rng = random_of(seed, kind, [*names, f"set of {count}"])
    rig = draw_rig(rng, stiction=stiction)
    motions = [str(x) for x in rng.choice(list(MOTIONS), count, replace=False)]
    fine_s = np.arange(round(length_s * excitation.RATE_HZ)) / excitation.RATE_HZ
    runs = []
    for name in motions:
        torque, angle = MOTIONS[name](rng, fine_s, most_torque_nm(rig.pair))
        runs.append(Signals(fine_s, torque, angle, excitation.temperature(rng, fine_s)))
    names = names or draw_names(rng, kind)
    plain = [as_is(rig.pair, one) for one in runs]
    found, worths = hide(rng, kind, names, rig.pair, plain)
    warm = rng.random() < 0.5 or bool(set(WARMS) & set(names))
    rate_hz, uneven = float(rng.choice(RATES_HZ)), bool(rng.random() < 0.5)
    columns = []
    for one in runs:
        sampled, read = _sampled(rng, one, read_out(rig.pair, one, found), rate_hz, uneven=uneven)
        columns.append(as_recorded(rng, sampled, read))
        if warm:
            columns[-1] |= thermometer(rng, sampled)
    calibration = {"rig": rig.nominal}
    truth = Truth(
        seed,
        kind,
        tuple((h.name, h.parameters) for h in found),
        min(worths, default=0.0),
        plain[0].floor,
        calibration,
    )
    return Case(columns[0], rig.model_yaml, truth, tuple(columns[1:]))


def _sampled(
    rng: Rng, signals: Signals, read: Read, rate_hz: float, *, uneven: bool
) -> tuple[Signals, Read]:
    """Sample what was solved each millisecond at a rate of a lab's; between samples in a line."""
    fine_s = signals.time_s
    time_s = np.arange(round(fine_s[-1] * rate_hz)) / rate_hz
    if uneven:
        jitter = rng.uniform(-0.5, 0.5, time_s.size) * UNEVEN / rate_hz
        time_s = np.maximum(time_s + jitter, 0.0)
        time_s[0] = 0.0

    def at(values: Vector) -> Vector:
        return np.asarray(np.interp(time_s, fine_s, values))

    return replace(
        signals,
        time_s=time_s,
        motor_torque_nm=at(signals.motor_torque_nm),
        load_angle_rad=at(signals.load_angle_rad),
        temperature_c=at(signals.temperature_c),
    ), Read(at(read.motor_angle_rad), at(read.load_angle_rad), at(read.load_torque_nm))
