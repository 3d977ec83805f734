"""Many trials summed up, a row a law: error ratios to naive, friction felt, cycles, energy, slack.

Input: `trial.Outcome`s of the same rigs and tasks for every law, naive among them. Output:
`Summary` for the figures, and Markdown. Rigs whose friction alone takes most of the motor are
summed up apart.

The error ratio of a rig is that of the RMS over all its tasks to the naive law's on the same rig.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from hil_tests.render.laws import LAWS, NAIVE
from hil_tests.render.tasks import TASKS
from hil_tests.render.trial import Outcome

ACTIVE_ABOVE: Final = 0.01  # of the exchanged energy


@dataclass(frozen=True)
class Summary:
    """What one law does on many rigs.

    Parameters
    ----------
    ratio_median, ratio_p95, ratio_worst : float
        RMS error of a rig over that of the naive law.
    trials_above_naive : float
        Part of all single trials (rig and task) in which it is worse than naive by over 1 % and
        by more than a swing that is felt.
    peak_median : float
        Peak error over the naive law's, worst task of each rig.
    felt_median, felt_p95 : float
        Friction felt in free strokes over that of the naive law.
    stiffness_median : float
        Of the wall, over the wanted one.
    limit_cycles, active : int
        Rigs with a limit cycle at standstill; with a closed path that gives more than 1 %.
    energy_worst, energy_to_friction : float
        Most net energy of a closed path over the exchanged, and over the friction's work.
    slack_median, fallback : float
        Part of the time with a cable slack; in which a lesser law ran.
    stopped : int
        Trials in which the drive went to fault.
    """

    law: str
    rigs: int
    ratio_median: float
    ratio_p95: float
    ratio_worst: float
    trials_above_naive: float
    peak_median: float
    felt_median: float
    felt_p95: float
    stiffness_median: float
    limit_cycles: int
    active: int
    energy_worst: float
    energy_to_friction: float
    slack_median: float
    fallback: float
    stopped: int


def error_ratios(outcomes: Sequence[Outcome], law: str) -> dict[int, float]:
    """RMS error over all tasks of each rig, by seed, over that of the naive law."""
    mine, naive = _by_rig(outcomes, law), _by_rig(outcomes, NAIVE.name)
    return {seed: _pooled(mine[seed]) / _pooled(naive[seed]) for seed in mine}


def summarise(outcomes: Sequence[Outcome], law: str) -> Summary:
    """Sum up one law; `outcomes` has the naive law's on the same rigs."""
    mine, naive = _by_rig(outcomes, law), _by_rig(outcomes, NAIVE.name)
    ratios = np.array(list(error_ratios(outcomes, law).values()))
    own = [o for o in outcomes if o.law == law]
    plain = {(o.seed, o.task): o for o in outcomes if o.law == NAIVE.name}
    pairs = [(o, plain[o.seed, o.task]) for o in own]
    above = [o.rms_nm > 1.01 * p.rms_nm and o.rms_nm > p.rms_nm + 0.02 for o, p in pairs]
    felt = np.array(
        [
            abs(o.felt_friction_nm / p.felt_friction_nm)
            for o, p in pairs
            if not math.isnan(o.felt_friction_nm)
        ]
    )
    peaks = [
        max(o.peak_nm for o in mine[seed]) / max(o.peak_nm for o in naive[seed]) for seed in mine
    ]
    energy = {seed: _most([o.net_energy for o in mine[seed]]) for seed in mine}
    return Summary(
        law=law,
        rigs=len(mine),
        ratio_median=float(np.median(ratios)),
        ratio_p95=float(np.percentile(ratios, 95.0)),
        ratio_worst=float(np.max(ratios)),
        trials_above_naive=float(np.mean(above)),
        peak_median=float(np.median(peaks)),
        felt_median=float(np.median(felt)),
        felt_p95=float(np.percentile(felt, 95.0)),
        stiffness_median=float(np.nanmedian([o.stiffness for o in own])),
        limit_cycles=sum(any(o.limit_cycle for o in mine[seed]) for seed in mine),
        active=sum(part > ACTIVE_ABOVE for part in energy.values()),
        energy_worst=_most(list(energy.values())),
        energy_to_friction=_most([o.net_energy_to_friction for o in own]),
        slack_median=float(np.median([np.mean([o.slack for o in mine[s]]) for s in mine])),
        fallback=float(np.nanmean([o.fallback for o in own])),
        stopped=sum(o.bridge_off for o in own),
    )


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Write the tables: laws on the rigs that count and on those apart, and ours task by task."""
    counted = [o for o in outcomes if not o.apart]
    apart = [o for o in outcomes if o.apart]
    names = [law.name for law in LAWS if any(o.law == law.name for o in outcomes)]
    parts = [f"## {_rigs(counted)} rigs whose motor can do it\n\n{_laws(counted, names)}"]
    if apart:
        parts.append(
            f"## {_rigs(apart)} rigs apart: friction alone takes over 80 % of the motor\n\n"
            + _laws(apart, names)
        )
    parts.append(f"## Median error ratio, task by task\n\n{_tasks(counted, names)}")
    return "\n".join(parts)


def _laws(outcomes: Sequence[Outcome], names: Sequence[str]) -> str:
    head = (
        "| law | error ratio: median | 95th | worst | trials worse than naive | peak ratio "
        "| friction felt: median | 95th | stiffness | limit cycles | active paths | worst path "
        "| of the friction "
        "| slack | fell back | stopped |"
    )
    rows = [head, "| --- |" + " ---: |" * (head.count("|") - 2)]
    for s in (summarise(outcomes, name) for name in names):
        rows.append(
            f"| {s.law} | {s.ratio_median:.3f} | {s.ratio_p95:.3f} | {s.ratio_worst:.3f} "
            f"| {s.trials_above_naive:.1%} | {s.peak_median:.2f} | {s.felt_median:.3f} "
            f"| {s.felt_p95:.3f} | {s.stiffness_median:.2f} | {s.limit_cycles} of {s.rigs} "
            f"| {s.active} of {s.rigs} | {s.energy_worst:+.1%} "
            f"| {s.energy_to_friction:+.1%} | {s.slack_median:.1%} "
            f"| {s.fallback:.1%} | {s.stopped} |"
        )
    return "\n".join(rows) + "\n"


def _tasks(outcomes: Sequence[Outcome], names: Sequence[str]) -> str:
    tasks = [task.name for task in TASKS if any(o.task == task.name for o in outcomes)]
    rms = {(o.seed, o.task, o.law): o.rms_nm for o in outcomes}
    seeds = {task: sorted({o.seed for o in outcomes if o.task == task}) for task in tasks}
    rows = ["| law | " + " | ".join(tasks) + " |", "| --- |" + " ---: |" * len(tasks)]
    for name in names:
        medians = [
            np.median([rms[s, task, name] / rms[s, task, NAIVE.name] for s in seeds[task]])
            for task in tasks
        ]
        rows.append(f"| {name} | " + " | ".join(f"{m:.3f}" for m in medians) + " |")
    return "\n".join(rows) + "\n"


def _rigs(outcomes: Sequence[Outcome]) -> int:
    return len({o.seed for o in outcomes})


def _by_rig(outcomes: Sequence[Outcome], law: str) -> dict[int, list[Outcome]]:
    found: dict[int, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.law == law:
            found.setdefault(outcome.seed, []).append(outcome)
    return found


def _pooled(outcomes: Sequence[Outcome]) -> float:
    return math.sqrt(sum(o.rms_nm**2 for o in outcomes))


def _most(values: Sequence[float]) -> float:
    return max((v for v in values if not math.isnan(v)), default=float("nan"))
