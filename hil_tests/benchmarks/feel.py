"""How an operator feels the wanted torque, also when they tremble, let go or grasp; on two plants.

    python -m hil_tests.benchmarks.feel --rigs 10 --seed 1                       while developing
    python -m hil_tests.benchmarks.feel --rigs 100 --seed S --page docs/feel-benchmark.md

The page has a page for each task beside it, in the folder ``feel``; figures of earlier runs
(``--json``) make it without running again (``--runs``, one file a plant or part of the seeds).
Naive is 1. Developing seeds are 1 to 999. The plants share no code (`hil_tests.second_plant`).
"""

from __future__ import annotations

import argparse
import datetime
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

from bowden.recording.atomic import replace_whole

from hil_tests.render.bounds import INFORMED, informed
from hil_tests.render.bounds import bound_nm as bound_of_nm
from hil_tests.render.calibrated import CALIBRATED, calibrated
from hil_tests.render.disturbed import ALL_TASKS
from hil_tests.render.feel_page import PUBLISHED, page
from hil_tests.render.feel_table import ACTIVE_ABOVE, REDRIVEN_ABOVE
from hil_tests.render.feel_task_page import task_pages
from hil_tests.render.laws import LAWS, NAIVE, OURS, WITHOUT_CELL, Law, law_named
from hil_tests.render.rigs import draw
from hil_tests.render.seeds import add_seeds, seeds_of
from hil_tests.render.tasks import Task, task_named
from hil_tests.render.trial import PLANTS, Outcome, Plant, judge, run


@dataclass(frozen=True)
class Run:
    """One trial's figures and where they come from.

    Parameters
    ----------
    plant : str
    outcome : Outcome
    bound_nm : float
        RMS error that is derived for this task (`bounds.bound_nm`); 0 where none is.
    """

    plant: Plant
    outcome: Outcome
    bound_nm: float


def measure(
    cases: Sequence[tuple[int, Plant]], laws: Sequence[Law], tasks: Sequence[Task]
) -> Iterator[list[Run]]:
    """Run each task with each law; a list for each seed and plant.

    Naive, informed and calibrated drives are always among them.

    The published laws run on the simulated rig only.
    """
    for seed, plant in cases:
        rig = draw(seed)
        found = []
        here = [law for law in laws if plant == "rig" or law.name not in PUBLISHED]
        known = calibrated(rig, plant)
        for task in tasks:
            bound_nm = bound_of_nm(rig, task)
            for law in (NAIVE, *here):
                found.append(Run(plant, judge(run(rig, law, task, plant=plant)), bound_nm))
            told = judge(run(informed(rig), law_named(OURS), task, plant=plant))
            found.append(Run(plant, replace(told, law=INFORMED), bound_nm))
            better = judge(run(known, law_named(WITHOUT_CELL), task, plant=plant))
            found.append(Run(plant, replace(better, law=CALIBRATED), bound_nm))
        yield found


def kept(path: Path) -> list[Run]:
    """Read what ``--json`` has written; ValueError names the file."""
    try:
        return [
            Run(row.pop("plant"), bound_nm=row.pop("bound_nm"), outcome=Outcome(**row))
            for row in json.loads(path.read_text(encoding="utf-8"))
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path}: not a file of --json: {error}") from error


def write(text: str, path: Path) -> None:
    """Write a file in one piece."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replace_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def main() -> int:
    """Run and write the pages; the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.feel",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_seeds(parser)
    parser.add_argument("--plant", choices=PLANTS, action="append", help="repeatable; default both")
    parser.add_argument("--law", action="append", help="repeatable; default: all")
    parser.add_argument("--task", action="append", help="repeatable; default: all")
    parser.add_argument("--json", type=Path, metavar="OUT.json", help="every trial's figures")
    parser.add_argument(
        "--runs", type=Path, action="append", metavar="IN.json", help="in place of running"
    )
    parser.add_argument("--page", type=Path, metavar="OUT.md", help="default: stdout")
    options = parser.parse_args()
    try:
        laws = [law_named(name) for name in options.law] if options.law else LAWS[1:]
        tasks = [task_named(x, ALL_TASKS) for x in options.task] if options.task else ALL_TASKS
        runs = [run for path in options.runs or () for run in kept(path)]
    except ValueError as error:
        parser.error(str(error))
    seeds = seeds_of(parser, options)
    if not runs:
        cases = [(seed, plant) for plant in options.plant or PLANTS for seed in seeds]
        start_s = time.monotonic()
        for done, found in enumerate(measure(cases, laws, tasks), 1):
            runs += found
            left_s = (time.monotonic() - start_s) / done * (len(cases) - done)
            sys.stderr.write(f"\r  {done} of {len(cases)} rigs, {left_s:.0f} s left ")
        sys.stderr.write("\n")
    if options.json is not None:
        rows = [{"plant": r.plant, "bound_nm": r.bound_nm} | asdict(r.outcome) for r in runs]
        write(json.dumps(rows, indent=1) + "\n", options.json)
    by_plant: dict[str, list[Run]] = {}
    for one in sorted(runs, key=lambda r: PLANTS.index(r.plant)):
        by_plant.setdefault(one.plant, []).append(one)
    today = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    text = page(by_plant, f"Version {version('bowden')}, {today}", (REDRIVEN_ABOVE, ACTIVE_ABOVE))
    if options.page is None:
        sys.stdout.write(text)
        return 0
    write(text, options.page)
    for name, content in task_pages(by_plant, ALL_TASKS):
        write(content, options.page.parent / "feel" / name)
        sys.stderr.write(f"\r  {name} ")
    sys.stderr.write("\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
