"""Plotly figures as static SVG: what the reports show, small enough to mail and to print.

Takes the figures that `plots`, `experiment_plots`, `diagnosis_plots` and `rendering` build: lines,
markers, filled areas, horizontal bars, heat maps, error bars, shaded bands and subplots. Knows
nothing of transmissions. `page.figure` embeds one drawing for wide screens and one for phones;
colours are classes, so that the page's dark style reaches them.
"""

# ruff: noqa: ANN401  (plotly is not typed)

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go

from bowden.report.decimate import thin
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
from bowden.report.svg_elements import DARK, colour_of, line_between, text_at
from bowden.report.svg_traces import MOST_POINTS, draw_trace

_LINE_PX = 18.0


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
        parts.append(_panel("".join(draw_trace(plot, trace, *pair)), *pair, trace.type == "bar"))
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


def _grid(plot: go.Figure, axes: dict[str, Axis]) -> list[str]:
    parts = []
    for x_name, x, y_name, y in cells(plot, axes):
        top, bottom = y.end_px, y.start_px
        show_x = layout_of(plot, x_name).showticklabels is not False
        show_y = layout_of(plot, y_name).showticklabels is not False
        for value, text in x.ticks():
            px = float(x.start_px + (value - x.low) / (x.high - x.low) * (x.end_px - x.start_px))
            parts.append(line_between("grid", px, top, px, bottom))
            if show_x:
                parts.append(text_at("tick", px, bottom + 18, text, "middle"))
        for value, text in y.ticks():
            py = float(y.start_px + (value - y.low) / (y.high - y.low) * (y.end_px - y.start_px))
            if not y.categories:
                parts.append(line_between("grid", x.start_px, py, x.end_px, py))
            if show_y:
                short = text if len(text) <= 34 else text[:33] + "…"
                parts.append(text_at("tick", x.start_px - 8, py + 4, short, "end"))
        for axis, at in ((x, 0), (y, 1)):
            if axis.low < 0.0 < axis.high and not axis.categories:
                zero = float(axis.at([0.0])[0])
                ends = (zero, top, zero, bottom) if at == 0 else (x.start_px, zero, x.end_px, zero)
                parts.append(line_between("axis", *ends))
        parts.append(line_between("axis", x.start_px, bottom, x.end_px, bottom))
        parts.append(line_between("axis", x.start_px, top, x.start_px, bottom))
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
            f'height="{y.start_px - y.end_px:.1f}" {colour_of(shape.fillcolor, "fill")}/>'
        )
    return parts


def _panel(drawn: str, x: Axis, y: Axis, is_open: bool) -> str:
    """Cut what is drawn at its panel; bars may write beside themselves."""
    box = (x.start_px, y.end_px, x.end_px - x.start_px, y.start_px - y.end_px)
    left, top, wide, tall = (f"{value:.1f}" for value in box)
    overflow = ' overflow="visible"' if is_open else ""
    return (
        f'<svg x="{left}" y="{top}" width="{wide}" height="{tall}" '
        f'viewBox="{left} {top} {wide} {tall}"{overflow}>{drawn}</svg>'
    )


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
        parts.append(text_at("", x + 28.0, y, name, "start"))
        x += wide
    return "".join(parts), line * _LINE_PX + 10.0


def _sample(trace: Any, x: float, y: float) -> str:
    """Return what a legend shows of a trace."""
    if trace.type == "bar" or (trace.type == "scatter" and trace.fill):
        code = trace.marker.color if trace.type == "bar" else trace.fillcolor
        return f'<rect x="{x:g}" y="{y - 5:g}" width="22" height="10" {colour_of(code, "fill")}/>'
    if trace.mode == "markers":
        return f'<circle cx="{x + 11:g}" cy="{y:g}" r="4" {colour_of(trace.marker.color, "fill")}/>'
    dash = (
        f' stroke-dasharray="{str(trace.line.dash).replace("px", "")}"' if trace.line.dash else ""
    )
    colour = colour_of(trace.line.color or "#0072b2", "stroke")
    return f'<path d="M{x:g} {y:g}h22" stroke-width="2.4"{dash} {colour}/>'


def _titles(plot: go.Figure, axes: dict[str, Axis], width: float) -> list[str]:
    parts = []
    for x_name, x, y_name, y in cells(plot, axes):
        middle_x, middle_y = (x.start_px + x.end_px) / 2, (y.start_px + y.end_px) / 2
        if title := layout_of(plot, x_name).title.text:
            room = (x.end_px - x.start_px) / CHARACTER_PX
            shown = title if len(title) <= room + 8 else title[: int(room) + 7] + "…"
            at = min(middle_x, width - 4 - 3.4 * len(shown)) if len(shown) > room else middle_x
            parts.append(text_at("", at, y.start_px + 38, shown, "middle"))
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
            parts.append(text_at("", px, py, text, "middle"))
    return parts


def _plain(values: Any) -> list[object]:
    if values is None:
        return []
    if len(values) and isinstance(values[0], str):
        return [str(value) for value in values]
    return [float(f"{value:.5g}") for value in np.asarray(values, dtype=np.float64)]


def _first(texts: Iterable[str | None]) -> str:
    return next((text for text in texts if text), "")
