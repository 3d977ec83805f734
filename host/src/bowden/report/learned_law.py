"""A learned law on the diagnosis page: its curve, its band, where it was visited, and the odds.

Takes a `Diagnosis`, returns sections; `diagnosis` puts them on the page.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from bowden.diagnosis.result import Diagnosis, Learned
from bowden.diagnosis.wording import ARGUMENT_WORDS, law_in_words, place_in_words
from bowden.model.effects.law_table import ARGUMENTS, curve_through
from bowden.model.trajectory import FloatArray
from bowden.report.canvas import dress, legend_above
from bowden.report.page import Section, figure, paragraph, table
from bowden.report.words import percent

LEAST_SHOWN = 0.01  # of probability
DRAWN = 257  # points of a curve
_COLOURS = (
    ("#0072b2", "rgba(0,114,178,0.18)"),
    ("#009e73", "rgba(0,158,115,0.18)"),
    ("#cc79a7", "rgba(204,121,167,0.18)"),
)  # of a curve and its band
_HIDDEN = {"color": "#d55e00", "dash": "6px,3px"}
_UNITS = {"rad": "rad", "rad_per_s": "rad/s", "nm": "N m", "s": "s", "c": "°C"}


@dataclass(frozen=True)
class HiddenLaw:
    """The law that a simulated rig really has: what a learned one is to find.

    Parameters
    ----------
    place : str
        As in `Learned`.
    arguments : tuple of str
        As in `Learned`.
    x, value : ndarray of shape (n,)
    """

    place: str
    arguments: tuple[str, ...]
    x: NDArray[np.float64]
    value: NDArray[np.float64]


def learned_section(diagnosis: Diagnosis, hidden: HiddenLaw | None = None) -> list[Section]:
    """Return the section of a learned law, beside the hidden one; none where there is none."""
    one = diagnosis.learned
    if one is None:
        return []
    words = law_in_words(one)
    odds = [
        [place_in_words(where), percent(share)]
        for where, share in diagnosis.law_odds.items()
        if share >= LEAST_SHOWN
    ]
    body = [
        paragraph(
            f"{words[0].upper()}{words[1:]}. The band holds the law with 95 % probability at each "
            "place, if a law of this argument at this place is right; the area below shows where "
            "the recordings have been. Beyond the ends of the curve it stays level."
        ),
        figure(draw_law(one, hidden), "learned-law"),
        table(["law", "probability, given one of these"], odds),
    ]
    if len(odds) > 1:
        body.append(paragraph("These recordings do not say for certain what it depends on."))
    return [Section("The learned law", body)]


def draw_law(one: Learned, hidden: HiddenLaw | None = None) -> go.Figure:
    """Draw a learned law with its 95 % band, over bars of where it was visited.

    Between knots the band's ends are splines as well. A law of two arguments is drawn over the
    first, at the lowest, the middle and the highest of the second.
    """
    plot = make_subplots(
        rows=2, cols=1, shared_xaxes=True, row_heights=[0.78, 0.22], vertical_spacing=0.06
    )
    for index, (name, curve, visited) in enumerate(_slices(one)):
        _draw_slice(plot, index, name, curve, visited)
    if hidden is not None and (hidden.place, hidden.arguments) == (one.place, one.arguments):
        truth = go.Scatter(x=hidden.x, y=hidden.value, name="hidden in the rig", line=_HIDDEN)
        plot.add_trace(truth, row=1, col=1)
    dress(plot, height=420)
    plot.update_layout(legend=legend_above(1.02))
    what = "share of mu, added" if one.place == "friction_factor" else "torque, added (N m)"
    turns = any(name not in ARGUMENTS for name in one.arguments)
    way = ", moving outward" if turns else ""
    plot.update_yaxes(title_text=f"{what}{way}", row=1, col=1)
    plot.update_yaxes(title_text="visited (%)", row=2, col=1)
    words = ARGUMENT_WORDS[one.arguments[0]]
    plot.update_xaxes(title_text=f"{words} ({unit_of(one.arguments[0])})", row=2, col=1)
    return plot


def _slices(one: Learned) -> list[tuple[str, FloatArray, FloatArray]]:
    """Return name, curve, shape (knots, 4), and visits of what is drawn over the first argument."""
    if one.second is None:
        return [("learned law", one.curve, one.visited)]
    across = np.unique(one.second)
    words = f"{ARGUMENT_WORDS[one.arguments[1]]} {{:.3g}} {unit_of(one.arguments[1])}"
    return [
        (words.format(at), one.curve[one.second == at], one.visited[one.second == at])
        for at in across[[0, across.size // 2, -1]]
    ]


def _draw_slice(
    plot: go.Figure, index: int, name: str, curve: FloatArray, visited: FloatArray
) -> None:
    colour, light = _COLOURS[index]
    knots = curve[:, 0]
    x = np.linspace(knots[0], knots[-1], DRAWN)
    value, low, high = curve_through(knots.tolist(), curve[:, 1:], x).T
    band = {"fill": "toself", "fillcolor": light, "name": "95 % band", "mode": "lines"}
    around = {"x": np.concatenate([x, x[::-1]]), "y": np.concatenate([high, low[::-1]])}
    shown = {"showlegend": index == 0, "line": {"width": 0}, "hoverinfo": "skip"}
    plot.add_trace(go.Scatter(**around, **band, **shown), row=1, col=1)
    law = {"name": name, "line": {"color": colour}, "legendgroup": name}
    plot.add_trace(go.Scatter(x=x, y=value, mode="lines", **law), row=1, col=1)
    at_knots = go.Scatter(x=knots, y=curve[:, 1], mode="markers", showlegend=False, **law)
    plot.add_trace(at_knots, row=1, col=1)
    bars = {"fill": "tozeroy", "fillcolor": light, "mode": "lines", "showlegend": False}
    plot.add_trace(
        go.Scatter(x=knots, y=100.0 * visited, line={"width": 0}, name="visited", **bars),
        row=2,
        col=1,
    )


def unit_of(argument: str) -> str:
    """Return the unit at the end of an argument's name, in print."""
    longest = max((end for end in _UNITS if argument.endswith(f"_{end}")), key=len)
    return _UNITS[longest]
