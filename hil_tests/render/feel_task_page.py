"""A page for each task of the benchmark of feel: what is felt, and what makes the worst trial.

Input: runs by plant. Output: Markdown and an SVG for each task. The median and the worst trial are
run again for the picture; the worst ones also with one thing put right at a time (`causes`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from bowden_rig.bench import TICKS_PER_S
from bowden_rig.rig import state as at

from hil_tests.render.bounds import INFORMED
from hil_tests.render.causes import causes
from hil_tests.render.feel_page import PLANT_NAMES, PUBLISHED, Runs, bound_ratio, cell, counted
from hil_tests.render.feel_picture import Panel, picture
from hil_tests.render.feel_table import best_published, median_of, trial_ratios
from hil_tests.render.laws import NAIVE, OURS, WITHOUT_CELL, law_named
from hil_tests.render.rigs import draw
from hil_tests.render.tasks import Task
from hil_tests.render.trial import Outcome, run

ABOUT: Final = {
    "tunnel-slow": "Strokes of 0.4 rad through the tunnel at 0.25 Hz.",
    "tunnel": "Strokes of 0.5 rad through the tunnel at 0.5 Hz.",
    "tunnel-fast": "Strokes of 0.4 rad through the tunnel at 1 Hz.",
    "wall-edge": "Strokes of 0.04 rad to and fro over the edge of the wall, at 1 Hz.",
    "free": "Strokes of 0.4 rad at 0.5 Hz in a dead zone: nothing is to be felt.",
    "steps": "The wanted torque steps every 0.5 s, the operator holds still.",
    "rest-in-wall": "The operator moves into the wall and holds still there.",
    "rest-in-middle": "The operator moves a little in the dead zone and holds still there.",
    "tremor": "Strokes at 0.5 Hz by an operator who trembles at 8 to 12 Hz by 5 to 30 mrad.",
    "release": "The operator rests in the wall and lets go at 1 s, within 10 ms.",
    "grasp": "The handle is free; at 1 s an operator on the way grasps it, within 20 ms.",
    "bend": "Strokes at 0.5 Hz while the conduit is bent by 0.5 rad within 2 s.",
    "pretension-drop": "Strokes at 0.5 Hz; at 1.6 s a clamp slips and pretension drops by 30 %.",
    "tensing": "Strokes at 0.5 Hz by an operator who is relaxed and tense in turn.",
}
TEXT: Final = """\
# Feel: {task}

{about} The error is the RMS of torque on the load less wanted torque, over that of the
uncompensated drive (`none`) in the same trial. [All tasks](../feel-benchmark.md).

{table}

![wanted and felt torque over time]({task}.svg)

Above the trial with the median error, below the worst one of `{ours}`.

## What makes the worst trials

{worst}

An error "with" something put right is that of the same trial in which only that is changed; only
what takes at least a fifth of the error is listed.
"""


@dataclass(frozen=True)
class Trial:
    """Where a trial is to be found again, its error over the naive law's, and the naive (N m)."""

    plant: Any
    outcome: Outcome
    ratio: float
    naive_nm: float


def task_pages(runs: Runs, tasks: Sequence[Task]) -> Iterator[tuple[str, str]]:
    """Yield names and texts of the files, two for each task that our law has done."""
    kept = {plant: counted(found) for plant, found in runs.items()}
    first = next(iter(kept.values()))
    best = best_published(first, [x for x in PUBLISHED if any(o.law == x for o in first)])
    for task in tasks:
        mine = _trials(kept, OURS, task.name)
        if not mine:
            continue
        shown = [_panel("median", _median(mine), task, best)]
        worst = max(mine, key=lambda t: t.ratio)
        shown.append(_panel("worst", worst, task, best))
        laws = [(OURS, worst)]
        if blind := _trials(kept, WITHOUT_CELL, task.name):
            laws.append((WITHOUT_CELL, max(blind, key=lambda t: t.ratio)))
        yield f"{task.name}.svg", picture(shown)
        yield (
            f"{task.name}.md",
            TEXT.format(
                task=task.name,
                about=ABOUT[task.name],
                ours=OURS,
                table=_table(runs, kept, task.name),
                worst=_worst(kept, laws, task),
            ),
        )


def _trials(kept: Mapping[str, Sequence[Outcome]], law: str, task: str) -> list[Trial]:
    return [
        Trial(plant, o, ratio, naive)
        for plant, outcomes in kept.items()
        for o, ratio, naive in trial_ratios(outcomes, law)
        if o.task == task and not math.isnan(ratio)
    ]


def _median(trials: Sequence[Trial]) -> Trial:
    """Return the trial in the middle, on the first plant, where all laws have run."""
    there = sorted((t for t in trials if t.plant == trials[0].plant), key=lambda t: t.ratio)
    return there[len(there) // 2]


def _panel(which: str, trial: Trial, task: Task, best: str | None) -> Panel:
    rig = draw(trial.outcome.seed)
    scored = slice(round(task.scored_from_s * TICKS_PER_S), None)
    curves = {}
    for law in filter(None, (NAIVE.name, best, OURS)):
        done = run(rig, law_named(law), task, plant=trial.plant)
        curves[law] = done.rig[scored, at.LOAD_TORQUE]
    # what is wanted depends on where the load is: shown for our law
    wanted = done.wanted_nm[scored]
    title = (
        f"{which}: rig {rig.seed}, {PLANT_NAMES[trial.plant]}, "
        f"{trial.ratio:.2f} of the uncompensated error ({1e3 * trial.naive_nm:.0f} mN m RMS)"
    )
    return Panel(title, done.time_s[scored], curves | {f"wanted, with {OURS}": wanted})


def _table(runs: Runs, kept: Mapping[str, Sequence[Outcome]], task: str) -> str:
    laws = list(dict.fromkeys(o.law for outcomes in kept.values() for o in outcomes))
    heads = [f"{PLANT_NAMES[plant]}: median | 95th percentile | worst" for plant in kept]
    lines = ["| law | " + " | ".join(heads) + " |", "| --- |" + " ---: |" * 3 * len(kept)]
    for law in laws:
        if law == NAIVE.name:
            continue
        cells = [cell(x) for outcomes in kept.values() for x in median_of(outcomes, law, task)]
        name = "told the truth" if law == INFORMED else f"`{law}`"
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    bounds = [bound_ratio(found, task) for found in runs.values()]
    if any(np.isfinite(bounds)):
        lines.append("| derived bound | " + " | ".join(f"{cell(b)} | | " for b in bounds) + " |")
    return "\n".join(lines)


def _worst(
    kept: Mapping[str, Sequence[Outcome]], laws: Sequence[tuple[str, Trial]], task: Task
) -> str:
    lines = [
        "| law | error | rig | friction, of the motor's limit | hidden | error with |",
        "| --- | ---: | --- | ---: | --- | --- |",
    ]
    for law, trial in laws:
        o = trial.outcome
        rig = draw(o.seed)
        found = causes(rig, law_named(law), task, trial.plant, o.rms_nm)
        told = [
            t.ratio for t in _trials(kept, INFORMED, task.name)
            if t.plant == trial.plant and t.outcome.seed == o.seed
        ]  # fmt: skip
        parts = [f"{c.put_right}: {trial.ratio * c.left:.2f}" for c in found] or [
            "no single thing" + (f"; told the truth: {told[0]:.2f}" if told else "")
        ]
        lines.append(
            f"| `{law}` | {trial.ratio:.2f} | {o.seed}, {PLANT_NAMES[trial.plant]} "
            f"| {rig.friction_nm / rig.motor_limit_nm:.0%} | {', '.join(rig.hidden)} "
            f"| {'; '.join(parts)} |"
        )
    return "\n".join(lines)
