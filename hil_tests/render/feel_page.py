"""The page of the benchmark of feel: one table for this version, one by task, how to run, limits.

Input: runs by plant. Output: Markdown. Rigs whose friction alone takes most of the motor's torque
are left out of all but the number of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Protocol

import numpy as np

from hil_tests.render.bounds import INFORMED
from hil_tests.render.calibrated import CALIBRATED
from hil_tests.render.feel_table import best_published, figures, median_of
from hil_tests.render.laws import LAWS, NAIVE, OURS, WITHOUT_CELL
from hil_tests.render.trial import Outcome

PLANT_NAMES: Final = {"rig": "simulated rig", "implicit": "second plant"}
OURS_SHOWN: Final = {
    OURS: "with cell",
    WITHOUT_CELL: "without",
    CALIBRATED: "without, calibrated",
}
PUBLISHED: Final = tuple(x.name for x in LAWS if x.name not in {NAIVE.name, OURS, WITHOUT_CELL})
#: With the cell / without.
GOALS: Final = {
    "like tasks, median": "0.06 / 0.14",
    "like tasks, 95th percentile": "0.20 / 0.30",
    "all tasks pooled, median": "0.08 / 0.15",
    "tremor, worst": "0.8",
    "release, median": "0.12 / 0.20",
    "grasp, median": "0.12 / 0.20",
    "trials worse than naive": "none",
    "limit cycles at standstill": "0",
    "free handles driven again": "0",
    "trials with an active path": "0",
}
TEXT: Final = """\
# Feel: the benchmark

How well an operator feels the wanted torque, also when they tremble, let go or grasp, and when the
cables change. The figure is the RMS of torque on the load less wanted torque, over that of the
uncompensated drive (law `none`) in the same trial. What the laws are:
[compensation](compensation.md).

## {made}

{rigs}: those whose friction alone takes most of the motor's torque.

{table}

Seeds {first} to {last}; the law was developed on seeds below 1000. In brackets 95 % intervals over
these rigs. *Like tasks*: those of the [compensation benchmark](compensation-benchmark.md). *Driven
again*: a handle that was let go has at a turn over {redriven:.0%} more of its energy than at an
earlier one. *Active path*: on a path that closes, the cables give over {active:.0%} more than the
wanted torque would, of what the path exchanges.

## Task by task

Median error. *Calibrated*: below. *Told the truth*: the law with the load cell, told the cables'
true numbers, by sensors that are not late. *Bound*: derived, below.

{tasks}

## Calibrated without a load cell

The drives start from numbers that are wrong by up to 15 % each. *Calibrated* ones are measured
first, as a lab does it that has no load cell: the handle held firmly, torque ramps on the motor
for 6 s, and `bowden calibrate` on the angles and the motor's torque. The drive is told what that
finds, and how well it knows the friction (entry `friction_deviation`).

## Bounds

**Steps.** For the time `L/c` of a wave along the cable the old torque acts on the load, whatever
the drive does: (M4) of the [derivation](compensation.md#derivation-of-the-inversion).

**Release.** A handle that is let go in the wall moves back, so the friction `F` has to turn over.
The motor crosses the backlash `x_b = F L/(2 EA)`, from standstill to standstill. With its inertia
`J`, its torque `tau` (at most its limit, what the cables hold and the friction) and the slew `s` of
the torque that takes at least

    t_m = max(2 sqrt(J x/tau), (32 J x/s)^(1/3))      x = x_b/r_in                        (F1)

Friction turns over from both ends, and evenly where the wrap exponent is small. When the load has
turned by `x_l`, the fraction `sqrt(x_l r_load/x_b)` of the cable has turned over from its end, and
the motor's way `y` turns over `sqrt(y/x_b)` from the other. Until the two meet the motor changes
nothing at the load:

    error = 2 F min(sqrt(x_l r_load/x_b), 1 - sqrt(y/x_b))                                (F2)

`x_l` follows from the handle's inertia and the wanted torque, `y` from `t_m`. A drive is assumed
that starts its motor at the release, with the friction as the way into the wall has left it. The
bound counts the first turn only, as a drive may take the handle's energy there. {release}

**Release, with full information.** The motor torque after the release is searched for on the
simulated rig itself: its whole state is known, the torque keeps the motor's limit and slew, and the
motor's inertia and the handle's flight are part of it. What is found can be applied, so the least
error is at most that; it is no lower bound. What it reaches beside the law, and what a law costs
that turns the friction over earlier: [compensation](compensation.md#derivation-of-the-inversion).

## Run it

    python -m hil_tests.benchmarks.feel --rigs 10 --seed 1 --plant rig
    python -m hil_tests.benchmarks.feel --rigs 100 --seed S --page docs/feel-benchmark.md
    python -m hil_tests.benchmarks.release --rigs 14 --seed 1

A rig takes half a minute on the simulated rig and two minutes on the second plant, on one core.
`--page` also writes the pages of the tasks, into the folder `feel` beside it: wanted and felt
torque in the median and the worst trial, and what makes the worst one. `--json` keeps every
trial's figures, `--runs` makes the pages of such files without running again. The third command
makes the figures of a release with full information.

## Limits

- Both plants are simulations. They share the rigs' description, not code: the second one is
  implicit, has Dahl friction and an operator of two masses.
- The published laws run on the simulated rig only.
- *Told the truth* bounds what knowledge brings to the law with the load cell. It is no bound for
  all drives. What a drive without a cell lacks:
  [compensation](compensation.md#derivation-of-the-inversion).
- What makes a worst trial is found by putting one thing right at a time. Two things that act
  together are not told apart.

```{{toctree}}
:hidden:
{toctree}
```
"""


class Ran(Protocol):
    """What a figure is made from."""

    @property
    def outcome(self) -> Outcome:
        """Figures of the trial."""

    @property
    def bound_nm(self) -> float:
        """Error that is derived for the task; 0 where none is."""


Runs = Mapping[str, Sequence[Ran]]


def counted(runs: Sequence[Ran]) -> list[Outcome]:
    """Return the outcomes of rigs whose motor can do it."""
    return [r.outcome for r in runs if not r.outcome.apart]


def cell(value: float, digits: int = 3) -> str:
    """Write a number; nothing where there is none."""
    return "" if math.isnan(value) else f"{value:.{digits}f}"


def bound_ratio(runs: Sequence[Ran], task: str) -> float:
    """Return the median of the derived bound over the naive error; nan where there is none."""
    ratios = [
        r.bound_nm / r.outcome.rms_nm
        for r in runs
        if r.outcome.task == task and r.outcome.law == NAIVE.name and r.bound_nm > 0.0
    ]
    return float(np.median(ratios)) if ratios else math.nan


def tasks_of(runs: Runs) -> list[str]:
    """Return the tasks' names in the order in which they ran."""
    return list(dict.fromkeys(r.outcome.task for found in runs.values() for r in found))


def page(runs: Runs, made: str, limits: tuple[float, float]) -> str:
    """Write the page.

    Parameters
    ----------
    runs : mapping of str to sequence
        By plant.
    made : str
        Version and date.
    limits : tuple of float
        Above which a handle counts as driven again, and a path as active.
    """
    kept = {plant: counted(found) for plant, found in runs.items()}
    seeds = sorted({r.outcome.seed for found in runs.values() for r in found})
    rigs = []
    for plant, found in runs.items():
        able, drawn = {o.seed for o in kept[plant]}, {r.outcome.seed for r in found}
        rigs.append(f"{len(able)} rigs on the {PLANT_NAMES[plant]}, {len(drawn - able)} left out")
    return TEXT.format(
        made=made,
        rigs="; ".join(rigs),
        table=_table(kept),
        tasks=_tasks(runs, kept),
        first=seeds[0],
        last=seeds[-1],
        redriven=limits[0],
        active=limits[1],
        release=_release(next(iter(runs.values()))),
        toctree="\n".join(f"feel/{task}" for task in tasks_of(runs)),
    )


def _release(runs: Sequence[Ran]) -> str:
    """Say what the bound of a release leaves of the goal."""
    bound = bound_ratio(runs, "release")
    if math.isnan(bound):
        return "No release was run."
    goal = float(GOALS["release, median"].split(" / ")[0])
    forbids = "forbids" if bound > goal else "does not forbid"
    return f"With {bound:.3f} in the median it {forbids} the goal of {goal:g} with the cell."


def _table(kept: Mapping[str, Sequence[Outcome]]) -> str:
    columns = [
        (f"{PLANT_NAMES[plant]}, {shown}", figures(outcomes, law))
        for plant, outcomes in kept.items()
        for law, shown in OURS_SHOWN.items()
        if any(o.law == law for o in outcomes)
    ]
    lines = [
        "| figure | goal: with / without | " + " | ".join(name for name, _ in columns) + " |",
        "| --- | ---: |" + " ---: |" * len(columns),
    ]
    for name in columns[0][1] if columns else ():
        cells = [found[name] for _, found in columns]
        lines.append(f"| {name} | {GOALS.get(name, '')} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _tasks(runs: Runs, kept: Mapping[str, Sequence[Outcome]]) -> str:
    columns: list[tuple[str, str, str]] = []  # heading, plant, law
    for plant, outcomes in kept.items():
        ran = {o.law for o in outcomes}
        best = best_published(outcomes, [law for law in PUBLISHED if law in ran])
        columns += [
            (f"{PLANT_NAMES[plant]}, {shown}", plant, law)
            for law, shown in OURS_SHOWN.items()
            if law in ran
        ]
        columns += [("with cell, told the truth", plant, INFORMED)] if INFORMED in ran else []
        columns += [(f"best published: {best}", plant, best)] if best else []
    lines = [
        "| task | " + " | ".join(heading for heading, _, _ in columns) + " | bound |",
        "| --- |" + " ---: |" * (len(columns) + 1),
    ]
    for task in tasks_of(runs):
        cells = [cell(median_of(kept[plant], law, task)[0]) for _, plant, law in columns]
        bound = bound_ratio(next(iter(runs.values())), task)
        lines.append(f"| [{task}](feel/{task}.md) | " + " | ".join(cells) + f" | {cell(bound)} |")
    return "\n".join(lines)
