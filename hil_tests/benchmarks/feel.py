"""How an operator feels the wanted torque, also when they tremble, let go or grasp; on two plants.

    python -m hil_tests.benchmarks.feel --rigs 10 --seed 1                       while developing
    python -m hil_tests.benchmarks.feel --rigs 100 --seed S --page docs/feel-benchmark.md

Naive is 1. Developing seeds are 1 to 999. The plants share no code (`hil_tests.second_plant`).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

from bowden.recording.atomic import replace_whole

from hil_tests.render.bounds import informed, wave_bound_nm
from hil_tests.render.disturbed import DISTURBED
from hil_tests.render.feel_table import page
from hil_tests.render.laws import NAIVE, OURS, WITHOUT_CELL, Law, law_named
from hil_tests.render.rigs import draw
from hil_tests.render.tasks import TASKS, Task, task_named
from hil_tests.render.trial import PLANTS, Outcome, Plant, judge, run

ALL_TASKS: Final = (*TASKS, *DISTURBED)
DEFAULT_LAWS: Final = (OURS, WITHOUT_CELL)
INFORMED: Final = "informed"  # ours, told the truth of the cables and by sensors that are not late


@dataclass(frozen=True)
class Run:
    """One trial's figures and where they come from.

    Parameters
    ----------
    plant : str
    outcome : Outcome
    bound_nm : float
        RMS error that no drive can stay below on this task, for the cables' waves; 0 where
        nothing is known.
    """

    plant: Plant
    outcome: Outcome
    bound_nm: float


def measure(
    seeds: Sequence[int], plants: Sequence[Plant], laws: Sequence[Law], tasks: Sequence[Task]
) -> Iterator[list[Run]]:
    """Run each task with each law, naive and informed among them; a list for each rig and plant."""

    def of_a_rig(case: tuple[int, Plant]) -> list[Run]:
        seed, plant = case
        rig = draw(seed)
        found = []
        for task in tasks:
            bound_nm = wave_bound_nm(rig, task)
            for law in (NAIVE, *laws):
                found.append(Run(plant, judge(run(rig, law, task, plant=plant)), bound_nm))
            told = judge(run(informed(rig), law_named(OURS), task, plant=plant))
            found.append(Run(plant, replace(told, law=INFORMED), bound_nm))
        return found

    with ThreadPoolExecutor(1) as pool:
        yield from pool.map(of_a_rig, [(seed, plant) for seed in seeds for plant in plants])


def main() -> int:
    """Run and write the page; the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.feel",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seed", type=int, default=1, help="of the first rig (default: 1)")
    parser.add_argument("--rigs", type=int, default=10, help="of consecutive seeds (default: 10)")
    parser.add_argument("--plant", choices=PLANTS, action="append", help="repeatable; default both")
    parser.add_argument("--law", action="append", help="repeatable; default: ours with, without")
    parser.add_argument("--task", action="append", help="repeatable; default: all")
    parser.add_argument("--json", type=Path, metavar="OUT.json", help="every trial's figures")
    parser.add_argument("--page", type=Path, metavar="OUT.md", help="default: stdout")
    options = parser.parse_args()
    try:
        laws = [law_named(name) for name in options.law or DEFAULT_LAWS]
        tasks = [task_named(x, ALL_TASKS) for x in options.task] if options.task else ALL_TASKS
    except ValueError as error:
        parser.error(str(error))
    if options.rigs < 1 or options.seed < 0:
        parser.error(f"--rigs, --seed: found {options.rigs}, {options.seed}; accepted: >= 1, >= 0")
    seeds = range(options.seed, options.seed + options.rigs)
    plants: Sequence[Plant] = options.plant or PLANTS
    runs: list[Run] = []
    start_s, cases = time.monotonic(), len(seeds) * len(plants)
    for done, found in enumerate(measure(seeds, plants, laws, tasks), 1):
        runs += found
        left_s = (time.monotonic() - start_s) / done * (cases - done)
        sys.stderr.write(f"\r  {done} of {cases} rigs, {left_s:.0f} s left ")
    sys.stderr.write("\n")
    if options.json is not None:
        with replace_whole(options.json) as temporary:
            rows = [{"plant": r.plant, "bound_nm": r.bound_nm} | asdict(r.outcome) for r in runs]
            temporary.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    names = [NAIVE.name, *(law.name for law in laws), INFORMED]
    text = page({p: [r for r in runs if r.plant == p] for p in plants}, names, seeds)
    if options.page is None:
        sys.stdout.write(text)
        return 0
    with replace_whole(options.page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
