"""The page of one of the paper's experiments with the user's recordings beside the model.

Takes `MeasuredRun`s (a recording and the model of its rig), returns HTML text: counterparts of
Figs. 3 (1a), 4 (1b), 5 to 7 (2) and 8 (3), measured and simulated on the same axes. The model gets
the measured motor torque and load angle, and predicts the load torque and the motor angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from bowden.model import Inputs, Mode, Model, Trajectory, simulate
from bowden.model.experiments.tunnel import SEGMENTS_WITH_VISCOUS_TERM, VISCOUS_TERM_S_PER_M
from bowden.model.experiments.variants import with_segments, with_viscous_term
from bowden.recording.recording import Recording
from bowden.report.canvas import PRESCRIBED, SIMULATED, draw, dress, legend_above, short
from bowden.report.decimate import thin
from bowden.report.page import Section, figure, page, paragraph, table
from bowden.report.words import si

_Floats = NDArray[np.float64]
_POINTS = 3000
_SERIES = ("#2a8fc7", "#b5501b", "#00734d", "#7a4fa3", "#1a1a1a")
_MEASURED = {"color": "#1a1a1a", "width": 1.7}
_DASH = {"dash": "5px,3px", "width": 1.5}
_MOVES_RAD = 0.2  # beyond it the load was moved, below it locked
_VELOCITY_S = 0.02  # over which the load's velocity is taken

TITLES = {
    "1a": "Experiment 1a: pretension, load locked",
    "1b": "Experiment 1b: loops of the conduit",
    "2": "Experiment 2: error-reduction tunnel, an operator moves the load",
    "3": "Experiment 3: the motor follows the load's position",
}


@dataclass(frozen=True)
class MeasuredRun:
    """A recording and the model of the rig that it is of.

    Parameters
    ----------
    label : str
        What sets it apart: ``"2 N"``.
    recording : Recording
        With both angles and both torques.
    model : Model
    """

    label: str
    recording: Recording
    model: Model

    @cached_property
    def simulated(self) -> Trajectory:
        """The model's answer to the measured motor torque and load angle."""
        return _answer(self.model, self.recording)

    @property
    def gap_nm(self) -> float:
        """RMS of measured minus simulated load torque, N m."""
        gap = self.recording.load_torque_nm - self.simulated.load_torque_nm
        return float(np.sqrt(np.mean(gap**2)))

    @property
    def gap_rad(self) -> float:
        """RMS of measured minus simulated motor angle, without its mean, rad."""
        gap = self.recording.motor_angle_rad - self.simulated.motor_angle_rad
        return float(np.std(gap))


def measured_experiment_report(experiment: str, runs: Sequence[MeasuredRun]) -> str:
    """Make the page.

    Parameters
    ----------
    experiment : {"1a", "1b", "2", "3"}
    runs : sequence of MeasuredRun
        At least one; as many as pretensions or paths.

    Returns
    -------
    str
        A self-contained HTML document.
    """
    sections = []
    locked = [run for run in runs if np.ptp(run.recording.load_angle_rad) <= _MOVES_RAD]
    moved = [run for run in runs if run not in locked]
    if experiment in ("1a", "1b"):
        if locked:
            sections.append(_section("Load locked", beside_locked(locked), "locked"))
        if moved:
            sections.append(_section("Backlash, load moving", beside_backlash(moved), "backlash"))
    elif experiment == "2":
        for number, run in enumerate(runs):
            sections += [
                _section(f"Tunnel, {run.label}", beside_tunnel(run), f"tunnel-{number}"),
                _section(f"Over time, {run.label}", beside_time(run), f"time-{number}"),
                _section(
                    f"What the model misses against velocity, {run.label}",
                    beside_velocity(run),
                    f"velocity-{number}",
                ),
            ]
    else:
        sections += [
            _section(f"Who overcomes the friction, {run.label}", beside_sharing(run), f"share-{n}")
            for n, run in enumerate(runs)
        ]
    header, rows = gaps_table(runs)
    sections.append(Section("Measured less simulated", [table(header, rows)]))
    worst = max(runs, key=lambda run: run.gap_nm)
    return page(
        title=TITLES[experiment],
        subtitle="Measured, and the model with the measured motor torque and load angle",
        verdict=f"Measured and simulated load torque differ by {si(worst.gap_nm, 'N m')} RMS at "
        f"most ({worst.label}).",
        sections=sections,
        facts={run.label: run.recording.source for run in runs},
    )


def gaps_table(runs: Sequence[MeasuredRun]) -> tuple[tuple[str, ...], list[list[str]]]:
    """Return header and rows of torques and gaps."""
    header = ("", "motor torque, p-p", "load torque, p-p", "simulated", "gap RMS", "angle gap RMS")
    rows = [
        [
            run.label,
            si(float(np.ptp(run.recording.motor_torque_nm)), "N m"),
            si(float(np.ptp(run.recording.load_torque_nm)), "N m"),
            si(float(np.ptp(run.simulated.load_torque_nm)), "N m"),
            si(run.gap_nm, "N m"),
            si(run.gap_rad, "rad"),
        ]
        for run in runs
    ]
    return header, rows


def beside_locked(runs: Sequence[MeasuredRun]) -> go.Figure:
    """Draw the motor's loop and the torque at a locked load (Figs. 3 and 4)."""
    plot = make_subplots(rows=1, cols=2, horizontal_spacing=0.11)
    for run, colour in zip(runs, _SERIES * len(runs), strict=False):
        torque, ratio = 1e3 * run.recording.motor_torque_nm, run.model.transmission.pulley_ratio
        for of, name, dash in _both(run):
            line = {"color": colour, "width": 1.7} | dash
            mean = float(of.motor_angle_rad.mean())
            curve = (torque, 1e3 * (of.motor_angle_rad - mean))
            draw(plot, curve, f"{run.label}, {name}", line, points=_POINTS, row=1)
            arrived = (ratio * torque, 1e3 * of.load_torque_nm)
            draw(plot, arrived, run.label, line, points=_POINTS, row=1, col=2, listed=False)
    for col, x, y in (
        (1, "motor torque (mN m)", "motor angle less its mean (mrad)"),
        (2, "motor torque × ratio (mN m)", "load torque (mN m)"),
    ):
        plot.update_xaxes(title_text=x, row=1, col=col)
        plot.update_yaxes(title_text=y, row=1, col=col)
    return _dressed(plot, 460)


def beside_backlash(runs: Sequence[MeasuredRun]) -> go.Figure:
    """Draw by how much the motor lags behind a moved load (Fig. 4)."""
    plot = go.Figure()
    for run, colour in zip(runs, _SERIES * len(runs), strict=False):
        ratio, load = run.model.transmission.pulley_ratio, run.recording.load_angle_rad
        for of, name, dash in _both(run):
            lag = of.motor_angle_rad - ratio * load
            line = {"color": colour, "width": 1.7} | dash
            curve = (np.degrees(load), 1e3 * (lag - lag.mean()))
            draw(plot, curve, f"{run.label}, {name}", line, points=_POINTS)
    plot.update_xaxes(title_text="load angle (°)")
    plot.update_yaxes(title_text="motor angle − ratio × load angle (mrad)")
    return _dressed(plot, 460)


def beside_tunnel(run: MeasuredRun) -> go.Figure:
    """Draw the torque that is asked for and the torque that is felt (Fig. 6)."""
    plot = go.Figure()
    angle = np.degrees(run.recording.load_angle_rad)
    for of, name, _ in _both(run):
        line = _MEASURED if name == "measured" else SIMULATED
        draw(plot, (angle, of.load_torque_nm), f"felt, {name}", line, points=_POINTS)
    asked = run.model.transmission.pulley_ratio * run.recording.motor_torque_nm
    draw(plot, (angle, asked), "motor torque × ratio", PRESCRIBED, points=_POINTS)
    plot.update_xaxes(title_text="load angle (°)")
    plot.update_yaxes(title_text="load torque (N m)")
    return _dressed(plot, 480)


def beside_time(run: MeasuredRun) -> go.Figure:
    """Draw angles and torques of both ends over time, scaled by the ratio (Fig. 5)."""
    plot = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.1)
    ratio, time_s = run.model.transmission.pulley_ratio, run.recording.time_s
    load = np.degrees(run.recording.load_angle_rad)
    draw(plot, (time_s, load), "load", {"color": "#e08a00", "width": 1.5}, points=_POINTS, row=1)
    for of, name, _ in _both(run):
        line = _MEASURED if name == "measured" else SIMULATED
        angle = np.degrees(of.motor_angle_rad) / ratio
        draw(plot, (time_s, angle), f"motor / ratio, {name}", line, points=_POINTS, row=1)
        torque = (time_s, of.load_torque_nm)
        draw(plot, torque, f"load torque, {name}", line, points=_POINTS, row=2, listed=False)
    plot.update_yaxes(title_text="angle (°)", row=1)
    plot.update_yaxes(title_text="load torque (N m)", row=2)
    plot.update_xaxes(title_text="time (s)", row=2)
    return _dressed(plot, 620)


def beside_velocity(run: MeasuredRun) -> go.Figure:
    """Draw measured less simulated load torque over velocity (Fig. 7)."""
    recording = run.recording
    velocity = load_velocity(recording)
    meshed = run.model
    if meshed.solver != "mesh":
        meshed = with_segments(meshed, SEGMENTS_WITH_VISCOUS_TERM)
    terms = (with_viscous_term(meshed, 0.0), with_viscous_term(meshed, VISCOUS_TERM_S_PER_M))
    plot = make_subplots(rows=1, cols=2, horizontal_spacing=0.09, shared_yaxes=True)
    chosen = thin(velocity.size, 1500)
    ends = np.array([velocity.min(), velocity.max()])
    for col, model in enumerate(terms, start=1):
        residual = recording.load_torque_nm - _answer(model, recording).load_torque_nm
        plot.add_scatter(
            x=short(velocity[chosen]),
            y=short(residual[chosen]),
            mode="markers",
            marker={"color": "#5c6066", "size": 3.5, "opacity": 0.55},
            showlegend=False,
            hoverinfo="skip",
            row=1,
            col=col,
        )
        fit = np.polyfit(velocity, residual, 1)
        name = f"linear fit, {si(float(fit[0]), 'N m s/rad')}"
        line = SIMULATED if col == 1 else _MEASURED
        draw(plot, (ends, np.polyval(fit, ends)), name, line, points=_POINTS, row=1, col=col)
    plot.update_xaxes(title_text="load velocity (rad/s), model without a viscous term", col=1)
    plot.update_xaxes(title_text=f"with {VISCOUS_TERM_S_PER_M:g} s/m", col=2)
    plot.update_yaxes(title_text="measured − model (N m)", col=1)
    return _dressed(plot, 420)


def beside_sharing(run: MeasuredRun) -> go.Figure:
    """Draw what each end gives: measured, from the measured torque, and ideal (Fig. 8)."""
    recording, ratio = run.recording, run.model.transmission.pulley_ratio
    load = recording.load_angle_rad
    inputs = Inputs(recording.time_s, motor_angle_rad=ratio * load, load_angle_rad=load)
    ideal = simulate(run.model, Mode.POSITION_POSITION, inputs)
    columns: tuple[tuple[str, Recording | Trajectory], ...] = (
        ("measured", recording), ("model, measured torque", run.simulated), ("model, ideal", ideal)
    )  # fmt: skip
    titles = [name for name, _ in columns]
    plot = make_subplots(
        rows=1, cols=3, horizontal_spacing=0.05, shared_yaxes=True, subplot_titles=titles
    )
    for col, (_, of) in enumerate(columns, start=1):
        for name, values, line in (
            ("motor torque × ratio", ratio * of.motor_torque_nm, SIMULATED),
            ("load torque", of.load_torque_nm, _MEASURED),
        ):
            curve = (recording.time_s, values)
            draw(plot, curve, name, line, points=_POINTS, row=1, col=col, listed=col == 1)
    plot.update_xaxes(title_text="time (s)")
    plot.update_yaxes(title_text="torque at the load (N m)", col=1)
    dressed = _dressed(plot, 430)
    dressed.update_layout(legend=legend_above(1.09), margin={"t": 70})
    return dressed


def load_velocity(recording: Recording) -> _Floats:
    """Return the load's velocity, rad/s, over a step long against that of the encoder's counts."""
    half = 0.5 * _VELOCITY_S
    time_s, load = recording.time_s, recording.load_angle_rad
    ahead = np.minimum(time_s + half, time_s[-1])
    behind = np.maximum(time_s - half, time_s[0])
    rise = np.interp(ahead, time_s, load) - np.interp(behind, time_s, load)
    velocity: _Floats = rise / (ahead - behind)
    return velocity


def _answer(model: Model, recording: Recording) -> Trajectory:
    inputs = Inputs(
        recording.time_s,
        motor_torque_nm=recording.motor_torque_nm,
        load_angle_rad=recording.load_angle_rad,
    )
    return simulate(model, Mode.TORQUE_POSITION, inputs)


def _both(
    run: MeasuredRun,
) -> tuple[tuple[Recording | Trajectory, str, dict[str, object]], ...]:
    return (run.recording, "measured", {}), (run.simulated, "model", dict(_DASH))


def _section(title: str, plot: go.Figure, name: str) -> Section:
    return Section(title, [paragraph(_WORDS[name.split("-", maxsplit=1)[0]]), figure(plot, name)])


def _dressed(plot: go.Figure, height: int) -> go.Figure:
    dress(plot, height=height)
    plot.update_layout(legend=legend_above(1.02))
    return plot


_WORDS = {
    "locked": "Left: motor angle over motor torque. Right: torque at the locked load. Solid "
    "lines are measured, dashed ones are the model's.",
    "backlash": "By how much the motor lags behind the load. The height of a loop is the backlash.",
    "tunnel": "The torque that reaches the operator over the load angle, and what the motor made.",
    "time": "Angles and torques of both ends, the motor's scaled by the ratio of the radii.",
    "velocity": "Measured less simulated load torque. A slope is friction that grows with speed.",
    "share": "Torques of both ends: measured, of the model with the measured motor torque, and of "
    "the model with a motor that follows exactly.",
}
