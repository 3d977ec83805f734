"""Experiment 2 on a drive, law by law: same tunnel, same motion, each compensation in turn.

`experiment tunnel --compensation ...` calls it. The drive is left as it was found, but for the
model if one was given. Without compensation always comes first: the others are measured against it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bowden.cli.model_arguments import read_model
from bowden.cli.output import console, print_json, say
from bowden.cli.own_rig_arguments import drive_or_own_rig
from bowden.cli.record import record_to
from bowden.diagnosis.rendering import PrescribedTunnel, judge_rendering
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import CompensationLaw, ModeOfOperation, TunnelAngleSource
from bowden.drive.power import Run
from bowden.drive.reduced_model import reduced_model
from bowden.errors import BadInput
from bowden.model import Model, table_1
from bowden.recording.atomic import replace_whole
from bowden.recording.read import read_recording
from bowden.report.rendering import LawRun, figures_table, finding, rendering_report
from bowden.report.words import percent

#: Every law, for --compensation.
ALL = "all"

#: At the start of a run the strokes grow to full amplitude and erase the earlier tension profile.
SETTLE_S = 3.0
_REST_S = 2.0

#: A rig of our own is Table I with half of its pretension and a stronger motor: to bring the whole
#: tunnel to the load, 0.2 N m times the ratio, the last taut cable takes 0.2 exp(m) = 0.9 N m.
_PRETENSION_N = 5.0
TORQUE_CONSTANT_NM_PER_A = 0.1
TORQUE_LIMIT_NM = 1.1
_COLUMNS = 5  # of the table, in a terminal; the page has all
_PDO_DOES_NOT_EXIST = 1 << 31


def run_on_drive(args: argparse.Namespace) -> int:
    """Run the laws, write recordings and report, print the figures."""
    laws = chosen_laws(args.compensation)
    if not args.duration > SETTLE_S:
        raise BadInput("--duration", f"{args.duration:g}", f"seconds, more than {SETTLE_S:g}")
    directory: Path = args.output
    directory.mkdir(parents=True, exist_ok=True)
    model = read_model(args.model) if args.model else None
    with _drive(args, directory) as drive:
        entries = _entries(args, model)
        write(drive, difference(drive, entries))
        tunnel = tunnel_of(drive)
        with telling_the_law(drive), _law_put_back(drive):
            runs = [_run(args, drive, law, tunnel, directory) for law in laws]
    rig = "the simulated rig" if args.start_rig else "the connected rig"
    report: Path = args.report or directory / "report.html"
    with replace_whole(report) as temporary:
        temporary.write_text(rendering_report(runs, tunnel, SETTLE_S, rig), encoding="utf-8")
    show_figures(runs)
    console().print(f"report: {report}", soft_wrap=True)
    if args.json:
        print_json(_document(runs, rig, report))
    return 0


def chosen_laws(names: Sequence[str]) -> list[str]:
    """Return the laws to run, ``none`` first."""
    laws = CompensationLaw.words()
    wanted = laws if ALL in names else (CompensationLaw.NONE.word, *names)
    return [law for law in laws if law in wanted]


@contextmanager
def _drive(args: argparse.Namespace, directory: Path) -> Iterator[Drive]:
    settings = [
        f"cable.pretension_n={_PRETENSION_N:g}",
        f"motor.torque_constant_nm_per_a={TORQUE_CONSTANT_NM_PER_A:g}",
    ]
    with drive_or_own_rig(args, directory, settings) as drive:
        if args.start_rig:
            drive.write("torque_constant", TORQUE_CONSTANT_NM_PER_A)
        yield drive


def _entries(args: argparse.Namespace, model: Model | None) -> dict[str, float]:
    """Return what the drive is to have: the model that was given; on our own rig, that rig's."""
    if model is not None:
        entries = dict(reduced_model(model).entries)
    elif args.start_rig:
        model = table_1().with_values({"rig.cable.pretension_n": _PRETENSION_N})
        entries = dict(reduced_model(model).entries)
        entries["friction_static"] = entries["friction_dynamic"]  # as in a lined conduit
    else:
        entries = {}
    return entries | ({"motor_torque_limit": TORQUE_LIMIT_NM} if args.start_rig else {})


def tunnel_of(drive: Drive) -> PrescribedTunnel:
    """Read the tunnel that the drive renders; it must look at the load's angle."""
    if drive.read_raw("tunnel_angle_source") != TunnelAngleSource.LOAD:
        raise BadInput(
            "tunnel_angle_source",
            "the motor's angle",
            "the load's (bowden configure, --tunnel-angle)",
        )
    return PrescribedTunnel(
        half_width_rad=drive.read("tunnel_half_width"),
        stiffness_nm_per_rad=drive.read("tunnel_stiffness"),
        torque_limit_nm=drive.read("tunnel_torque_limit"),
        ratio=drive.read("load_pulley_radius") / drive.read("motor_pulley_radius"),
    )


@contextmanager
def telling_the_law(drive: Drive) -> Iterator[None]:
    """Have the fourth TPDO sent inside the block: wanted and estimated torque, the law that ran."""
    name = "tpdo4_communication.cob_id"
    before = drive.read_raw(name)
    drive.nmt("PRE-OPERATIONAL")
    drive.write_raw(name, before & ~_PDO_DOES_NOT_EXIST)
    try:
        yield
    finally:
        drive.write_raw(name, before)


@contextmanager
def _law_put_back(drive: Drive) -> Iterator[None]:
    before = drive.read_raw("compensation_law")
    try:
        yield
    finally:
        drive.write_raw("compensation_law", before)


def _run(
    args: argparse.Namespace, drive: Drive, law: str, tunnel: PrescribedTunnel, directory: Path
) -> LawRun:
    drive.write_raw("compensation_law", CompensationLaw.named(law, "--compensation"))
    if not args.start_rig:
        say(f"{law}: move the load through the tunnel, always alike")
    return render(drive, tunnel, args.duration, directory / f"{law}.blf")


def render(
    drive: Drive,
    tunnel: PrescribedTunnel,
    duration_s: float,
    path: Path,
    title: str = "",
    *,
    overwrite: bool = False,
) -> LawRun:
    """Record the tunnel with the law that the drive has, and judge it.

    Parameters
    ----------
    drive : Drive
    tunnel : PrescribedTunnel
    duration_s : float, s
    path : Path
        Of the recording.
    title : str, optional
        For table and page, where the law's name does not say enough.
    overwrite : bool
        Replace a recording that was broken off.
    """
    law = CompensationLaw(drive.read_raw("compensation_law"))
    drive.connection.listen(_REST_S)  # the operator comes to a standstill
    notes = {"notes": f"Experiment 2 with compensation: {law.word}"}
    record_to(drive, path, duration_s, Run(ModeOfOperation.TUNNEL), notes, overwrite=overwrite)
    recording = read_recording(path)
    figures = judge_rendering(recording, tunnel, law, SETTLE_S)
    return LawRun(law.word, recording, figures, path.name, title or law.doc)


def _document(runs: Sequence[LawRun], rig: str, report: Path) -> dict[str, object]:
    naive = runs[0].figures.rms_error_nm
    return {
        "experiment": "tunnel",
        "rig": rig,
        "laws": [
            {
                "law": run.law,
                "rms_error_nm": run.figures.rms_error_nm,
                "peak_error_nm": run.figures.peak_error_nm,
                "ratio_to_none": run.figures.rms_error_nm / naive if naive else None,
                "dead_zone_friction_nm": run.figures.dead_zone_friction_nm,
                "loss_w": run.figures.loss_w,
                "full_law_share": run.figures.full_law_share,
                "recording": run.file,
            }
            for run in runs
        ],
        "finding": finding(runs),
        "report": str(report),
    }


def show_figures(runs: Sequence[LawRun]) -> None:
    """Print the table and what it says."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415  (as in experiment)

    header, rows = figures_table(runs)
    shown = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    shown.add_column(header[0], min_width=max(len(law.doc) for law in CompensationLaw))
    for name in header[1:_COLUMNS]:
        shown.add_column(name, justify="right")
    for law, *figures in rows:
        whole = (text.replace(" ", "\N{NO-BREAK SPACE}") for text in figures[: _COLUMNS - 1])
        shown.add_row(law, *whole)
    out = console()
    out.print(shown)
    for run in runs:
        if run.figures.full_law_share < 1.0:
            out.print(f"{run.title} ran {percent(run.figures.full_law_share)} of the time only")
    out.print(finding(runs))
