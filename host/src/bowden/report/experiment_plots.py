"""The plots of the paper's experiments, counterparts of Figs. 3 to 8. All curves are simulated.

Takes cases of `bowden.model.experiments`, returns plotly figures. Angles are in degrees and torques
at the load: motor angles divided by the transmission ratio, motor torques multiplied by it, so that
a lossless transmission would show one curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from bowden.model.experiments.result import Case
from bowden.model.experiments.tunnel import tunnel_torque, velocity_residual, velocity_slope
from bowden.report.canvas import PRESCRIBED, SIMULATED, draw, dress, legend_above, short
from bowden.report.decimate import thin
from bowden.report.words import si

_Floats = NDArray[np.float64]
_POINTS = 3000
# A series from light to dark: told apart in grey print too.
_SERIES = ("#7fc4e8", "#2a8fc7", "#00558a", "#1a1a1a")
_LOAD = {"color": "#1a1a1a", "width": 1.8}
_SECOND = {"color": "#b5501b", "width": 1.6, "dash": "4px,3px"}
_LOSSLESS = {"color": "#e08a00", "width": 1.4, "dash": "6px,3px"}


@dataclass(frozen=True)
class _Panel:
    row: int
    col: int
    x_title: str
    y_title: str


def locked_load(cases: Sequence[Case]) -> go.Figure:
    """Draw the motor's loop, and the torque at the load (Figs. 3 and 4)."""
    plot = make_subplots(rows=1, cols=2, horizontal_spacing=0.11)
    for case, colour in zip(cases, _SERIES, strict=False):
        run, ratio = case.trajectory, case.model.transmission.pulley_ratio
        line = {"color": colour, "width": 1.7}
        torque = 1e3 * run.motor_torque_nm
        draw(plot, (torque, 1e3 * run.motor_angle_rad), case.label, line, points=_POINTS, row=1)
        arrived = (ratio * torque, 1e3 * run.load_torque_nm)
        draw(plot, arrived, case.label, line, points=_POINTS, row=1, col=2, listed=False)
    ratio = cases[0].model.transmission.pulley_ratio
    peak = 1e3 * ratio * float(np.abs(cases[0].trajectory.motor_torque_nm).max())
    ends = np.array([-peak, peak])
    draw(plot, (ends, ends), "lossless", _LOSSLESS, points=_POINTS, row=1, col=2)
    arrived_nm = max(float(np.abs(case.trajectory.load_torque_nm).max()) for case in cases)
    if arrived_nm > 0.0:  # the loops, not the lossless line, decide how high the panel is
        plot.update_yaxes(range=[-2e3 * arrived_nm, 2e3 * arrived_nm], row=1, col=2)
    _panels(
        plot,
        _Panel(1, 1, "motor torque (mN m)", "motor angle (mrad)"),
        _Panel(1, 2, "motor torque × ratio (mN m)", "load torque (mN m)"),
    )
    dress(plot, height=440)
    plot.update_layout(legend=legend_above(1.02))
    return plot


def over_time(case: Case, duration_s: float) -> go.Figure:
    """Draw angles and torques of both ends over the first `duration_s` seconds (Fig. 5)."""
    run, ratio = case.trajectory, case.model.transmission.pulley_ratio
    shown = run.time_s <= duration_s
    angles = (
        ("load angle", np.degrees(run.load_angle_rad), _LOAD),
        ("motor angle / ratio", np.degrees(run.motor_angle_rad) / ratio, SIMULATED),
    )
    plot = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.11)
    dress(plot, height=640)
    panels = (("angle (°)", angles), ("torque at the load (N m)", _both_torques(case)))
    for row, (title, curves) in enumerate(panels, start=1):
        legend = "legend" if row == 1 else f"legend{row}"
        for name, values, line in curves:
            curve = (run.time_s[shown], values[shown])
            draw(plot, curve, name, line, points=_POINTS, row=row, legend=legend)
        plot.update_yaxes(title_text=title, row=row)
        axis = plot.layout["yaxis" if row == 1 else f"yaxis{row}"]
        plot.update_layout({legend: legend_above(float(axis.domain[1]))})
    plot.update_xaxes(title_text="time (s)", row=2)
    return plot


def tunnel_loop(cases: Sequence[Case]) -> go.Figure:
    """Draw the tunnel that is asked for and the torque that is felt (Fig. 6)."""
    plot = go.Figure()
    for case, line in zip(cases, (SIMULATED, _SECOND), strict=False):
        run = case.trajectory
        name = f"felt at the load, {case.label}"
        angle = np.degrees(run.load_angle_rad)
        draw(plot, (angle, run.load_torque_nm), name, line, points=_POINTS)
    model = cases[0].model
    reach = float(np.abs(cases[0].trajectory.load_angle_rad).max())
    angle = np.linspace(-reach, reach, 801)
    asked = (np.degrees(angle), model.transmission.pulley_ratio * tunnel_torque(angle))
    draw(plot, asked, "asked for (tunnel × ratio)", PRESCRIBED | {"width": 2.4}, points=_POINTS)
    plot.update_xaxes(title_text="load angle (°)")
    plot.update_yaxes(title_text="load torque (N m)")
    dress(plot, height=520)
    plot.update_layout(legend=legend_above(1.01))
    return plot


def viscous_residual(case: Case, without: Case, noise_nm: float) -> go.Figure:
    """Draw what a model misses of a rig with viscous friction, without and with the term (Fig. 7).

    Parameters
    ----------
    case, without : Case
        The rig, and the model that lacks the term.
    noise_nm : float, N m
        One sigma of the load cell, added to the rig's torque.
    """
    velocity, residual = velocity_residual(case, without)
    noise = noise_nm * np.random.default_rng(7).standard_normal(residual.size)
    slope, _ = velocity_slope(case, without)
    chosen = thin(velocity.size, 1500)
    plot = make_subplots(rows=1, cols=2, horizontal_spacing=0.09, shared_yaxes=True)
    for col, values in enumerate((residual + noise, noise), start=1):
        plot.add_scatter(
            x=short(velocity[chosen]),
            y=short(values[chosen]),
            mode="markers",
            marker={"color": "#5c6066", "size": 3.5, "opacity": 0.55},
            showlegend=False,
            hoverinfo="skip",
            row=1,
            col=col,
        )
    ends = np.array([velocity.min(), velocity.max()])
    fit = np.polyfit(velocity, residual, 1)
    draw(
        plot,
        (ends, np.polyval(fit, ends)),
        f"linear fit, {si(slope, 'N m s/rad')}",
        SIMULATED | {"width": 2.2},
        points=_POINTS,
        row=1,
    )
    _panels(
        plot,
        _Panel(1, 1, "load velocity (rad/s), model without the term", "rig − model (N m)"),
        _Panel(1, 2, "load velocity (rad/s), model with it", ""),
    )
    dress(plot, height=400)
    plot.update_layout(legend=legend_above(1.02))
    return plot


def sharing(cases: Sequence[Case], duration_s: float) -> go.Figure:
    """Draw what each end gives while both move the cable, follower by follower (Fig. 8)."""
    plot = _side_by_side(cases)
    for col, case in enumerate(cases, start=1):
        shown = case.trajectory.time_s <= duration_s
        for name, values, line in _both_torques(case):
            curve = (case.trajectory.time_s[shown], values[shown])
            draw(plot, curve, name, line, points=_POINTS, row=1, col=col, listed=col == 1)
    plot.update_xaxes(title_text="time (s)")
    return plot


def sharing_loops(cases: Sequence[Case]) -> go.Figure:
    """Draw the same against the load angle: the loops' areas are each end's work."""
    plot = _side_by_side(cases)
    for col, case in enumerate(cases, start=1):
        angle = np.degrees(case.trajectory.load_angle_rad)
        for name, values, line in _both_torques(case):
            draw(plot, (angle, values), name, line, points=_POINTS, row=1, col=col, listed=col == 1)
    plot.update_xaxes(title_text="load angle (°)")
    return plot


def _side_by_side(cases: Sequence[Case]) -> go.Figure:
    plot = make_subplots(
        rows=1,
        cols=len(cases),
        horizontal_spacing=0.07,
        shared_yaxes=True,
        subplot_titles=[case.label for case in cases],
    )
    dress(plot, height=430)
    plot.update_yaxes(title_text="torque at the load (N m)", col=1)
    plot.update_layout(legend=legend_above(1.09), margin={"t": 70})
    return plot


def _both_torques(case: Case) -> tuple[tuple[str, _Floats, dict[str, object]], ...]:
    run = case.trajectory
    return (
        (
            "motor torque × ratio",
            case.model.transmission.pulley_ratio * run.motor_torque_nm,
            SIMULATED,
        ),
        ("load torque", run.load_torque_nm, _LOAD),
    )


def _panels(plot: go.Figure, *panels: _Panel) -> None:
    for panel in panels:
        plot.update_xaxes(title_text=panel.x_title, row=panel.row, col=panel.col)
        plot.update_yaxes(title_text=panel.y_title, row=panel.row, col=panel.col)
