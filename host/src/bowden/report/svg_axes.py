"""The axes of a figure that is drawn as SVG: their ranges, ticks and places in pixels.

Reads a Plotly figure's layout and data; `svg` draws with what comes out.
"""

# ruff: noqa: ANN401  (plotly is not typed)

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

CHARACTER_PX = 6.6  # mean width of a character of the tick labels
_TICKS_APART_PX = {"x": 70.0, "y": 42.0}
_BASE = {"l": 64.0, "r": 14.0, "t": 14.0, "b": 48.0}
_LABEL_MOST = 34  # characters of a category that are shown
_Values = Sequence[Any] | NDArray[np.float64]


@dataclass
class Axis:
    """One axis: range of its values, their place in pixels, categories where it has them."""

    name: str
    low: float = math.inf
    high: float = -math.inf
    start_px: float = 0.0
    end_px: float = 1.0
    categories: tuple[str, ...] = ()
    is_fixed: bool = False

    def take(self, values: _Values) -> None:
        """Widen the range to hold these values."""
        found = np.asarray(values, dtype=np.float64)
        found = found[np.isfinite(found)]
        if found.size and not self.is_fixed:
            self.low = min(self.low, float(found.min()))
            self.high = max(self.high, float(found.max()))

    def pad(self, share: float) -> None:
        """Leave some room beyond the values."""
        if not math.isfinite(self.low):
            self.low, self.high = 0.0, 1.0
        if self.high == self.low:
            self.low, self.high = self.low - 0.5, self.high + 0.5
        if not self.is_fixed:
            room = share * (self.high - self.low)
            self.low, self.high = self.low - room, self.high + room

    def at(self, values: _Values) -> NDArray[np.float64]:
        """Return pixels; a category is at its number."""
        if self.categories:
            place = {name: number for number, name in enumerate(self.categories)}
            values = [place[str(value)] for value in values]
        share = (np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low)
        return self.start_px + share * (self.end_px - self.start_px)

    def ticks(self) -> list[tuple[float, str]]:
        """Return round values with their labels."""
        if self.categories:
            return [(float(number), name) for number, name in enumerate(self.categories)]
        most = max(2.0, abs(self.end_px - self.start_px) / _TICKS_APART_PX[self.name[0]])
        raw = (self.high - self.low) / most
        power = 10.0 ** math.floor(math.log10(raw))
        step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= raw * 0.999)
        first = math.ceil(self.low / step - 1e-9)
        last = math.floor(self.high / step + 1e-9)
        digits = max(0, -math.floor(math.log10(step) + 1e-9))
        return [
            (k * step, f"{k * step + 0.0:.{digits}f}".replace("-", "\N{MINUS SIGN}"))
            for k in range(first, last + 1)
        ]


def axes_of(plot: go.Figure) -> dict[str, Axis]:
    """Return every axis with its range; axes that match share one range."""
    found: dict[str, Axis] = {}
    for kind, axes in (("x", plot.select_xaxes()), ("y", plot.select_yaxes())):
        for axis in axes:
            name = kind + axis.plotly_name.removeprefix(f"{kind}axis")
            found[name] = Axis(name)
    for trace in plot.data:
        _take(trace, *pair_of(trace, found))
    for name, axis in found.items():
        layout = layout_of(plot, name)
        if layout.range is not None:
            axis.low, axis.high, axis.is_fixed = *map(float, layout.range), True
        if axis.categories:
            axis.low, axis.high, axis.is_fixed = -0.5, len(axis.categories) - 0.5, True
    for members in _matching(plot, found):
        fixed = [a for a in members if a.is_fixed]
        low, high = min(a.low for a in members), max(a.high for a in members)
        for axis in members:
            axis.low, axis.high = (fixed[0].low, fixed[0].high) if fixed else (low, high)
            axis.is_fixed = bool(fixed)
    markers = any(trace.type == "scatter" and trace.mode == "markers" for trace in plot.data)
    for name, axis in found.items():
        axis.pad(0.05 if name[0] == "y" or markers else 0.0)
    return found


def _take(trace: Any, x: Axis, y: Axis) -> None:
    """Widen the ranges of a trace's axes to hold it."""
    for axis, values in ((x, trace.x), (y, trace.y)):
        if values is None or not len(values):
            continue
        if isinstance(values[0], str):
            axis.categories = tuple(dict.fromkeys([*axis.categories, *map(str, values)]))
        else:
            axis.take(values)
    if trace.type == "bar":
        x.take([0.0])
    elif trace.type == "scatter" and trace.fill == "tozeroy":
        y.take([0.0])


def _matching(plot: go.Figure, axes: dict[str, Axis]) -> Iterator[list[Axis]]:
    groups: dict[str, list[Axis]] = {}
    for name, axis in axes.items():
        root = name
        while (matched := layout_of(plot, root).matches) is not None and matched != root:
            root = matched
        groups.setdefault(root, []).append(axis)
    yield from groups.values()


def layout_of(plot: go.Figure, name: str) -> Any:
    """Return the layout of the axis of that name, ``"x2"``."""
    return plot.layout[f"{name[0]}axis{name[1:]}"]


def pair_of(trace: Any, axes: dict[str, Axis]) -> tuple[Axis, Axis]:
    """Return the two axes of a trace."""
    return axes[trace.xaxis or "x"], axes[trace.yaxis or "y"]


def margins_of(plot: go.Figure, legend_px: float) -> dict[str, float]:
    """Return the room around the panels, in pixels."""
    margin = dict(_BASE)
    longest = max(
        (
            len(str(y))
            for t in plot.data
            for y in (t.y if t.y is not None else ())
            if isinstance(y, str)
        ),
        default=0,
    )
    margin["l"] = max(margin["l"], 12.0 + CHARACTER_PX * min(longest, _LABEL_MOST))
    if longest and any(axis.title.text for axis in plot.select_yaxes()):
        margin["l"] += 20.0
    written = [str(text) for t in plot.data if t.type == "bar" for text in t.text or ()]
    margin["r"] += 4.0 + CHARACTER_PX * max(map(len, written)) if written else 0.0
    margin["t"] += legend_px + (22.0 if plot.layout.annotations else 0.0)
    return margin


def place(
    plot: go.Figure, axes: dict[str, Axis], width: float, height: float, margin: dict[str, float]
) -> None:
    """Give each axis its pixels, from its share of the plot's area."""
    inner_w = width - margin["l"] - margin["r"]
    inner_h = height - margin["t"] - margin["b"]
    for name, axis in axes.items():
        start, end = layout_of(plot, name).domain or (0.0, 1.0)
        if name[0] == "x":
            axis.start_px = margin["l"] + start * inner_w
            axis.end_px = margin["l"] + end * inner_w
        else:
            axis.start_px = margin["t"] + (1.0 - start) * inner_h
            axis.end_px = margin["t"] + (1.0 - end) * inner_h


def cells(plot: go.Figure, axes: dict[str, Axis]) -> Iterator[tuple[str, Axis, str, Axis]]:
    """Yield each panel: the names and axes of its x and y."""
    for name, axis in axes.items():
        if name[0] == "x":
            partner = layout_of(plot, name).anchor or "y"
            if partner in axes:
                yield name, axis, partner, axes[partner]
