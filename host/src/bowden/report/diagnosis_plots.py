"""The plots of a diagnosis. One function a plot; each returns a plotly figure with its units.

Black is measured, vermilion the calibrated model alone, blue the model with the effect: the same
everywhere, safe for colour-blind readers. `diagnosis` puts them on the page.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from bowden.diagnosis.localise import Place, ResidualMap
from bowden.diagnosis.result import Ranked, Series
from bowden.diagnosis.waterfall import BudgetStep
from bowden.diagnosis.wording import place_in_words
from bowden.estimation.posterior import Estimate
from bowden.model.effects import CATALOGUE, LEARNED
from bowden.report.canvas import MEASURED, SIMULATED, draw, dress, legend_above, short
from bowden.report.decimate import envelope
from bowden.report.words import NAMES

_Floats = NDArray[np.float64]

BEFORE = {"color": "#d55e00", "width": 1.4}
AFTER = SIMULATED | {"width": 1.4}
_NOISE = "rgba(92,96,102,0.22)"
_BLUE, _GREY, _LIGHT = "#0072b2", "#9aa1aa", "#c9cdd2"
_DIVERGING = [
    [0.0, "#b2182b"],
    [0.25, "#ef8a62"],
    [0.5, "#f7f7f7"],
    [0.75, "#67a9cf"],
    [1, "#2166ac"],
]
WINDOW_S = 8.0
RANKED = 14


def before_and_after(one: Series, points: int, *, improved: bool) -> go.Figure:
    """Draw a channel, and the residual of either model, over time.

    Parameters
    ----------
    one : Series
    points : int
        At most so many a curve.
    improved : bool
        Whether there is a model with effects beside the calibrated one.
    """
    angle = one.quantity.endswith("_rad")
    scale, unit = (1e3, "mrad") if angle else (1e3, "mN m")
    name = NAMES[one.quantity]
    curves = [
        (f"{name}, measured", one.measured, MEASURED),
        ("calibrated model", one.before, BEFORE),
        *([("with the effect", one.after, AFTER)] if improved else []),
    ]
    left = [("residual, calibrated", one.measured - one.before, BEFORE)]
    if improved:
        left.append(("with the effect", one.measured - one.after, AFTER))
    plot = make_subplots(
        rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.11, row_heights=[0.5, 0.5]
    )
    dress(plot, height=640)
    for text, values, line in curves:
        draw(plot, (one.time_s, values), text, dict(line), points=points, row=1)
    _noise_band(plot, one, scale, points)
    for text, values, line in left:
        curve = (one.time_s, scale * values)
        draw(plot, curve, text, dict(line), points=points, row=2, legend="legend2")
    plot.update_yaxes(title_text=f"{name} ({'rad' if angle else 'N m'})", row=1)
    reach = 1.15 * scale * float(np.quantile(np.abs(left[0][1]), 0.998))
    reach = max(reach, 3.0 * scale * float(np.median(one.sigma)))
    plot.update_yaxes(title_text=f"residual ({unit})", row=2, range=[-reach, reach])
    plot.update_xaxes(title_text="time (s)", row=2)
    plot.update_xaxes(range=_window(one))
    for row, legend in ((1, "legend"), (2, "legend2")):
        axis = plot.layout["yaxis" if row == 1 else f"yaxis{row}"]
        plot.update_layout({legend: legend_above(float(axis.domain[1]))})
    return plot


def _noise_band(plot: go.Figure, one: Series, scale: float, points: int) -> None:
    """Shade where 95 % of the noise lies."""
    band = scale * 1.96 * one.sigma
    chosen = envelope(band, points)
    time_s, high = one.time_s[chosen], band[chosen]
    plot.add_scatter(
        x=short(np.concatenate([time_s, time_s[::-1]])),
        y=short(np.concatenate([high, -high[::-1]])),
        mode="lines",
        line={"width": 0},
        fill="toself",
        fillcolor=_NOISE,
        name="noise, 95 %",
        hoverinfo="skip",
        legend="legend2",
        row=2,
        col=1,
    )


def _window(one: Series) -> list[float]:
    """Choose the stretch to show first: where the calibrated model is worst; the rest is a zoom."""
    time_s = one.time_s
    if float(np.ptp(time_s)) <= 1.5 * WINDOW_S:
        return [float(time_s[0]), float(time_s[-1])]
    square = np.cumsum(((one.measured - one.before) / one.sigma) ** 2)
    starts = np.arange(float(time_s[0]), float(time_s[-1]) - WINDOW_S, 0.5)
    held = np.interp(starts + WINDOW_S, time_s, square) - np.interp(starts, time_s, square)
    start = float(starts[int(np.argmax(held))])
    return [start, start + WINDOW_S]


def residual_map(found: ResidualMap) -> go.Figure:
    """Draw the mean residual over angle and velocity, in sigmas."""
    degrees = np.degrees(found.angle_edges_rad)
    reach = max(2.0, float(np.nanquantile(np.abs(found.mean), 0.97)))
    rows = found.velocity_edges_rad_s
    labels = [f"{low:.2g} .. {high:.2g}" for low, high in pairwise(rows)]
    plot = go.Figure(
        go.Heatmap(
            x=np.round((degrees[1:] + degrees[:-1]) / 2, 1),
            y=labels,
            z=np.round(found.mean, 2),
            colorscale=_DIVERGING,
            zmin=-reach,
            zmax=reach,
            xgap=1.5,
            ygap=1.5,
            hoverongaps=False,
            colorbar={"title": {"text": "σ"}, "thickness": 12, "outlinewidth": 0, "len": 0.9},
            hovertemplate=f"{found.end} %{{x}}°, %{{y}} rad/s: %{{z}} σ<extra></extra>",
        )
    )
    dress(plot, height=90 + 34 * len(labels))
    plot.update_xaxes(title_text=f"{found.end} angle (°)", showgrid=False)
    plot.update_yaxes(
        title_text=f"{found.end} velocity (rad/s)",
        type="category",
        showgrid=False,
        automargin=True,
        title_standoff=14,
    )
    return plot


def places(found: Sequence[Place]) -> go.Figure:
    """Share of the gap against share of the time, place by place."""
    ordered = list(found)[::-1]
    plot = go.Figure()
    for text, shares, colour in (
        ("share of the time", [one.share_of_time for one in ordered], _LIGHT),
        ("share of the squared residual", [one.share_of_gap for one in ordered], _BLUE),
    ):
        plot.add_bar(
            y=[one.condition for one in ordered],
            x=[100.0 * share for share in shares],
            orientation="h",
            name=text,
            marker={"color": colour},
            hovertemplate="%{y}: %{x:.1f} %<extra></extra>",
        )
    plot.update_xaxes(title_text="share (%)", rangemode="tozero")
    plot.update_yaxes(automargin=True, ticksuffix="  ")
    dress(plot, height=110 + 38 * len(ordered))
    plot.update_layout(
        barmode="group", bargap=0.35, legend=legend_above(1.01) | {"traceorder": "reversed"}
    )
    return plot


def waterfall(steps: Sequence[BudgetStep], quantity: str) -> go.Figure:
    """Draw the gap step by step, from the file's model to the noise floor."""
    scale, unit = (1e3, "mrad") if quantity.endswith("_rad") else (1e3, "mN m")
    labels = [_step_title(one.step) for one in steps]
    left = [scale * one.gap_after for one in steps]
    plot = go.Figure(
        go.Bar(
            y=labels[::-1],
            x=left[::-1],
            orientation="h",
            marker={
                "color": [_LIGHT, *[_BLUE] * (len(steps) - 3), _GREY, BEFORE["color"]]
                if len(steps) > 2
                else _BLUE
            },
            text=[f"{value:.3g} {unit}" for value in left[::-1]],
            textposition="outside",
            cliponaxis=False,
            hovertemplate="%{y}: %{x:.3g} " + unit + "<extra></extra>",
        )
    )
    dress(plot, height=110 + 34 * len(steps))
    plot.update_xaxes(title_text=f"remaining gap, RMS on held-out stretches ({unit})")
    plot.update_yaxes(automargin=True, ticksuffix="  ", showgrid=False)
    plot.update_layout(bargap=0.3, showlegend=False, margin={"r": 90, "t": 16})
    return plot


def _step_title(step: str) -> str:
    """Return a step of the budget in words."""
    titles = [
        CATALOGUE[name].title if name in CATALOGUE else {LEARNED: "A learned law"}.get(name, name)
        for name in step.split(" + ")
    ]
    words = " + ".join(titles)
    return {"model file": "model file as it is", "calibration": "calibrated"}.get(
        step, words if step == "noise floor" else f"and {words[0].lower()}{words[1:]}"
    )


def _label(one: Ranked) -> str:
    """Return a candidate in words; no two laws have the same."""
    if one.name == LEARNED:
        return f"learned: {place_in_words(one.variant)}"
    if one.name not in CATALOGUE:
        return one.name
    return CATALOGUE[one.name].title + (f", {one.variant}" if one.variant else "")


def ranking(ranked: Sequence[Ranked], named: Collection[str]) -> go.Figure:
    """Draw the gain of the best candidates on held-out stretches; named ones are blue."""
    shown = list(ranked[:RANKED])[::-1]
    plot = go.Figure(
        go.Bar(
            y=[_label(one) for one in shown],
            x=[one.score for one in shown],
            orientation="h",
            marker={"color": [_BLUE if one.name in named else _GREY for one in shown]},
            text=[f"{one.score:.1f}" for one in shown],
            textposition="outside",
            cliponaxis=False,
            hovertemplate="%{y}: %{x:.1f}<extra></extra>",
        )
    )
    dress(plot, height=90 + 26 * len(shown))
    plot.update_xaxes(title_text="gain in log predictive density over the calibrated model")
    plot.update_yaxes(automargin=True, ticksuffix="  ", showgrid=False)
    plot.update_layout(bargap=0.3, showlegend=False, margin={"r": 60, "t": 16})
    return plot


def calibration(estimates: Sequence[Estimate]) -> go.Figure:
    """How far each number moved, in its tolerances, with its 95 % interval."""
    shown = [one for one in estimates if one.tolerance][::-1]
    plot = go.Figure()
    for limit, colour in ((3.0, "#eef0f2"), (1.0, "#dfe3e8")):
        plot.add_vrect(x0=-limit, x1=limit, fillcolor=colour, line_width=0, layer="below")

    def sigmas(one: Estimate, value: float) -> float:
        return (value - one.before) / (one.tolerance or 1.0)

    moved = [sigmas(one, one.value) for one in shown]
    plot.add_scatter(
        x=moved,
        y=[one.path for one in shown],
        mode="markers",
        marker={"size": 10, "color": [_BLUE if abs(x) <= 3 else BEFORE["color"] for x in moved]},
        error_x={
            "type": "data",
            "symmetric": False,
            "array": [
                sigmas(one, one.value if one.high is None else one.high) - x
                for one, x in zip(shown, moved, strict=True)
            ],
            "arrayminus": [
                x - sigmas(one, one.value if one.low is None else one.low)
                for one, x in zip(shown, moved, strict=True)
            ],
            "color": "#5c6066",
            "thickness": 1.4,
        },
        hovertemplate="%{y}: %{x:.2f} σ<extra></extra>",
    )
    reach = max([4.0, *(1.15 * abs(x) for x in moved)])
    dress(plot, height=86 + 30 * len(shown))
    plot.update_xaxes(
        title_text="moved, in tolerances (shaded: 1 σ and 3 σ)", range=[-reach, reach]
    )
    plot.update_yaxes(automargin=True, ticksuffix="  ", showgrid=False)
    plot.update_layout(showlegend=False, margin={"t": 12})
    return plot
