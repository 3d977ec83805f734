"""Experiment 1 on a drive: the load locked, the motor's torque ramped up and down (Figs. 3 and 4).

`experiment 1a|1b --on-drive` calls it. One recording for each pretension (1a) or number of loops
(1b): on a connected rig you set it and name it with --pretension or --loops; a simulated rig of its
own (--start-rig) is set by itself. Beside each measured run stands the model, driven by the torque
that was measured.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bowden.cli.measured_experiment import while_enabled, write_measured_report
from bowden.cli.model_arguments import read_model
from bowden.cli.output import console, print_json, say
from bowden.cli.own_rig_arguments import drive_or_own_rig
from bowden.cli.record import check_output, record_to
from bowden.drive.live_experiment import CYCLES, ramps_profile
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.errors import BadInput
from bowden.model import Inputs, Mode, Model, simulate, table_1
from bowden.model.experiments.locked_load import DWELL_S, PEAK_TORQUE_NM, SLOPE_NM_PER_S
from bowden.model.experiments.signals import ramp_period_s
from bowden.model.experiments.variants import with_loops, with_pretension
from bowden.recording.enabled import enabled
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden.report.measured_experiment import MeasuredRun

#: With these, torque arrives at the locked load of Table I (Experiment 1a, preset transmitting).
PRETENSIONS_N = (1.0, 1.5, 2.0)
#: The same in Experiment 1b, also with three loops.
LOOPS_PRETENSION_N = 0.6
#: Of the simulated rig's own path, 2 m at 0.28 m.
RIG_WRAP_RAD = 2.0 / 0.28
#: A load that moves by more is not locked.
LOCKED_RAD = 0.02


@dataclass(frozen=True)
class LockedRun:
    """One run: torques peak to peak over the last cycle, N m, and the model's for the same input.

    `gap_nm` is the RMS of measured minus simulated load torque over the whole run.
    """

    label: str
    file: str
    motor_pp_nm: float
    load_pp_nm: float
    model_load_pp_nm: float
    gap_nm: float
    ratio: float

    @property
    def efficiency(self) -> float:
        """Share of the lossless torque that arrives."""
        return self.load_pp_nm / (self.ratio * self.motor_pp_nm)


@dataclass(frozen=True)
class Setup:
    """How the rig is set for a run; None: as it is, or as the model file says."""

    pretension_n: float | None
    loops: int | None

    @property
    def label(self) -> str:
        """For files, table and page."""
        if self.loops is not None:
            return f"{self.loops} loop{'s' if self.loops > 1 else ''}"
        return "as it is" if self.pretension_n is None else f"{self.pretension_n:g} N"

    def of_model(self, model: Model) -> Model:
        """Return the model of a rig that is set so."""
        if self.loops is not None:
            model = with_loops(model, self.loops)
        return model if self.pretension_n is None else with_pretension(model, self.pretension_n)

    def of_rig(self) -> list[str]:
        """Return what sets the simulated rig so; its path has a wrap of its own to begin with."""
        settings = []
        if self.loops is not None:
            more = 2.0 * math.pi * self.loops - RIG_WRAP_RAD
            settings.append(f"cable.extra_wrap_rad={more:.9g}")
        if self.pretension_n is not None:
            settings.append(f"cable.pretension_n={self.pretension_n:g}")
        return settings


def _setups(args: argparse.Namespace) -> list[Setup]:
    given = args.pretension
    if args.experiment == "1b":
        pretension = given[0] if given else LOOPS_PRETENSION_N if args.start_rig else None
        loops = args.loops or ((1, 2, 3) if args.start_rig else (None,))
        return [Setup(pretension, number) for number in loops]
    return [Setup(one, None) for one in given or (PRETENSIONS_N if args.start_rig else [None])]


def run_locked_on_drive(args: argparse.Namespace) -> int:
    """Record every pretension, print measured beside simulated."""
    if args.pretension and min(args.pretension) <= 0:
        raise BadInput("--pretension", f"{min(args.pretension):g}", "N, more than 0")
    if args.loops and min(args.loops) < 1:
        raise BadInput("--loops", f"{min(args.loops)}", "1 or more")
    directory: Path = args.output
    directory.mkdir(parents=True, exist_ok=True)
    model = read_model(args.model) if args.model else table_1()
    period_s = ramp_period_s(PEAK_TORQUE_NM, SLOPE_NM_PER_S, DWELL_S)
    title = f"experiment {args.experiment}"
    profile = ramps_profile(PEAK_TORQUE_NM, SLOPE_NM_PER_S, CYCLES, title)
    runs, measured = [], []
    for setup in _setups(args):
        of_run, label = setup.of_model(model), setup.label
        path = directory / f"locked_{label.replace(' ', '_')}.blf"
        check_output(path, overwrite=False, accepted="another --output, or move it away")
        locked = ("--operator", "locked")
        with drive_or_own_rig(args, directory, setup.of_rig(), locked) as drive:
            if not args.start_rig:
                say(f"{label}: lock the load; the motor ramps to {PEAK_TORQUE_NM} N m")
            notes = {"notes": f"Experiment {args.experiment}, {label}"}
            job = Run(ModeOfOperation.TORQUE, profile=profile)
            record_to(drive, path, profile.duration_s, job, notes)
        recording = read_recording(path)
        runs.append(judge_locked_run(recording, of_run, period_s, label, path.name))
        measured.append(MeasuredRun(label, while_enabled(recording), of_run))
    report = write_measured_report(args, measured, directory)
    _show(runs)
    if args.json:
        print_json(
            {
                "experiment": args.experiment,
                "runs": [_document(run) for run in runs],
                "report": str(report),
            }
        )
    return 0


def judge_locked_run(
    recording: Recording, model: Model, period_s: float, label: str = "", file: str = ""
) -> LockedRun:
    """Compare one run with the model.

    Raises
    ------
    BadInput
        The load was not locked, or the drive not enabled for a cycle.
    """
    on = enabled(recording)
    run = recording if on is None else recording.select(on)
    if run.time_s.size < 2 or run.time_s[-1] - run.time_s[0] < period_s:
        raise BadInput(recording.source, "less than a cycle with the drive enabled", "a whole run")
    moved = float(np.ptp(run.load_angle_rad))
    if moved > LOCKED_RAD:
        raise BadInput(recording.source, f"a load that moved by {moved:.3f} rad", "a locked load")
    inputs = Inputs(
        run.time_s, motor_torque_nm=run.motor_torque_nm, load_angle_rad=run.load_angle_rad
    )
    simulated = simulate(model, Mode.TORQUE_POSITION, inputs).load_torque_nm
    last = run.time_s >= run.time_s[-1] - period_s
    return LockedRun(
        label=label,
        file=file,
        motor_pp_nm=float(np.ptp(run.motor_torque_nm[last])),
        load_pp_nm=float(np.ptp(run.load_torque_nm[last])),
        model_load_pp_nm=float(np.ptp(simulated[last])),
        gap_nm=float(np.sqrt(np.mean((run.load_torque_nm - simulated) ** 2))),
        ratio=model.transmission.pulley_ratio,
    )


def _document(run: LockedRun) -> dict[str, object]:
    return {
        "label": run.label,
        "recording": run.file,
        "motor_torque_pp_nm": run.motor_pp_nm,
        "load_torque_pp_nm": run.load_pp_nm,
        "model_load_torque_pp_nm": run.model_load_pp_nm,
        "efficiency": run.efficiency,
        "gap_nm": run.gap_nm,
    }


def _show(runs: list[LockedRun]) -> None:
    from rich.table import Table  # noqa: PLC0415  (as in experiment)

    table = Table("rig", "motor", "load", "model's load", "efficiency", "gap RMS")
    for run in runs:
        torques = (run.motor_pp_nm, run.load_pp_nm, run.model_load_pp_nm)
        shown = [f"{1e3 * torque:.1f}" for torque in torques]
        table.add_row(run.label, *shown, f"{run.efficiency:.1%}", f"{1e3 * run.gap_nm:.1f}")
    out = console()
    out.print(table)
    out.print("torques peak to peak over the last cycle, and the gap to the model, in mN m")
    for run in runs:
        out.print(f"{run.label}: {run.file}")
