"""The second part of `bowden demo-diagnosis`: a law that no catalogue has is learned and applied.

A liner whose pile leans, more the further the load is turned, makes friction that rises with load
angle one way and falls the other. The drive has no help from the load cell: what it renders
depends on its model. One round of `bowden improve` learns the law from a run without compensation
and writes it into the drive's tables. The page shows the tunnel rendered with the lab's model and
with that, and draws the hidden law over the learned one.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bowden.cli.demo_diagnosis import ENTRIES, LAB_MODEL, RIG
from bowden.cli.improve_bench import REPORT_FILE, DriveBench
from bowden.cli.improve_rounds import STATE_FILE, Improvement, improve
from bowden.cli.output import console, say, styled
from bowden.cli.own_rig_arguments import start_own_rig
from bowden.cli.tunnel_experiment import SETTLE_S, TORQUE_CONSTANT_NM_PER_A, tunnel_of
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import CompensationLaw
from bowden.model import parse_model
from bowden.recording.atomic import replace_whole
from bowden.report.improvement import Step, improvement_report
from bowden.report.learned_law import HiddenLaw
from bowden.report.rendering import LawRun

#: mu (1 + b) outward, mu (1 - b) back, b = CHANGE tanh(load angle / WIDTH_RAD).
CHANGE, WIDTH_RAD = 0.4, 0.3
_STROKE_RAD = np.linspace(-0.7, 0.7, 141)


def learn_a_law(args: argparse.Namespace, folder: Path) -> dict[str, object]:
    """Hide the law in a rig of its own, learn it, apply it, render again, write the page."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / STATE_FILE).unlink(missing_ok=True)  # a demonstration begins anew
    # Strokes of one length would not tell a law of the angle from one of the time since reversal.
    settings = (
        *RIG,
        "operator.second_share=0.4",
        f"cable.pile_change={CHANGE}",
        f"cable.pile_width_rad={WIDTH_RAD}",
    )
    say("second part: friction of a kind that no catalogue has; the drive without its load cell")
    with start_own_rig(args, folder, settings) as drive:
        before, found, after = close_the_loop(drive, folder, args.duration, args.seed)
        tunnel = tunnel_of(drive)
    errors = [before.figures.rms_error_nm, after.figures.rms_error_nm]
    left_out = found.state.rounds[-1].left_out
    told = f" The drive runs without {', '.join(left_out)}." if left_out else ""
    finding = (
        f"{found.diagnoses[0].sentence}{told} The rendered torque was {1e3 * errors[0]:.3g} mN m "
        f"RMS from the wanted one before, {1e3 * errors[1]:.3g} mN m with what the drive took of "
        "the model."
    )
    hidden = HiddenLaw(
        "friction_factor",
        ("load_angle_rad", "slip_direction"),
        _STROKE_RAD,
        CHANGE * np.tanh(_STROKE_RAD / WIDTH_RAD),
    )
    steps = [Step(before, found.diagnoses[0]), Step(after)]
    page = improvement_report(
        steps, tunnel, SETTLE_S, rig="the simulated rig", finding=finding, hidden=hidden
    )
    with replace_whole(folder / REPORT_FILE) as temporary:
        temporary.write_text(page, encoding="utf-8")
    console().print(finding)
    shown = styled((f"{'the law':<10}", "bold"), str((folder / REPORT_FILE).resolve()))
    console().print(shown, soft_wrap=True)
    return {
        "diagnosis": found.diagnoses[0].to_document(),
        "left_out": list(left_out),
        "rendering_error_nm": {"lab_model": errors[0], "learned_law": errors[1]},
        "report": str(folder / REPORT_FILE),
    }


def close_the_loop(
    drive: Drive, folder: Path, duration_s: float, seed: int
) -> tuple[LawRun, Improvement, LawRun]:
    """Render with the lab's model, learn from a run without compensation, apply, render again.

    A compensated motor stays at breakaway, where a percent of friction decides whether it moves.

    Parameters
    ----------
    drive : Drive
        On a rig whose operator moves while the drive runs.
    folder : Path
    duration_s : float, s
        Of each run.
    seed : int
    """
    drive.write("torque_constant", TORQUE_CONSTANT_NM_PER_A)
    write(drive, difference(drive, ENTRIES | {"compensation_use_load_cell": 0}))
    inverting = DriveBench(drive, CompensationLaw.MODEL_INVERSION, duration_s, seed)
    inverting.apply(parse_model(LAB_MODEL, "lab.yaml"))
    before = inverting.record(1, folder / "before.blf")
    plain = DriveBench(drive, CompensationLaw.NONE, duration_s, seed)
    found = improve(plain, LAB_MODEL, "lab.yaml", folder, 1, tell=say)
    write(drive, difference(drive, {"compensation_law": CompensationLaw.MODEL_INVERSION}))
    return before, found, inverting.record(2, folder / "after.blf")
