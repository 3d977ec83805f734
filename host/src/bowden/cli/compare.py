"""Compare recordings with the offline model: figures, and a report for the browser.

The model gets the two series that the mode names; the gap is in the first of the two that it
predicts (load torque, or motor torque in position-torque mode). Each recording starts virgin;
--settle is for a rig whose cables hold tension from earlier.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.data_gate import admit_data
from bowden.cli.figure_arguments import (
    add_figures_arguments,
    refuse_missing_forms,
    write_figure_files,
)
from bowden.cli.model_arguments import (
    add_mode_argument,
    add_model_argument,
    add_settle_argument,
    mode_of,
    read_model,
    settle_of,
)
from bowden.cli.output import add_json_argument, console, print_json, stages

if TYPE_CHECKING:
    from bowden.diagnosis.compare import Comparison
    from bowden.model import Mode

EXAMPLES = """examples:
  bowden compare table_1.yaml run.blf --report report.html
  bowden compare table_1.yaml one.csv two.csv --json > gap.json
  bowden compare table_1.yaml run.blf --figures figures --figure-form pdf
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recordings, or one session file"
    )
    add_mode_argument(parser)
    add_settle_argument(parser)
    add_json_argument(parser)
    parser.add_argument(
        "--report", metavar="OUT.html", type=Path, help="write a report that opens anywhere"
    )
    add_figures_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Compare, write the report, print figures."""
    from bowden.recording.atomic import refuse_unwritable  # noqa: PLC0415  (keeps --help fast)

    refuse_missing_forms(args)
    refuse_unwritable([args.report], args.recordings)
    settle_s = settle_of(args)
    comparison = compare_files(args.model, args.recordings, mode_of(args), args.report, settle_s)
    show(comparison, args.report)
    for path in write_figure_files(comparison, args):
        console().print(f"figure: {path}", soft_wrap=True)
    if args.json:
        print_json(comparison.to_document())
    return 0


def compare_files(
    model: Path,
    recordings: Sequence[Path],
    mode: Mode,
    report: Path | None = None,
    settle_s: float = 0.0,
) -> Comparison:
    """Compare recordings with a model, file by file, and write the report where one is wanted."""
    from bowden.diagnosis.compare import compare  # noqa: PLC0415  (keeps --help fast)
    from bowden.recording.session import read_recordings  # noqa: PLC0415

    session = read_recordings(recordings).since(settle_s)
    described = read_model(model)
    admit_data(described, session.recordings, mode)
    with stages("comparing") as tell:
        comparison = compare(
            described, session.recordings, mode, zeros=session.groups["zeros"], progress=tell
        )
    if report:
        write_report(comparison, model, report)
    return comparison


def write_report(comparison: Comparison, model: Path, report: Path) -> None:
    """Write the comparison's page, whole or not at all."""
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415  (keeps --help fast)
    from bowden.report.comparison import comparison_report  # noqa: PLC0415

    html = comparison_report(comparison, {"model file": str(model)})
    with replace_whole(report) as temporary:
        temporary.write_text(html, encoding="utf-8")


def show(comparison: Comparison, report: Path | None = None) -> None:
    """Print the result to stderr."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415  (keeps --help fast)

    from bowden.report.words import constants, percent, si, verdict, whereabouts  # noqa: PLC0415

    table = Table("recording", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("gap (RMS)", "of peak", "first cycle", "later", "noise", "lost"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in comparison.recordings:
        figures = one.figures
        table.add_row(
            Path(one.recording.source).name,
            si(figures.gap, "N m"),
            percent(figures.relative_gap),
            si(figures.first_cycle, "N m"),
            si(figures.steady, "N m"),
            si(figures.noise_floor, "N m"),
            one.recording.metadata.get("frames_lost", "–"),
        )
    out = console()
    out.print(table)
    for sentence in (verdict(comparison), constants(comparison), whereabouts(comparison)):
        if sentence:
            out.print(sentence, soft_wrap=True)
    if report:
        out.print(f"report: {report}", soft_wrap=True)
