"""Run an experiment over many parameter sets: a grid, or random draws.

The rows go to OUT.csv when all of them are there; until then they are kept in OUT.csv.partial, and
the same command goes on where it was interrupted. Points run on all cores of this machine, or on
a Dask cluster with --scheduler.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.cli.model_arguments import add_model_argument, read_model
from bowden.cli.output import add_json_argument, console, print_json, progress
from bowden.cli.parallel import add_scheduler_argument, on_cluster, on_this_machine
from bowden.errors import BadInput
from bowden.recording.atomic import refuse_unwritable

if TYPE_CHECKING:
    from bowden.model.sweep import Row, Sweep

EXAMPLES = """examples:
  bowden sweep rig.yaml --experiment 2 --output out.csv \\
      --vary rig.cable.pretension_n=5:20:4 --vary friction.mu_d=0.1,0.2
  bowden sweep rig.yaml --experiment 1 --output out.csv --random 1000 --seed 1 \\
      --vary rig.cable.pretension_n=0.5:3 --scheduler tcp://node1:8786
"""

_MOST_A_TASK = 50


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "--vary",
        metavar="PATH=VALUES",
        action="append",
        required=True,
        help="low:high:count, or a,b,c, or with --random low:high; repeatable",
    )
    parser.add_argument(
        "--experiment",
        choices=("1", "2", "3"),
        required=True,
        help="1: load locked, 2: tunnel, 3: ideal follower",
    )
    parser.add_argument(
        "--output", metavar="OUT.csv", type=Path, required=True, help="a row for each point"
    )
    parser.add_argument("--random", metavar="N", type=int, help="N random draws in place of a grid")
    parser.add_argument("--seed", metavar="S", type=int, help="of the draws (default: 0)")
    add_scheduler_argument(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Run the missing points, write the table, report its number of rows."""
    output: Path = args.output
    refuse_unwritable([output])
    sweep = _sweep(args)
    if output.is_file():
        _check_same(output, _digest_in(output), sweep)
        rows = len(sweep.points)
        console().print(f"{output} holds this sweep already, all {rows} rows", soft_wrap=True)
        computed, failed = 0, None
    else:
        partial = output.with_name(output.name + ".partial")
        done = _read_partial(partial, sweep)
        rows, computed = len(sweep.points), len(sweep.points) - len(done)
        done |= _compute(sweep, partial, done, args.scheduler)
        _write_table(output, sweep, [done[i] for i in range(rows)])
        partial.unlink(missing_ok=True)
        failed = sum(row["error"] is not None for row in done.values())
        note = f", {failed} of them points that no rig can be" if failed else ""
        console().print(f"{output}: {rows} rows{note}", soft_wrap=True)
    if args.json:
        print_json(
            {
                "output": str(output),
                "sweep": sweep.digest,
                "rows": rows,
                "computed": computed,
                "failed": failed,
            }
        )
    return 0


def _sweep(args: argparse.Namespace) -> Sweep:
    from bowden.model.sweep import grid, parse_axis, random_draws  # noqa: PLC0415  (fast --help)

    model = read_model(args.model)
    axes = [parse_axis(text) for text in args.vary]
    if args.random is None:
        if args.seed is not None:
            raise BadInput("--seed", "a seed without --random", "--random N --seed S")
        return grid(model, args.experiment, axes)
    return random_draws(model, args.experiment, axes, args.random, args.seed or 0)


def _compute(
    sweep: Sweep, partial: Path, done: dict[int, Row], scheduler: str | None
) -> dict[int, Row]:
    """Compute the missing rows and note each in the partial file as it comes."""
    missing = [i for i in range(len(sweep.points)) if i not in done]
    size = max(1, min(_MOST_A_TASK, len(missing) // 100))
    tasks = [missing[i : i + size] for i in range(0, len(missing), size)]
    found: dict[int, Row] = {}
    if not tasks:
        return found
    results = _on_cluster(sweep, tasks, scheduler) if scheduler else _on_this_machine(sweep, tasks)
    try:
        journal = partial.open("a", encoding="utf-8")
    except OSError as error:
        raise BadInput(
            str(partial), error.strerror or str(error), "a path in a folder that can be written to"
        ) from error
    with journal, progress("{task.completed} of {task.total}") as bar:
        if not done:
            _note(journal, {"sweep": sweep.digest})
        task = bar.add_task("sweeping", total=len(sweep.points), completed=len(done))
        for rows in results:
            for row in rows:
                found[int(row["index"] or 0)] = row
                _note(journal, row)
            bar.update(task, advance=len(rows))
    return found


def _note(journal: io.TextIOBase, line: object) -> None:
    journal.write(json.dumps(line) + "\n")
    journal.flush()


def _on_this_machine(sweep: Sweep, tasks: Sequence[Sequence[int]]) -> Iterator[list[Row]]:
    from bowden.model.sweep import run_points  # noqa: PLC0415  (keeps --help fast)

    return on_this_machine(run_points, _arguments(sweep, tasks))


def _on_cluster(
    sweep: Sweep, tasks: Sequence[Sequence[int]], scheduler: str
) -> Iterator[list[Row]]:
    from bowden.model.sweep import run_points  # noqa: PLC0415  (keeps --help fast)

    return on_cluster(run_points, _arguments(sweep, tasks), scheduler)


def _arguments(sweep: Sweep, tasks: Sequence[Sequence[int]]) -> list[tuple[object, ...]]:
    from bowden.model import format_model  # noqa: PLC0415  (keeps --help fast)

    text = format_model(sweep.model)
    return [(text, sweep.experiment, _points(sweep, task)) for task in tasks]


def _points(sweep: Sweep, indices: Sequence[int]) -> list[tuple[int, dict[str, float]]]:
    return [(i, sweep.values(i)) for i in indices]


def _read_partial(partial: Path, sweep: Sweep) -> dict[int, Row]:
    """Read the rows of an interrupted run; a last line that was cut is left out."""
    if not partial.exists():
        return {}
    entries: list[dict[str, Any]] = []
    whole = ""
    for line in partial.read_text(encoding="utf-8").splitlines(keepends=True):
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            break
        if not line.endswith("\n"):
            break
        entries.append(entry)
        whole += line
    found = entries[0].get("sweep") if entries else None
    if entries:
        _check_same(partial, found, sweep)
    partial.write_text(whole, encoding="utf-8")
    rows = {int(entry["index"]): entry for entry in entries[1:]}
    if rows:
        console().print(f"going on: {len(rows)} of {len(sweep.points)} rows are there")
    return rows


def _digest_in(output: Path) -> str | None:
    with output.open(encoding="utf-8", errors="replace") as file:
        first = file.readline()
    return first.removeprefix("# sweep: ").strip() if first.startswith("# sweep: ") else None


def _check_same(path: Path, found: str | None, sweep: Sweep) -> None:
    if found != sweep.digest:
        raise BadInput(
            str(path),
            f"sweep {found}" if found else "something that is no sweep",
            f"this sweep, {sweep.digest} (same model, experiment and values), or another --output",
        )


def _write_table(output: Path, sweep: Sweep, rows: Sequence[Row]) -> None:
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415

    text = io.StringIO()
    text.write(f"# sweep: {sweep.digest}\n# experiment: {sweep.experiment}\n")
    writer = csv.DictWriter(text, sweep.columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with replace_whole(output) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")
