"""A page with one trial: torque over time and over angle, motor torque, tensions."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from bowden.report.canvas import MEASURED, PRESCRIBED, RESIDUAL, SIMULATED, draw, dress
from bowden_rig.rig import state as at
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from hil_tests.render.trial import Trial

POINTS: Final = 6000

_Curve = tuple[str, NDArray[np.float64], dict[str, object]]  # name, values, line


def write_plot(trial: Trial, path: Path) -> None:
    """Draw the trial into an HTML file that needs nothing else."""
    figure = make_subplots(rows=2, cols=2, horizontal_spacing=0.08, vertical_spacing=0.1)
    rows, time_s, drive = trial.rig, trial.time_s, trial.drive
    torque: list[_Curve] = [
        ("arrives", rows[:, at.LOAD_TORQUE], MEASURED),
        ("wanted", trial.wanted_nm, PRESCRIBED),
    ]
    motor: list[_Curve] = [("motor torque", rows[:, at.MOTOR_TORQUE], MEASURED)]
    if drive:
        estimate, command = (
            np.multiply(1e-6, drive[name], dtype=np.float64)
            for name in ("estimated_load_torque_unm", "motor_torque_command_unm")
        )
        torque.append(("the drive's estimate", estimate, SIMULATED))
        motor.append(("asked for", command, PRESCRIBED))
    tension: list[_Curve] = [
        ("motor a", rows[:, at.MOTOR_TENSION_A], MEASURED),
        ("load a", rows[:, at.LOAD_TENSION_A], SIMULATED),
        ("motor b", rows[:, at.MOTOR_TENSION_B], PRESCRIBED),
        ("load b", rows[:, at.LOAD_TENSION_B], RESIDUAL),
    ]
    angle = rows[:, at.LOAD_ANGLE]
    panels = (
        (1, 1, time_s, "time (s)", "torque on the load (N m)", torque),
        (1, 2, angle, "load angle (rad)", "torque on the load (N m)", torque[:2]),
        (2, 1, time_s, "time (s)", "motor torque (N m)", motor),
        (2, 2, time_s, "time (s)", "tension (N)", tension),
    )
    for row, column, x, below, beside, curves in panels:
        for name, values, line in curves:
            draw(figure, (x, values), name, line, points=POINTS, row=row, col=column)
        figure.update_xaxes(title=below, row=row, col=column)
        figure.update_yaxes(title=beside, row=row, col=column)
    dress(figure, 900)
    title = f"rig {trial.render_rig.seed}, {trial.law.name}, {trial.task.name}"
    figure.update_layout(title=title)
    figure.write_html(path, include_plotlyjs=True)
