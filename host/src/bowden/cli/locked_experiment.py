"""Experiment 1 on a drive: the load locked, the motor's torque ramped up and down (Figs. 3 and 4).

`experiment 1a --on-drive` calls it. One recording for each pretension: on a connected rig you set
it and name it with --pretension; a simulated rig of its own (--start-rig) is set by itself. Beside
each measured run stands the model, driven by the torque that was measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bowden.cli.drive_arguments import connect_drive
from bowden.cli.model_arguments import read_model
from bowden.cli.output import console, print_json, say
from bowden.cli.record import check_output, record_to
from bowden.drive.bus_options import bus_options
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.simulated_rig import own_rig
from bowden.drive.torque_profile import TorqueProfile
from bowden.errors import BadInput
from bowden.model import Inputs, Mode, Model, simulate, table_1
from bowden.model.experiments.locked_load import DWELL_S, PEAK_TORQUE_NM, SLOPE_NM_PER_S
from bowden.model.experiments.signals import ramp_period_s, ramps_with_dwells, sample_times
from bowden.model.experiments.variants import with_pretension
from bowden.recording.enabled import enabled
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording

CYCLES = 2
#: With these, torque arrives at the locked load of Table I (Experiment 1a, preset transmitting).
PRETENSIONS_N = (1.0, 1.5, 2.0)
#: A load that moves by more is not locked.
LOCKED_RAD = 0.02
_PROFILE_RATE_HZ = 100.0


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


def run_locked_on_drive(args: argparse.Namespace) -> int:
    """Record every pretension, print measured beside simulated."""
    if args.pretension and min(args.pretension) <= 0:
        raise BadInput("--pretension", f"{min(args.pretension):g}", "N, more than 0")
    directory: Path = args.output
    directory.mkdir(parents=True, exist_ok=True)
    model = read_model(args.model) if args.model else table_1()
    pretensions = args.pretension or (PRETENSIONS_N if args.start_rig else [None])
    period_s = ramp_period_s(PEAK_TORQUE_NM, SLOPE_NM_PER_S, DWELL_S)
    time_s = sample_times(CYCLES * period_s, _PROFILE_RATE_HZ)
    torque = ramps_with_dwells(time_s, PEAK_TORQUE_NM, SLOPE_NM_PER_S, DWELL_S)
    profile = TorqueProfile(time_s, torque, f"experiment {args.experiment}")
    runs = []
    for pretension in pretensions:
        of_run = model if pretension is None else with_pretension(model, pretension)
        label = "as it is" if pretension is None else f"{pretension:g} N"
        path = directory / f"locked_{label.replace(' ', '_')}.blf"
        check_output(path, overwrite=False)
        with _drive(args, directory, pretension) as drive:
            if not args.start_rig:
                say(f"pretension {label}: lock the load; the motor ramps to {PEAK_TORQUE_NM} N m")
            notes = {"notes": f"Experiment {args.experiment}, pretension {label}"}
            job = Run(ModeOfOperation.TORQUE, profile=profile)
            record_to(drive, path, profile.duration_s, job, notes)
        runs.append(judge_locked_run(read_recording(path), of_run, period_s, label, path.name))
    _show(runs)
    if args.json:
        print_json({"experiment": args.experiment, "runs": [_document(run) for run in runs]})
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
    pair = model.transmission
    return LockedRun(
        label=label,
        file=file,
        motor_pp_nm=float(np.ptp(run.motor_torque_nm[last])),
        load_pp_nm=float(np.ptp(run.load_torque_nm[last])),
        model_load_pp_nm=float(np.ptp(simulated[last])),
        gap_nm=float(np.sqrt(np.mean((run.load_torque_nm - simulated) ** 2))),
        ratio=pair.load_pulley_radius_m / pair.motor_pulley_radius_m,
    )


@contextmanager
def _drive(
    args: argparse.Namespace, directory: Path, pretension_n: float | None
) -> Iterator[Drive]:
    if not args.start_rig:
        with connect_drive(args) as drive:
            yield drive
        return
    arguments = ["--target", args.target, "--seed", str(args.seed), "--operator", "locked"]
    settings = [*([] if pretension_n is None else [f"cable.pretension_n={pretension_n:g}"])]
    for setting in [*settings, *args.set]:
        arguments += ["--set", setting]
    say("starting the simulated rig in a process of its own")
    with own_rig(bus_options(args), arguments, directory / "rig.log") as drive:
        yield drive


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

    table = Table("pretension", "motor", "load", "model's load", "efficiency", "gap RMS")
    for run in runs:
        torques = (run.motor_pp_nm, run.load_pp_nm, run.model_load_pp_nm)
        shown = [f"{1e3 * torque:.1f}" for torque in torques]
        table.add_row(run.label, *shown, f"{run.efficiency:.1%}", f"{1e3 * run.gap_nm:.1f}")
    out = console()
    out.print(table)
    out.print("torques peak to peak over the last cycle, and the gap to the model, in mN m")
    for run in runs:
        out.print(f"{run.label}: {run.file}", markup=False)
