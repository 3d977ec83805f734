"""Every result as Plotly figures, by name: the figures that the HTML reports show."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from bowden.diagnosis.compare import Comparison
from bowden.diagnosis.result import Diagnosis
from bowden.errors import BadInput
from bowden.recording.channels import MAIN_CHANNELS, channel
from bowden.recording.recording import Recording
from bowden.report import diagnosis_plots, plots
from bowden.report.canvas import MEASURED, draw, dress
from bowden.report.comparison import prescribed_load_torque

POINTS = 4000


def figures(result: object) -> dict[str, go.Figure]:
    """Draw a result.

    Parameters
    ----------
    result : Recording, Comparison or Diagnosis
        Of a comparison of several recordings the first is drawn.

    Returns
    -------
    dict of str to plotly.graph_objects.Figure
        Recording: ``"time"``. Comparison: ``"time"``, ``"loop"``, ``"conditions"``. Diagnosis:
        ``"ranking"`` and, where something was simulated, ``"before and after"``.

    Raises
    ------
    BadInput
        Another kind of object.
    """
    if isinstance(result, Recording):
        return {"time": _channels(result)}
    if isinstance(result, Comparison):
        one = result.recordings[0]
        prescribed = prescribed_load_torque(one.recording, result.model.transmission.pulley_ratio)
        return {
            "time": plots.over_time(result, one, POINTS),
            "loop": plots.loop(result, one, prescribed, POINTS),
            "conditions": plots.where(result),
        }
    if isinstance(result, Diagnosis):
        drawn = {}
        if result.ranking:
            named = [one.name for one in result.effects]
            drawn["ranking"] = diagnosis_plots.ranking(result.ranking, named)
        for series in result.series[:1]:
            drawn["before and after"] = diagnosis_plots.before_and_after(
                series, POINTS, improved=bool(result.effects)
            )
        return drawn
    raise BadInput("figures", type(result).__name__, "Recording, Comparison or Diagnosis")


def _channels(recording: Recording) -> go.Figure:
    """Draw every channel of a recording but states, one above the other, the main ones first."""
    others = [name for name in recording.channels if name not in MAIN_CHANNELS]
    panels = [
        channel(name)
        for name in (*MAIN_CHANNELS, *others)
        if name in recording.channels and channel(name).kind != "state"
    ]
    plot = make_subplots(rows=len(panels) or 1, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    dress(plot, height=160 * (len(panels) or 1) + 60)
    for row, shown in enumerate(panels, start=1):
        is_angle = shown.kind == "angle"
        values = recording[shown.name]
        curve = (recording.time_s, np.degrees(values) if is_angle else values)
        unit = "°" if is_angle else shown.unit
        title = f"{shown.words} ({unit})" if unit else shown.words
        draw(plot, curve, title, MEASURED, points=POINTS, row=row, listed=False)
        plot.update_yaxes(title_text=title, row=row)
    plot.update_xaxes(title_text="time (s)", row=len(panels) or 1)
    return plot
