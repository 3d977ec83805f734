"""Where a gap is: its share in each condition of speed and direction.

Pure functions over arrays. `compare` calls it; the report and ``--json`` show it as ``where``.
`localise` goes on from here: more conditions, weighted residuals, and whether chance would do it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.signals.motion import Motion

_Floats = NDArray[np.float64]

STANDSTILL_SHARE = 0.02  # of the fastest speed: below it the pair counts as at standstill


@dataclass(frozen=True)
class Condition:
    """One condition and what the gap is in it.

    Parameters
    ----------
    condition : str
        In words: ``"load speed 0.05..0.2 rad/s, outward"``.
    share_of_gap : float
        Part of the sum of squared residuals, 0..1; the shares of all conditions add up to 1.
    share_of_time : float
        Part of the samples, 0..1.
    rms, bias : float
        Of the residual within the condition, in the residual's unit.
    """

    condition: str
    share_of_gap: float
    share_of_time: float
    rms: float
    bias: float


def split_by_motion(residual: _Floats, motion: Motion) -> tuple[Condition, ...]:
    """Split a residual by speed (standstill, slow, medium, fast) and direction (outward, inward).

    Parameters
    ----------
    residual : ndarray of shape (n,)
    motion : Motion
        Of the same samples.

    Returns
    -------
    tuple of Condition
        Largest share of the gap first; conditions that no sample meets are left out.
    """
    total = float(np.sum(residual**2))
    found = [
        Condition(
            condition=text,
            share_of_gap=float(np.sum(residual[part] ** 2)) / total if total > 0.0 else 0.0,
            share_of_time=float(part.mean()),
            rms=float(np.sqrt(np.mean(residual[part] ** 2))),
            bias=float(residual[part].mean()),
        )
        for text, part in motion_bands(motion)
        if part.any()
    ]
    return tuple(sorted(found, key=lambda condition: -condition.share_of_gap))


def motion_bands(motion: Motion) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return conditions of speed and direction in words, each with the samples that meet it.

    Standstill, and thirds of what is faster in each direction: every sample meets exactly one.
    """
    name, speed = motion.end, np.abs(motion.velocity_rad_s)
    slowest = float(STANDSTILL_SHARE * speed.max(initial=0.0))
    moving = speed > slowest
    parts: list[tuple[str, NDArray[np.bool_]]] = [(f"{name} at standstill", ~moving)]
    if moving.any():
        edges = [
            slowest,
            *(_two_digits(q) for q in np.quantile(speed[moving], [1 / 3, 2 / 3])),
            np.inf,
        ]
        texts = (f"below {edges[1]:g}", f"{edges[1]:g}..{edges[2]:g}", f"above {edges[2]:g}")
        for low, high, text in zip(edges[:-1], edges[1:], texts, strict=True):
            band = moving & (speed > low) & (speed <= high)
            parts.append((f"{name} speed {text} rad/s, outward", band & motion.outward))
            parts.append((f"{name} speed {text} rad/s, inward", band & ~motion.outward))
    return parts


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
