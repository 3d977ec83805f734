"""The traces of a figure as SVG: curves, dots, bars and heat maps, as small as the eye allows.

Places come from the axes (`svg_axes`); `svg` puts the traces into their panels.
"""

# ruff: noqa: ANN401  (plotly is not typed)

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from bowden.report.decimate import envelope
from bowden.report.svg_axes import Axis
from bowden.report.svg_elements import colour_of, dash_of, line_between, text_at

MOST_POINTS = 700  # of a curve's data that a page carries; recordings have the rest


def draw_trace(plot: go.Figure, trace: Any, x: Axis, y: Axis) -> Iterator[str]:
    """Yield the elements of a trace in the places that its axes give."""
    if trace.type == "bar":
        yield from _bars(plot, trace, x, y)
    elif trace.type == "heatmap":
        yield from _heatmap(trace, x, y)
    elif trace.mode == "markers":
        yield from _markers(trace, x, y)
    else:
        yield _curve(trace, x, y)


def _curve(trace: Any, x: Axis, y: Axis) -> str:
    px, py = x.at(trace.x), y.at(trace.y)
    if trace.line.shape == "hv":
        px, py = np.repeat(px, 2)[1:], np.repeat(py, 2)[:-1]
    path = _path(px, py)
    if trace.fill in ("toself", "tozeroy"):
        if trace.fill == "tozeroy":
            zero = float(y.at([0.0])[0])
            path = f"M{px[0]:.1f} {zero:.1f}L{path[1:]}L{px[-1]:.1f} {zero:.1f}"
        return f'<path d="{path}Z" {colour_of(trace.fillcolor, "fill")}/>'
    line = trace.line
    dash = dash_of(line.dash)
    width = f' stroke-width="{line.width or 1.6:g}"'
    colour = colour_of(line.color or "#0072b2", "stroke").replace('class="', 'class="line ')
    if "class=" not in colour:
        colour = 'class="line" ' + colour
    return f'<path d="{path}" {colour}{width}{dash}/>'


def _path(px: NDArray[np.float64], py: NDArray[np.float64]) -> str:
    """Return a path of the points in steps of a tenth of a pixel, a gap where one is no number."""
    px, py = _thinned(px, py)
    text, before = [], None
    for a, b in zip(np.round(10 * px), np.round(10 * py), strict=True):
        if not (math.isfinite(a) and math.isfinite(b)):
            before = None
        elif before is None:
            text.append(f"M{a / 10:g} {b / 10:g}l0 0")
            before = (a, b)
        elif (a, b) != before:
            text.append(f"{(a - before[0]) / 10: g}{(b - before[1]) / 10: g}")
            before = (a, b)
    return "".join(text) or "M0 0"


def _thinned(
    px: NDArray[np.float64], py: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Leave out what no eye can see: all but the extremes of a pixel, steps under half a pixel."""
    if px.size > MOST_POINTS and np.all(np.diff(px) >= 0.0):
        chosen = envelope(py, 2 * int(px[-1] - px[0]) + 2)
    else:
        column = np.floor(px) * 4096 + np.floor(py)
        chosen = np.flatnonzero(np.concatenate([[True], np.diff(column) != 0, [True]])[: px.size])
    return px[chosen], py[chosen]


def _markers(trace: Any, x: Axis, y: Axis) -> Iterator[str]:
    px, py = x.at(trace.x), y.at(trace.y)
    colours = trace.marker.color
    many = colours if isinstance(colours, list | tuple) else [colours] * len(px)
    radius = 0.5 * float(trace.marker.size or 6)
    error = trace.error_x
    if error.array is not None:
        low = x.at(np.asarray(trace.x) - np.asarray(error.arrayminus))
        high = x.at(np.asarray(trace.x) + np.asarray(error.array))
        for a, b, at in zip(low, high, py, strict=True):
            inside = max(float(a), x.start_px), min(float(b), x.end_px)
            yield line_between("axis", inside[0], float(at), inside[1], float(at))
    opacity = f' opacity="{trace.marker.opacity:g}"' if trace.marker.opacity else ""
    for colour in dict.fromkeys(many):
        dots = "".join(
            dict.fromkeys(
                f"M{a:.0f} {b:.0f}h0"
                for a, b, own in zip(px, py, many, strict=True)
                if own == colour and x.start_px <= a <= x.end_px and math.isfinite(b)
            )
        )
        # a line of no length with round ends is a dot, in a tenth of the characters
        ends = f' stroke-width="{2 * radius:g}" stroke-linecap="round"'
        yield f'<path d="{dots or "M0 0"}" {colour_of(colour, "stroke")}{ends}{opacity}/>'


def _bars(plot: go.Figure, trace: Any, x: Axis, y: Axis) -> Iterator[str]:
    """Draw horizontal bars, side by side where the plot has several."""
    bars = [one for one in plot.data if one.type == "bar"]
    room = (
        abs(y.start_px - y.end_px) / max(1, len(y.categories)) * (1 - (plot.layout.bargap or 0.3))
    )
    thickness = room / len(bars)
    offset = (len(bars) / 2 - bars.index(trace) - 1) * thickness
    colours = trace.marker.color
    for number, (value, name) in enumerate(zip(trace.x, trace.y, strict=True)):
        zero, end = (float(px) for px in x.at([0.0, float(value)]))
        top = float(y.at([name])[0]) + offset
        colour = colours[number] if isinstance(colours, list | tuple) else colours
        yield (
            f'<rect x="{min(zero, end):.1f}" y="{top:.1f}" width="{abs(end - zero):.1f}" '
            f'height="{thickness:.1f}" {colour_of(colour, "fill")}/>'
        )
        if trace.text is not None:
            at = end + (6 if end >= zero else -6)
            anchor = "start" if end >= zero else "end"
            yield text_at("tick", at, top + thickness / 2 + 4, str(trace.text[number]), anchor)


def _heatmap(trace: Any, x: Axis, y: Axis) -> Iterator[str]:
    z = np.asarray(trace.z, dtype=np.float64)
    columns = np.asarray(trace.x, dtype=np.float64)
    step = float(np.min(np.diff(columns))) if columns.size > 1 else 1.0
    edges = x.at(np.concatenate([columns - step / 2, [columns[-1] + step / 2]]))
    edges = np.clip(edges, x.start_px, x.end_px)
    tall = abs(y.start_px - y.end_px) / max(1, len(y.categories))
    for row, name in enumerate(trace.y):
        top = float(y.at([name])[0]) - tall / 2
        for column in range(columns.size):
            if not math.isfinite(z[row, column]):
                continue
            share = (z[row, column] - trace.zmin) / (trace.zmax - trace.zmin)
            colour = _from_scale(trace.colorscale, min(max(float(share), 0.0), 1.0))
            yield (
                f'<rect x="{edges[column] + 0.7:.1f}" y="{top + 0.7:.1f}" '
                f'width="{max(edges[column + 1] - edges[column] - 1.4, 0.1):.1f}" '
                f'height="{tall - 1.4:.1f}" fill="{colour}">'
                f"<title>{z[row, column]:.2f} σ</title></rect>"
            )


def _from_scale(scale: Any, share: float) -> str:
    """Return the colour at a share of a colour scale of #rrggbb stops."""
    stops = [(float(at), str(code)) for at, code in scale]
    for (low, a), (high, b) in pairwise(stops):
        if share <= high:
            part = (share - low) / (high - low) if high > low else 0.0
            mixed = [round(p + part * (q - p)) for p, q in zip(_rgb(a), _rgb(b), strict=True)]
            return "#" + "".join(f"{value:02x}" for value in mixed)
    return stops[-1][1]


def _rgb(code: str) -> tuple[int, int, int]:
    return int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16)
