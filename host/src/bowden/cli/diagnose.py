"""Name the effect that a model lacks to explain recordings, or report that none is missing.

Sets of effects are fitted together with the numbers that the model file gives a tolerance, and
compared by how well they predict stretches that their fit has not seen. The verdict is
named, complete, unlisted (something that no catalogue entry explains), ambiguous,
insufficient_excitation, or bad_data: the data gate found units, signs or sensors wrong, nothing was
fitted, no model is written, and the exit status is 2. The same seed gives the same answer.

With --each every recording (or session) is diagnosed by itself, several at the same time on the
cores of this machine or on a Dask cluster. One table shows all; those that cannot be diagnosed are
reported in their rows, and the exit status is then 2.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.diagnose_each import diagnose_each, recordings_to_judge
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
from bowden.cli.output import add_json_argument, console, print_json, stages, styled
from bowden.cli.parallel import add_scheduler_argument
from bowden.digits import interval
from bowden.errors import BadInput

if TYPE_CHECKING:
    from bowden.diagnosis.result import Diagnosis

EXAMPLES = """examples:
  bowden diagnose rig.yaml run.csv --report diagnosis.html
  bowden diagnose rig.yaml one.blf two.blf --write-model extended.yaml --json > diagnosis.json
  bowden diagnose --each rig.yaml day_*.csv --report pages --json > diagnoses.json
"""

_RANKED = 6
_LEAST_SHOWN = 0.01  # of probability


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recordings, or one session file"
    )
    parser.add_argument(
        "--each", action="store_true", help="diagnose each recording or session file by itself"
    )
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="with --each: so many at the same time (default: all)"
    )
    add_scheduler_argument(parser)
    add_mode_argument(parser)
    add_settle_argument(parser)
    parser.add_argument(
        "--report",
        metavar="OUT.html",
        type=Path,
        help="write a report that opens anywhere; with --each a folder of them, and index.html",
    )
    parser.add_argument(
        "--write-model", metavar="OUT.yaml", type=Path, help="write the model with its effects"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="0 or more (default: 0)")
    parser.add_argument(
        "--time-limit",
        type=float,
        default=float("inf"),
        metavar="SECONDS",
        help="fit no further set of effects or law after that time; the best so far is reported",
    )
    add_figures_arguments(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Diagnose, write model and report, print the verdict."""
    from bowden.diagnosis.diagnose import diagnose  # noqa: PLC0415  (keeps --help fast)
    from bowden.recording.atomic import refuse_unwritable  # noqa: PLC0415

    _check(args)
    refuse_missing_forms(args)
    refuse_unwritable([args.write_model, args.report], args.recordings)
    model = read_model(args.model)
    if args.each:
        return diagnose_each(args)
    recordings = recordings_to_judge(args.recordings, settle_of(args))
    with stages("diagnosing") as tell:
        diagnosis = diagnose(
            model,
            recordings,
            mode_of(args),
            seed=args.seed,
            time_limit_s=args.time_limit,
            progress=tell,
        )
    trusted = diagnosis.verdict != "bad_data"
    show(diagnosis)  # first: a disk that is full now does not hide minutes of work
    if args.write_model and trusted:
        write_extended(diagnosis, args.write_model, [path.name for path in args.recordings])
    if args.report:
        write_report(diagnosis, args.report, str(args.model))
    for name, path in (("model", args.write_model if trusted else None), ("report", args.report)):
        if path:
            console().print(f"{name}: {path}", soft_wrap=True)
    for path in write_figure_files(diagnosis, args):
        console().print(f"figure: {path}", soft_wrap=True)
    if args.json:
        written = str(args.write_model) if args.write_model and trusted else None
        print_json(diagnosis.to_document() | {"model": written})
    return 0 if trusted else 2


def _check(args: argparse.Namespace) -> None:
    if args.seed < 0:
        raise BadInput("--seed", str(args.seed), "0 or more")
    if not args.time_limit > 0.0:
        raise BadInput("--time-limit", f"{args.time_limit:g} s", "more than 0 s")
    if args.jobs is not None and args.jobs < 1:
        raise BadInput("--jobs", str(args.jobs), "1 or more")
    for name in ("jobs", "scheduler"):
        if getattr(args, name) is not None and not args.each:
            raise BadInput(f"--{name}", "no --each", "--each, which it is for")
    for name in ("write_model", "figures"):
        if getattr(args, name) is not None and args.each:
            option = f"--{name.replace('_', '-')}"
            raise BadInput(option, "--each", "one diagnosis; with --each the pages hold both")


def write_extended(diagnosis: Diagnosis, path: Path, recordings: list[str]) -> None:
    """Write the calibrated model with its effects, and where they come from."""
    from bowden.model import format_model  # noqa: PLC0415
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415

    gap = diagnosis.gap
    provenance = (
        f"# bowden diagnose: {diagnosis.verdict}; recordings {', '.join(recordings)}; "
        f"seed {diagnosis.seed}\n"
        f"# {gap.quantity}, {gap.metric}: {gap.before:.4g} before, {gap.after:.4g} after, "
        f"noise floor {gap.noise_floor:.4g}\n"
    )
    with replace_whole(path) as temporary:
        temporary.write_text(provenance + format_model(diagnosis.model), encoding="utf-8")


def write_report(diagnosis: Diagnosis, path: Path, model: str) -> None:
    """Write the page."""
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415
    from bowden.report.diagnosis import diagnosis_report  # noqa: PLC0415

    html = diagnosis_report(diagnosis, {"model file": model})
    with replace_whole(path) as temporary:
        temporary.write_text(html, encoding="utf-8")


def show(diagnosis: Diagnosis) -> None:
    """Print the result to stderr."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    from bowden.diagnosis.wording import place_in_words  # noqa: PLC0415
    from bowden.model.effects import LEARNED  # noqa: PLC0415

    out = console()
    verdict = diagnosis.verdict.replace("_", " ")
    out.print(styled((verdict, "bold"), f": {diagnosis.sentence}"))
    for one in diagnosis.effects:
        for name, value in one.parameters.items():
            out.print(
                f"  {one.name}.{name} = {value.value:.4g} {value.unit} "
                f"({interval(value.low, value.high)}), confidence {one.confidence:.2f}"
            )
    for finding in diagnosis.quality:
        out.print(f"{finding.severity}: {finding.text}")
    odds = [
        f"{name} {100 * share:.0f} %"
        for name, share in diagnosis.odds.items()
        if share >= _LEAST_SHOWN
    ]
    if odds:
        out.print(f"odds: {', '.join(odds)}", soft_wrap=True)
    if diagnosis.validation:
        out.print(f"validation: {diagnosis.validation.text}", soft_wrap=True)
    if diagnosis.ranking:
        table = Table("candidate", box=box.SIMPLE_HEAD, pad_edge=False)
        for name in ("gain", "held-out gap"):
            table.add_column(name, justify="right", no_wrap=True)
        for ranked in diagnosis.ranking[:_RANKED]:
            where = ranked.variant
            if ranked.name == LEARNED:
                where = place_in_words(where)
            place = f" ({where})" if where else ""
            table.add_row(
                f"{ranked.name}{place}", f"{ranked.score:.1f}", f"{ranked.held_out_gap:.3g}"
            )
        out.print(table)
    if diagnosis.next_experiment:
        out.print(f"next: {diagnosis.next_experiment}")
