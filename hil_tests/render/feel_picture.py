"""Wanted and felt torque over time as a self-contained SVG, one panel a trial.

Input: curves on the same axes, by name. Output: SVG text. Knows nothing of laws.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np
from bowden.report.decimate import envelope
from numpy.typing import NDArray

WIDTH, PANEL = 860, 300
LEFT, RIGHT, TOP, BOTTOM = 62, 14, 50, 36
POINTS: Final = 500  # a curve; no extreme is lost
COLOURS: Final = ("#c2410c", "#8a6bb8", "#0969da", "#1f2328")  # the last is wanted, dashed
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Panel:
    """Curves of torque (N m) over time (s), the wanted one last."""

    title: str
    time_s: Array
    curves: Mapping[str, Array]


def picture(panels: Sequence[Panel]) -> str:
    """Draw the panels one below the other."""
    height = PANEL * len(panels)
    label = escape("; ".join(panel.title for panel in panels))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img" '
        f'aria-label="{label}" font-family="system-ui,sans-serif" font-size="13">'
        f'<rect width="{WIDTH}" height="{height}" fill="white"/>'
        + "".join(_panel(panel, PANEL * i) for i, panel in enumerate(panels))
        + "</svg>\n"
    )


def _panel(panel: Panel, top: float) -> str:
    time, curves = panel.time_s, list(panel.curves.items())
    low = min(float(curve.min()) for _, curve in curves)
    high = max(float(curve.max()) for _, curve in curves)
    low, high = low - 0.04 * (high - low), high + 0.04 * (high - low) + 1e-9
    inner_w, inner_h = WIDTH - LEFT - RIGHT, PANEL - TOP - BOTTOM

    def x(value: float) -> float:
        return LEFT + (value - float(time[0])) / float(time[-1] - time[0]) * inner_w

    def y(value: float) -> float:
        return top + TOP + (high - value) / (high - low) * inner_h

    parts = [f'<text x="{LEFT}" y="{top + 18:.0f}" fill="#1f2328">{escape(panel.title)}</text>']
    for level in _ticks(low, high):
        parts.append(
            f'<path d="M{LEFT} {y(level):.1f}H{WIDTH - RIGHT}" stroke="#e1e4e8"/>'
            f'<text x="{LEFT - 8}" y="{y(level) + 4:.1f}" text-anchor="end" fill="#59636e">'
            f"{level:g}</text>"
        )
    for level in _ticks(float(time[0]), float(time[-1])):
        parts.append(
            f'<text x="{x(level):.1f}" y="{top + PANEL - BOTTOM + 18:.1f}" text-anchor="middle" '
            f'fill="#59636e">{level:g}</text>'
        )
    parts.append(
        f'<text x="{WIDTH - RIGHT}" y="{top + PANEL - 2:.0f}" text-anchor="end" fill="#59636e">'
        "time (s)</text>"
        f'<text transform="translate(14 {top + TOP + inner_h / 2:.0f}) rotate(-90)" '
        'text-anchor="middle" fill="#59636e">torque on the load (N m)</text>'
    )
    place = float(LEFT)
    for i, (name, curve) in enumerate(curves):
        colour = COLOURS[i + len(COLOURS) - len(curves)]
        dashed = ' stroke-dasharray="6 4"' if i == len(curves) - 1 else ""
        chosen = envelope(curve, POINTS)
        points = zip(time[chosen].tolist(), curve[chosen].tolist(), strict=True)
        path = "L".join(f"{x(a):.1f} {y(b):.1f}" for a, b in points)
        key = f"M{place:.0f} {top + 34:.0f}h22"
        parts.append(
            f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="1.5"{dashed}/>'
            f'<path d="{key}" stroke="{colour}" stroke-width="2.5"{dashed}/>'
            f'<text x="{place + 28:.0f}" y="{top + 38:.0f}" fill="{colour}">{escape(name)}</text>'
        )
        place += 46 + 7.2 * len(name)
    return "".join(parts)


def _ticks(low: float, high: float) -> list[float]:
    """Round levels between two values, three to eight of them."""
    step = 10.0 ** math.floor(math.log10((high - low) / 3.0))
    step *= max(k for k in (1.0, 2.0, 2.5, 5.0) if k * step <= (high - low) / 3.0)
    first = math.ceil(low / step)
    return [round(k * step, 10) for k in range(first, math.floor(high / step) + 1)]
