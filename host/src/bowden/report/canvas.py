"""What all plots share: colours, axes, legends, and curves with no more points than a page needs.

Knows plotly and nothing of transmissions. `plots` and `experiment_plots` draw with it.
"""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from bowden.report.decimate import envelope

_Floats = NDArray[np.float64]

MEASURED = {"color": "#1a1a1a", "width": 1.6}
SIMULATED = {"color": "#0072b2", "width": 1.6}
PRESCRIBED = {"color": "#e08a00", "width": 1.6, "dash": "6px,3px"}
RESIDUAL = {"color": "#5c6066", "width": 1.2}
_GRID, _INK = "#e9ebee", "#1a1a1a"


def draw(
    plot: go.Figure,
    curve: tuple[_Floats, _Floats],
    name: str,
    line: dict[str, object],
    *,
    points: int,
    row: int | None = None,
    col: int = 1,
    legend: str = "legend",
    listed: bool = True,
) -> None:
    """Draw a curve of at most so many points.

    Parameters
    ----------
    plot : plotly Figure
    curve : tuple of two ndarray of shape (n,)
        x and y.
    name : str
    line : dict
        plotly's line properties.
    points : int
        At most so many; no extreme of y is lost.
    row, col : int
        The panel, where the plot has several.
    legend : str
        Which of the plot's legends names the curve.
    listed : bool
        Whether a legend names it at all.
    """
    x, y = curve
    chosen = envelope(y, points)
    trace = go.Scatter(
        x=short(x[chosen]), y=short(y[chosen]), name=name, mode="lines", line=line, legend=legend
    )
    trace.showlegend = listed
    place = {} if row is None else {"row": row, "col": col}
    plot.add_trace(trace, **place)


def short(values: _Floats) -> NDArray[np.float32]:
    """Single precision: half the size of the page, and finer than any screen."""
    return values.astype(np.float32)


def legend_above(y: float) -> dict[str, object]:
    """Return a legend in one line above a plot, y in shares of its height."""
    return {
        "orientation": "h",
        "x": 0,
        "y": y,
        "xanchor": "left",
        "yanchor": "bottom",
        "font": {"size": 12.5},
        "itemsizing": "constant",
        "bgcolor": "rgba(0,0,0,0)",
    }


def dress(plot: go.Figure, height: int) -> None:
    """Give a plot the page's fonts, grid and margins; `height` in pixels."""
    plot.update_layout(
        height=height,
        margin={"l": 64, "r": 12, "t": 40, "b": 48},
        paper_bgcolor="white",
        plot_bgcolor="white",
        font={
            "family": "system-ui, -apple-system, Segoe UI, Roboto, sans-serif",
            "size": 13,
            "color": _INK,
        },
        hovermode="closest",
    )
    axis = {
        "gridcolor": _GRID,
        "zerolinecolor": "#b8bdc4",
        "linecolor": "#8a9099",
        "showline": True,
        "ticks": "outside",
        "tickcolor": "#8a9099",
        "ticklen": 4,
        "title_standoff": 8,
        "exponentformat": "SI",
    }
    plot.update_xaxes(axis)
    plot.update_yaxes(axis)
