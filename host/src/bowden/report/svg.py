"""Plotly figures as static SVG: what the reports show, small enough to mail and to print.

Takes the figures that `plots`, `experiment_plots`, `diagnosis_plots` and `rendering` build: lines,
markers, filled areas, horizontal bars, heat maps, error bars, shaded bands and subplots. Knows
nothing of transmissions. `page.figure` embeds one drawing for wide screens and one for phones;
colours are classes, so that the page's dark style reaches them.
"""

# ruff: noqa: ANN401  (plotly is not typed)

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from bowden.report.decimate import envelope, thin
from bowden.report.svg_axes import (
    CHARACTER_PX,
    Axis,
    axes_of,
    cells,
    layout_of,
    margins_of,
    pair_of,
    place,
)

#: Colours on a light page, and what stands for each on a dark one (contrast above 4.5 to 1).
DARK = {
    "#1a1a1a": "#f0f2f4",
    "#0072b2": "#5db8f0",
    "#e08a00": "#ffb74d",
    "#5c6066": "#aab0b8",
    "#c9cdd2": "#4a5058",
    "#8a6d00": "#e0c050",
    "#7a869a": "#a9b4c8",
    "#b5501b": "#ff9b66",
    "#eef0f2": "#22262b",
    "#dfe3e8": "#2f353c",
}
_LINE_PX = 18.0
MOST_POINTS = 700  # of a curve's data that a page carries; recordings have the rest


def draw(plot: go.Figure, width: float, label: str) -> str:
    """Return a figure as SVG.

    Parameters
    ----------
    plot : plotly Figure
    width : float
        Pixels; height and margins follow from the figure's layout.
    label : str
        Plain text for people who cannot see it.
    """
    legend, legend_px = _legend(plot, width)
    height = float(plot.layout.height or 420.0)
    margin = margins_of(plot, legend_px)
    axes = axes_of(plot)
    place(plot, axes, width, height + legend_px, margin)
    parts = [f'<g transform="translate(0 4)">{legend}</g>']
    parts += _grid(plot, axes)
    parts += _bands(plot, axes)
    for trace in plot.data:
        pair = pair_of(trace, axes)
        parts.append(_panel("".join(_trace(plot, trace, *pair)), *pair, trace.type == "bar"))
    parts += _titles(plot, axes, width)
    return (
        f'<svg class="plot" viewBox="0 0 {width:g} {height + legend_px:g}" role="img" '
        f'aria-label="{escape(label, quote=True)}">{"".join(parts)}</svg>'
    )


def describe(plot: go.Figure) -> str:
    """Return one sentence on what a figure shows: its axes and its curves."""
    x = _first(axis.title.text for axis in plot.select_xaxes())
    y = [axis.title.text for axis in plot.select_yaxes() if axis.title.text]
    names = list(dict.fromkeys(trace.name for trace in plot.data if trace.name))
    text = " and ".join(dict.fromkeys(y)) or "values"
    text = f"{text[0].upper()}{text[1:]} against {x}" if x else text
    return text + (f": {', '.join(names)}." if names else ".")


def data_of(plot: go.Figure) -> list[dict[str, object]]:
    """Return the figure's data as plain lists, one entry a trace, thinned, for export."""
    found: list[dict[str, object]] = []
    for trace in plot.data:
        if trace.type == "heatmap" or trace.x is None or not len(trace.x):
            continue
        chosen = thin(len(trace.x), MOST_POINTS)
        x, y = ([values[k] for k in chosen] for values in (trace.x, trace.y))
        found.append({"name": trace.name or "", "x": _plain(x), "y": _plain(y)})
    return found


def style() -> str:
    """Return the CSS of the drawings, light and dark."""
    light = "".join(f".c{code[1:]}{{--c:{code}}}" for code in DARK)
    dark = "".join(f".c{code[1:]}{{--c:{other}}}" for code, other in DARK.items())
    return (
        ".plot{display:block;width:100%;height:auto}.plot text{font-size:13px;fill:var(--ink)}"
        ".plot .tick{fill:var(--soft);font-size:12px}.plot .grid{stroke:var(--line)}"
        ".plot .axis{stroke:var(--soft)}.plot .line{fill:none;stroke-linejoin:round}"
        f"{light}@media(prefers-color-scheme:dark){{{dark}}}"
    )


def _colour(code: Any, attribute: str) -> str:
    """Return the attributes that give a colour: a class where the dark style has another one."""
    text = str(code)
    if text in DARK:
        return f'class="c{text[1:]}" style="{attribute}:var(--c)"'
    return f'style="{attribute}:{escape(text, quote=True)}"'


def _grid(plot: go.Figure, axes: dict[str, Axis]) -> list[str]:
    parts = []
    for x_name, x, y_name, y in cells(plot, axes):
        top, bottom = y.end_px, y.start_px
        show_x = layout_of(plot, x_name).showticklabels is not False
        show_y = layout_of(plot, y_name).showticklabels is not False
        for value, text in x.ticks():
            px = float(x.start_px + (value - x.low) / (x.high - x.low) * (x.end_px - x.start_px))
            parts.append(_line("grid", px, top, px, bottom))
            if show_x:
                parts.append(_text("tick", px, bottom + 18, text, "middle"))
        for value, text in y.ticks():
            py = float(y.start_px + (value - y.low) / (y.high - y.low) * (y.end_px - y.start_px))
            if not y.categories:
                parts.append(_line("grid", x.start_px, py, x.end_px, py))
            if show_y:
                short = text if len(text) <= 34 else text[:33] + "…"
                parts.append(_text("tick", x.start_px - 8, py + 4, short, "end"))
        for axis, at in ((x, 0), (y, 1)):
            if axis.low < 0.0 < axis.high and not axis.categories:
                zero = float(axis.at([0.0])[0])
                ends = (zero, top, zero, bottom) if at == 0 else (x.start_px, zero, x.end_px, zero)
                parts.append(_line("axis", *ends))
        parts.append(_line("axis", x.start_px, bottom, x.end_px, bottom))
        parts.append(_line("axis", x.start_px, top, x.start_px, bottom))
    return parts


def _bands(plot: go.Figure, axes: dict[str, Axis]) -> list[str]:
    """Draw the shaded bands (`add_vrect`) behind the curves."""
    parts = []
    for shape in plot.layout.shapes:
        axis = axes.get(str(shape.xref).removesuffix(" domain"))
        y = axes.get(str(shape.yref).removesuffix(" domain"))
        if axis is None or y is None:
            continue
        left, right = (
            min(max(float(px), axis.start_px), axis.end_px) for px in axis.at([shape.x0, shape.x1])
        )
        parts.append(
            f'<rect x="{left:.1f}" y="{y.end_px:.1f}" width="{max(right - left, 0):.1f}" '
            f'height="{y.start_px - y.end_px:.1f}" {_colour(shape.fillcolor, "fill")}/>'
        )
    return parts


def _trace(plot: go.Figure, trace: Any, x: Axis, y: Axis) -> Iterator[str]:
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
        return f'<path d="{path}Z" {_colour(trace.fillcolor, "fill")}/>'
    line = trace.line
    dash = _dash(line.dash)
    width = f' stroke-width="{line.width or 1.6:g}"'
    colour = _colour(line.color or "#0072b2", "stroke").replace('class="', 'class="line ')
    if "class=" not in colour:
        colour = 'class="line" ' + colour
    return f'<path d="{path}" {colour}{width}{dash}/>'


def _dash(pattern: str | None) -> str:
    """Return the attribute of a dash pattern such as ``"6px,3px"``."""
    return f' stroke-dasharray="{pattern.replace("px", "")}"' if pattern else ""


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


def _panel(drawn: str, x: Axis, y: Axis, is_open: bool) -> str:
    """Cut what is drawn at its panel; bars may write beside themselves."""
    box = (x.start_px, y.end_px, x.end_px - x.start_px, y.start_px - y.end_px)
    left, top, wide, tall = (f"{value:.1f}" for value in box)
    overflow = ' overflow="visible"' if is_open else ""
    return (
        f'<svg x="{left}" y="{top}" width="{wide}" height="{tall}" '
        f'viewBox="{left} {top} {wide} {tall}"{overflow}>{drawn}</svg>'
    )


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
            yield _line("axis", inside[0], float(at), inside[1], float(at))
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
        yield f'<path d="{dots or "M0 0"}" {_colour(colour, "stroke")}{ends}{opacity}/>'


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
            f'height="{thickness:.1f}" {_colour(colour, "fill")}/>'
        )
        if trace.text is not None:
            at = end + (6 if end >= zero else -6)
            anchor = "start" if end >= zero else "end"
            yield _text("tick", at, top + thickness / 2 + 4, str(trace.text[number]), anchor)


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


def _legend(plot: go.Figure, width: float) -> tuple[str, float]:
    """Return the legend, in as many lines as it needs, and their height."""
    if plot.layout.showlegend is False:
        return "", 0.0
    listed = {
        trace.name: trace for trace in plot.data if trace.name and trace.showlegend is not False
    }
    if len(listed) < 1:
        return "", 0.0
    x, line, parts = 8.0, 1, []
    for name, trace in listed.items():
        wide = 30.0 + 7.0 * len(name) + 14.0
        if x + wide > width and x > 8.0:
            x, line = 8.0, line + 1
        y = line * _LINE_PX
        parts.append(_sample(trace, x, y - 4.5))
        parts.append(_text("", x + 28.0, y, name, "start"))
        x += wide
    return "".join(parts), line * _LINE_PX + 10.0


def _sample(trace: Any, x: float, y: float) -> str:
    """Return what a legend shows of a trace."""
    if trace.type == "bar" or (trace.type == "scatter" and trace.fill):
        code = trace.marker.color if trace.type == "bar" else trace.fillcolor
        return f'<rect x="{x:g}" y="{y - 5:g}" width="22" height="10" {_colour(code, "fill")}/>'
    if trace.mode == "markers":
        return f'<circle cx="{x + 11:g}" cy="{y:g}" r="4" {_colour(trace.marker.color, "fill")}/>'
    dash = (
        f' stroke-dasharray="{str(trace.line.dash).replace("px", "")}"' if trace.line.dash else ""
    )
    colour = _colour(trace.line.color or "#0072b2", "stroke")
    return f'<path d="M{x:g} {y:g}h22" stroke-width="2.4"{dash} {colour}/>'


def _titles(plot: go.Figure, axes: dict[str, Axis], width: float) -> list[str]:
    parts = []
    for x_name, x, y_name, y in cells(plot, axes):
        middle_x, middle_y = (x.start_px + x.end_px) / 2, (y.start_px + y.end_px) / 2
        if title := layout_of(plot, x_name).title.text:
            room = (x.end_px - x.start_px) / CHARACTER_PX
            shown = title if len(title) <= room + 8 else title[: int(room) + 7] + "…"
            at = min(middle_x, width - 4 - 3.4 * len(shown)) if len(shown) > room else middle_x
            parts.append(_text("", at, y.start_px + 38, shown, "middle"))
        if title := layout_of(plot, y_name).title.text:
            # As far from its own panel as the first title is from the first panel.
            leftmost = min(one.start_px for name, one in axes.items() if name[0] == "x")
            at = (16.0 if not y.categories else 14.0) + x.start_px - leftmost
            place = f'transform="translate({at:g} {middle_y:.1f}) rotate(-90)"'
            parts.append(f'<text {place} text-anchor="middle">{escape(title)}</text>')
    for note in plot.layout.annotations:
        if note.xref == "paper" and note.text:
            xs = [a for n, a in axes.items() if n[0] == "x"]
            left, right = min(a.start_px for a in xs), max(a.end_px for a in xs)
            ys = [a for n, a in axes.items() if n[0] == "y"]
            top, bottom = min(a.end_px for a in ys), max(a.start_px for a in ys)
            px, py = left + note.x * (right - left), bottom - note.y * (bottom - top) - 6
            room = max(8, int((right - left) / max(1, len({a.start_px for a in xs})) / 7.2))
            text = note.text if len(note.text) <= room else note.text[: room - 1] + "…"
            parts.append(_text("", px, py, text, "middle"))
    return parts


def _line(kind: str, x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def _text(kind: str, x: float, y: float, text: str, anchor: str) -> str:
    name = f' class="{kind}"' if kind else ""
    return f'<text{name} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _plain(values: Any) -> list[object]:
    if values is None:
        return []
    if len(values) and isinstance(values[0], str):
        return [str(value) for value in values]
    return [float(f"{value:.5g}") for value in np.asarray(values, dtype=np.float64)]


def _first(texts: Iterable[str | None]) -> str:
    return next((text for text in texts if text), "")
