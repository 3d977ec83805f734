"""A picture of one trial: torque over time and over angle, motor torque, tensions."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from hil_tests.render.trial import Trial
from hil_tests.rig import state as at

mpl.use("Agg")


def write_plot(trial: Trial, path: Path) -> None:
    """Draw the trial into a file whose name ends in .png, .svg or .pdf."""
    figure = Figure(figsize=(12, 9), layout="constrained")
    rows, time_s = trial.rig, trial.time_s
    ((torque, loop), (motor, tension)) = figure.subplots(2, 2)
    figure.suptitle(f"rig {trial.render_rig.seed}, {trial.law.name}, {trial.task.name}")
    for axes, x in ((torque, time_s), (loop, rows[:, at.LOAD_ANGLE])):
        axes.plot(x, rows[:, at.LOAD_TORQUE], label="arrives", linewidth=0.8)
        axes.plot(x, trial.wanted_nm, label="wanted", linewidth=1.2)
        axes.set_ylabel("torque on the load (N m)")
    if trial.drive:
        estimate = 1e-6 * trial.drive["estimated_load_torque_unm"]
        torque.plot(time_s, estimate, label="the drive's estimate", linewidth=0.6)
        command = 1e-6 * trial.drive["motor_torque_command_unm"]
        motor.plot(time_s, command, label="motor torque asked for", linewidth=0.6)
    torque.set_xlabel("time (s)")
    loop.set_xlabel("load angle (rad)")
    motor.plot(time_s, rows[:, at.MOTOR_TORQUE], label="motor torque", linewidth=0.6)
    motor.set_ylabel("torque (N m)")
    motor.set_xlabel("time (s)")
    for name, place in (
        ("motor a", at.MOTOR_TENSION_A),
        ("load a", at.LOAD_TENSION_A),
        ("motor b", at.MOTOR_TENSION_B),
        ("load b", at.LOAD_TENSION_B),
    ):
        tension.plot(time_s, rows[:, place], label=name, linewidth=0.8)
    tension.set_ylabel("tension (N)")
    tension.set_xlabel("time (s)")
    for axes in (torque, loop, motor, tension):
        axes.grid(visible=True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
