"""The plots of a comparison. One function a plot; each returns a plotly figure with its units.

Colours mean the same everywhere: black is measured, blue simulated, orange prescribed (safe for
colour-blind readers, and told apart in grey print by width and dash). Angles are in degrees, the
motor's divided by the transmission ratio, so that both ends compare at the load.
"""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from bowden.diagnosis.compare import Comparison, RecordingComparison
from bowden.recording.recording import Recording
from bowden.report.canvas import (
    MEASURED,
    PRESCRIBED,
    RESIDUAL,
    SIMULATED,
    draw,
    dress,
    legend_above,
    short,
)
from bowden.report.decimate import envelope, thin
from bowden.report.words import NAMES, si

_Floats = NDArray[np.float64]

_CABLE_A, _CABLE_B = "#0072b2", "#b5501b"
_SLACK_A, _SLACK_B = "rgba(0,114,178,0.13)", "rgba(213,94,0,0.14)"
OUTWARD, INWARD = "#8a6d00", "#7a869a"


def over_time(comparison: Comparison, one: RecordingComparison, points: int) -> go.Figure:
    """Angles, torques and the residual against time, one above the other."""
    recording, trajectory, quantity = one.recording, one.trajectory, comparison.quantity
    ratio = comparison.model.transmission.pulley_ratio
    angles = [
        ("load angle, measured", recording.load_angle_rad, {**MEASURED, "dash": "2px,2px"}),
        ("motor angle / ratio, measured", recording.motor_angle_rad / ratio, MEASURED),
    ]
    if comparison.other_quantity == "motor_angle_rad":
        angles.append(
            ("motor angle / ratio, simulated", trajectory.motor_angle_rad / ratio, SIMULATED)
        )
    elif comparison.other_quantity == "load_angle_rad":
        angles.append(("load angle, simulated", trajectory.load_angle_rad, SIMULATED))
    torques = [
        (*_lossless(comparison, recording), PRESCRIBED),
        (f"{NAMES[quantity]}, measured", getattr(recording, quantity), MEASURED),
        (f"{NAMES[quantity]}, simulated", getattr(trajectory, quantity), SIMULATED),
    ]
    panels = (
        ("angle (°)", [(name, np.degrees(values), line) for name, values, line in angles]),
        ("torque (N m)", torques),
        ("residual (N m)", [("measured − simulated", one.residual, RESIDUAL)]),
    )
    plot = make_subplots(
        rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.075, row_heights=[0.34, 0.4, 0.26]
    )
    dress(plot, height=860)
    for row, (title, curves) in enumerate(panels, start=1):
        legend = f"legend{row}" if row > 1 else "legend"
        for name, values, line in curves:
            curve = (recording.time_s, values)
            draw(plot, curve, name, line, points=points, row=row, legend=legend)
        plot.update_yaxes(title_text=title, row=row)
        axis = plot.layout["yaxis" if row == 1 else f"yaxis{row}"]
        plot.update_layout({legend: legend_above(float(axis.domain[1]))})
    plot.update_xaxes(title_text="time (s)", row=3)
    return plot


def loop(
    comparison: Comparison,
    one: RecordingComparison,
    prescribed: _Floats | None,
    points: int,
) -> go.Figure:
    """Torque against angle: the hysteresis that the transmission imposes (the paper's Fig. 6).

    Parameters
    ----------
    comparison : Comparison
    one : RecordingComparison
    prescribed : ndarray of shape (n,), N m, or None
        The torque that the tunnel of eq. (7) asks for at the load, without losses; where it is
        not known, the other end's torque without losses is drawn instead.
    points : int
        At most so many a curve.
    """
    quantity, end = comparison.quantity, one.motion.end
    angle = np.degrees(getattr(one.recording, f"{end}_angle_rad"))
    plot = go.Figure()
    for name, source, line in (
        ("measured", one.recording, MEASURED),
        ("simulated", one.trajectory, SIMULATED),
    ):
        draw(plot, (angle, getattr(source, quantity)), name, line, points=points)
    if prescribed is None:
        name, values = _lossless(comparison, one.recording)
        draw(plot, (angle, values), name, PRESCRIBED, points=points)
    else:
        order = np.argsort(angle)
        curve = (angle[order], prescribed[order])
        draw(plot, curve, "prescribed tunnel × ratio", {**PRESCRIBED, "width": 2.2}, points=points)
    margin = 0.03 * float(np.ptp(angle)) or 1.0
    view = [float(angle.min()) - margin, float(angle.max()) + margin]
    plot.update_xaxes(title_text=f"{end} angle (°)", range=view)
    plot.update_yaxes(title_text=f"{NAMES[quantity]} (N m)")
    dress(plot, height=540)
    plot.update_layout(legend=legend_above(1.01))
    return plot


def against_velocity(one: RecordingComparison, points: int) -> go.Figure:
    """Residual against velocity with its straight line (the paper's Fig. 7), by direction."""
    speed, fit = one.motion.velocity_rad_s, one.velocity_fit
    ends = np.array([speed.min(), speed.max()])
    plot = go.Figure()
    for name, part, colour in (
        ("outward", one.motion.outward, OUTWARD),
        ("inward", ~one.motion.outward, INWARD),
    ):
        (held,) = np.nonzero(part)
        chosen = held[thin(held.size, points // 2)]
        plot.add_scatter(
            x=short(speed[chosen]),
            y=short(one.residual[chosen]),
            mode="markers",
            marker={"color": colour, "size": 3.5, "opacity": 0.55},
            name=name,
            hoverinfo="skip",
        )
    plot.add_scatter(
        x=ends,
        y=fit.offset + fit.slope * ends,
        mode="lines",
        line=SIMULATED | {"width": 2.2},
        name=f"linear fit, {si(fit.slope, 'N m s/rad')}",
    )
    plot.update_xaxes(title_text=f"{one.motion.end} velocity (rad/s)")
    plot.update_yaxes(title_text="measured − simulated (N m)")
    dress(plot, height=440)
    plot.update_layout(legend=legend_above(1.01))
    return plot


def where(comparison: Comparison) -> go.Figure:
    """Share of the gap against share of the time, condition by condition."""
    conditions = comparison.where[::-1]
    names = [condition.condition for condition in conditions]
    plot = go.Figure()
    for text, shares, colour in (
        ("share of the time", [c.share_of_time for c in conditions], "#c9cdd2"),
        ("share of the gap (squared)", [c.share_of_gap for c in conditions], "#0072b2"),
    ):
        plot.add_bar(
            y=names,
            x=[100.0 * share for share in shares],
            orientation="h",
            name=text,
            marker={"color": colour},
            hovertemplate="%{y}: %{x:.1f} %<extra></extra>",
        )
    plot.update_xaxes(title_text="share (%)", rangemode="tozero")
    plot.update_yaxes(automargin=True, ticksuffix="  ")
    dress(plot, height=120 + 44 * len(names))
    plot.update_layout(
        barmode="group", bargap=0.35, legend=legend_above(1.01) | {"traceorder": "reversed"}
    )
    return plot


def tensions(one: RecordingComparison, points: int) -> go.Figure:
    """Draw the simulated tensions of both cables at both ends; shade where one is slack."""
    trajectory = one.trajectory
    plot = go.Figure()
    series = (
        ("cable a at the motor", trajectory.motor_tension_a_n, {"color": _CABLE_A, "width": 1.6}),
        (
            "cable a at the load",
            trajectory.load_tension_a_n,
            {"color": _CABLE_A, "width": 1.4, "dash": "4px,3px"},
        ),
        ("cable b at the motor", trajectory.motor_tension_b_n, {"color": _CABLE_B, "width": 1.6}),
        (
            "cable b at the load",
            trajectory.load_tension_b_n,
            {"color": _CABLE_B, "width": 1.4, "dash": "4px,3px"},
        ),
    )
    top = 1.05 * max(float(values.max()) for _, values, _ in series)
    for bit, name, colour in ((1, "cable a slack", _SLACK_A), (2, "cable b slack", _SLACK_B)):
        slack = np.where(trajectory.slack & bit, top, 0.0)
        if slack.any():
            chosen = envelope(slack, points)
            plot.add_scatter(
                x=short(trajectory.time_s[chosen]),
                y=short(slack[chosen]),
                mode="lines",
                line={"width": 0, "shape": "hv", "color": colour},
                fill="tozeroy",
                fillcolor=colour,
                name=name,
                hoverinfo="skip",
            )
    for name, values, line in series:
        draw(plot, (trajectory.time_s, values), name, line, points=points)
    plot.update_xaxes(title_text="time (s)")
    plot.update_yaxes(title_text="tension (N)", range=[0.0, max(top, 1e-9)])
    dress(plot, height=420)
    plot.update_layout(legend=legend_above(1.01))
    return plot


def _lossless(comparison: Comparison, recording: Recording) -> tuple[str, _Floats]:
    """Return the other end's measured torque as it would arrive without friction."""
    ratio = comparison.model.transmission.pulley_ratio
    if comparison.quantity == "load_torque_nm":
        return "motor torque × ratio (no losses)", recording.motor_torque_nm * ratio
    return "load torque / ratio (no losses)", recording.load_torque_nm / ratio
