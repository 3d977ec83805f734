"""`bowden diagnose --each`: many recordings, each diagnosed by itself, several at the same time.

`diagnose` calls `diagnose_each`; `parallel` runs `diagnose_one` in other processes or on a cluster.
The model's text and the recordings travel there, one `Outcome` each comes back.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.model_arguments import MODES, settle_of
from bowden.cli.output import console, print_json, stages
from bowden.cli.parallel import on_cluster, on_this_machine
from bowden.errors import BadInput

if TYPE_CHECKING:
    from bowden.recording.recording import Recording
    from bowden.report.diagnoses import DiagnosisRow

INDEX = "index.html"
_LOG_COLUMNS = 200


@dataclass(frozen=True)
class Settings:
    """What all diagnoses of a call have in common; plain, so that it travels.

    Parameters
    ----------
    model_file : str
    model : str
        Its text.
    effects_file : Path or None
        Effects of the user's own.
    mode : str
    seed : int
    time_limit_s : float
        Of each.
    pages : bool
        Whether each makes a page.
    """

    model_file: str
    model: str
    effects_file: Path | None = None
    mode: str = MODES[0]
    seed: int = 0
    time_limit_s: float = float("inf")
    pages: bool = False


@dataclass(frozen=True)
class Outcome:
    """One recording's row, its part of the JSON document, and its page.

    Parameters
    ----------
    number : int
        Which of the recordings, in the order of the command line.
    row : DiagnosisRow
    document : dict of str to object
    diagnosed : bool
        False with bad data or bad input.
    html : str or None
    """

    number: int
    row: DiagnosisRow
    document: Mapping[str, object] = field(default_factory=dict)
    diagnosed: bool = True
    html: str | None = None


def diagnose_each(args: argparse.Namespace) -> int:
    """Diagnose each recording, show what is done, also when interrupted; 2 where one was bad."""
    done: list[Outcome] = []
    try:
        _compute(args, done)
    finally:
        if done:
            _show(args, sorted(done, key=lambda one: one.number))
    return 0 if all(one.diagnosed for one in done) else 2


def _compute(args: argparse.Namespace, done: list[Outcome]) -> None:
    """Append each outcome as it comes, and write its page."""
    settings = Settings(
        model_file=str(args.model),
        model=args.model.read_text(encoding="utf-8"),
        effects_file=args.effects,
        mode=args.mode,
        seed=args.seed,
        time_limit_s=args.time_limit,
        pages=args.report is not None,
    )
    if args.report:
        args.report.mkdir(parents=True, exist_ok=True)
    settle_s = settle_of(args)
    tasks: list[tuple[object, ...]] = []
    for number, path in enumerate(args.recordings):
        try:
            recordings = recordings_to_judge([path], settle_s)
        except (BadInput, OSError) as problem:
            done.append(_failed(number, str(path), problem))
        else:
            tasks.append((number, str(path), recordings, settings))
    count = len(args.recordings)
    names = page_names(args.recordings)
    results = (
        on_cluster(diagnose_one, tasks, args.scheduler)
        if args.scheduler
        else on_this_machine(diagnose_one, tasks, args.jobs or -1)
    )
    with closing(results), stages("diagnosing") as tell:
        tell(f"{len(done)} of {count} done", len(done) / count)
        for one in results:
            done.append(_with_page(one, args.report / names[one.number]) if args.report else one)
            tell(f"{len(done)} of {count} done", len(done) / count)


def recordings_to_judge(paths: Sequence[Path], settle_s: float) -> list[Recording]:
    """Read recordings or a session; each up to where the drive was disabled.

    Raises
    ------
    BadInput
        One that cannot be read.
    """
    from bowden.recording.enabled import until_disabled  # noqa: PLC0415  (keeps --help fast)
    from bowden.recording.session import read_recordings  # noqa: PLC0415

    session = read_recordings(paths).since(settle_s)
    return [until_disabled(one) for one in session.recordings]


def diagnose_one(
    number: int, name: str, recordings: Sequence[Recording], settings: Settings
) -> Outcome:
    """Diagnose one recording, or the recordings of one session, wherever this runs."""
    from bowden.diagnosis.diagnose import diagnose  # noqa: PLC0415  (keeps --help fast)
    from bowden.model import Mode, ModelError, parse_model  # noqa: PLC0415
    from bowden.model.effects import CATALOGUE  # noqa: PLC0415
    from bowden.model.effects.own import add_to, effects_in  # noqa: PLC0415
    from bowden.report.diagnoses import DiagnosisRow  # noqa: PLC0415
    from bowden.report.diagnosis import diagnosis_report  # noqa: PLC0415

    began = time.perf_counter()
    try:
        if settings.effects_file:  # this process may not have them, or have them already
            own = effects_in(settings.effects_file)
            add_to(
                CATALOGUE,
                [one for one in own if one.name not in CATALOGUE],
                str(settings.effects_file),
            )
        found = diagnose(
            parse_model(settings.model, source=settings.model_file),
            recordings,
            Mode(settings.mode),
            seed=settings.seed,
            time_limit_s=settings.time_limit_s,
        )
    except (BadInput, ModelError) as problem:
        return _failed(number, name, problem)
    seconds = time.perf_counter() - began
    facts = {"model file": settings.model_file, "recording": name}
    return Outcome(
        number,
        DiagnosisRow.of(name, found, seconds),
        {"recording": name, "error": None, "seconds": seconds, **found.to_document()},
        found.verdict != "bad_data",
        diagnosis_report(found, facts) if settings.pages else None,
    )


def page_names(recordings: Sequence[Path]) -> list[str]:
    """Return a file name for each recording's page, no two alike."""
    names = [INDEX]
    for path in recordings:
        like = (path.stem, *(f"{path.stem}-{k}" for k in range(2, len(recordings) + 3)))
        names.append(next(f"{one}.html" for one in like if f"{one}.html" not in names))
    return names[1:]


def _failed(number: int, name: str, problem: Exception) -> Outcome:
    from bowden.report.diagnoses import DiagnosisRow  # noqa: PLC0415  (keeps --help fast)

    text = " ".join(str(problem).split())
    document = {"recording": name, "error": text, "seconds": 0.0, "verdict": None}
    return Outcome(number, DiagnosisRow(name, "bad input", problem=text), document, diagnosed=False)


def _with_page(one: Outcome, path: Path) -> Outcome:
    """Write its page and say where."""
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415  (keeps --help fast)

    if one.html is None:
        return one
    with replace_whole(path) as temporary:
        temporary.write_text(one.html, encoding="utf-8")
    row, document = replace(one.row, page=path.name), {**one.document, "report": str(path)}
    return replace(one, row=row, document=document, html=None)


def _show(args: argparse.Namespace, done: Sequence[Outcome]) -> None:
    """Print the table, write the index page, print the document."""
    from rich import box  # noqa: PLC0415  (keeps --help fast)
    from rich.table import Table  # noqa: PLC0415

    from bowden.recording.atomic import replace_whole  # noqa: PLC0415
    from bowden.report.diagnoses import HEADER, diagnoses_report  # noqa: PLC0415

    out = console()
    if not out.is_terminal:
        out.width = _LOG_COLUMNS
    table = Table(*HEADER, box=box.SIMPLE_HEAD, pad_edge=False)
    for one in done:
        for line in one.row.lines:
            table.add_row(*line)
    out.print(table)
    for one in done:
        if one.row.problem:
            out.print(one.row.refusal, soft_wrap=True)
    bad = sum(not one.diagnosed for one in done)
    out.print(
        f"{len(done) - bad} of {len(args.recordings)} diagnosed; bad data or bad input: {bad}"
    )
    if args.report:
        index = args.report / INDEX
        text = diagnoses_report([one.row for one in done], {"model file": str(args.model)})
        with replace_whole(index) as temporary:
            temporary.write_text(text, encoding="utf-8")
        out.print(f"report: {index}", soft_wrap=True)
    if args.json:
        print_json({"diagnoses": [one.document for one in done]})
