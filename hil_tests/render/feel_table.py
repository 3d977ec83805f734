"""The figures of the benchmark of feel: a law's on a plant, a task's of a law.

Input: outcomes of every law on the same rigs and tasks. Output: numbers, and cells in Markdown for
`feel_page` and `feel_task_page`. Medians and 95th percentiles over rigs have percentile intervals
(95 %, bootstrap), shares Wilson's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from hil_tests.render.laws import NAIVE
from hil_tests.render.tasks import TASKS
from hil_tests.render.trial import Outcome

ACTIVE_ABOVE: Final = 0.01  # of what a path exchanges
REDRIVEN_ABOVE: Final = 0.05  # of what the handle had when it was let go
WORSE_BY: Final = 1.01  # times the naive error, and by more than is felt:
FELT_NM: Final = 0.02
RESAMPLED: Final = 2000
Z: Final = 1.96
LIKE: Final = frozenset(task.name for task in TASKS)


def wilson(hits: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a share by Wilson's score."""
    if of == 0:
        return 0.0, 1.0
    p, zz = hits / of, Z * Z / of
    middle, half = p + zz / 2.0, Z * math.sqrt(p * (1.0 - p) / of + zz / (4.0 * of))
    return max((middle - half) / (1.0 + zz), 0.0), min((middle + half) / (1.0 + zz), 1.0)


def interval(values: Sequence[float], q: float) -> tuple[float, float, float]:
    """Return a quantile over rigs and its 95 % percentile interval."""
    if not values:
        return math.nan, math.nan, math.nan
    data = np.array(values)
    drawn = np.random.default_rng(0).choice(data, (RESAMPLED, len(data)))
    low, high = np.percentile(np.quantile(drawn, q, axis=1), [2.5, 97.5])
    return float(np.quantile(data, q)), float(low), float(high)


def pooled_ratios(
    outcomes: Sequence[Outcome], law: str, chosen: Callable[[str], bool]
) -> list[float]:
    """RMS error over the chosen tasks of each rig, over the naive law's."""
    sums: dict[int, list[float]] = {}
    for o in outcomes:
        if chosen(o.task) and o.law in {law, NAIVE.name}:
            both = sums.setdefault(o.seed, [0.0, 0.0])
            both[0] += o.rms_nm**2 if o.law == law else 0.0
            both[1] += o.rms_nm**2 if o.law == NAIVE.name else 0.0
    return [math.sqrt(mine / naive) for mine, naive in sums.values() if naive > 0.0]


def trial_ratios(outcomes: Sequence[Outcome], law: str) -> list[tuple[Outcome, float, float]]:
    """Each trial of a law, its error over the naive law's, and the naive error (N m)."""
    naive = {(o.seed, o.task): o.rms_nm for o in outcomes if o.law == NAIVE.name}
    mine = [(o, naive[o.seed, o.task]) for o in outcomes if o.law == law]
    return [(o, o.rms_nm / n if n > 0.0 else math.nan, n) for o, n in mine]


def is_worse(rms_nm: float, naive_nm: float) -> bool:
    """Return whether a trial is worse than the naive law by more than can be felt."""
    return rms_nm > WORSE_BY * naive_nm and rms_nm > naive_nm + FELT_NM


def is_active(o: Outcome) -> bool:
    """Return whether a closed path gave the operator energy beyond the bound."""
    return (not math.isnan(o.net_energy) and o.net_energy > ACTIVE_ABOVE) or (
        o.turn_energy > ACTIVE_ABOVE
    )


def figures(outcomes: Sequence[Outcome], law: str) -> dict[str, str]:
    """Return a law's figures on a plant, name to cell."""
    trials = trial_ratios(outcomes, law)
    own = [o for o, _, _ in trials]
    like = pooled_ratios(outcomes, law, LIKE.__contains__)
    found = {
        "like tasks, median": quantile_cell(like, 0.5),
        "like tasks, 95th percentile": quantile_cell(like, 0.95),
        "all tasks pooled, median": quantile_cell(pooled_ratios(outcomes, law, bool), 0.5),
    }
    for task in ("tremor", "release", "grasp"):
        ratios = [ratio for o, ratio, _ in trials if o.task == task]
        found[f"{task}, median"] = quantile_cell(ratios, 0.5)
        found[f"{task}, worst"] = f"{max(ratios, default=math.nan):.2f}"
    rest = [o.limit_cycle for o in own if o.task.startswith("rest")]
    free = [o.redriven > REDRIVEN_ABOVE for o in own if not math.isnan(o.redriven)]
    energy = [most_given(o) for o in own]
    return found | {
        "trials worse than naive": _share([is_worse(o.rms_nm, n) for o, _, n in trials]),
        "limit cycles at standstill": _share(rest),
        "free handles driven again": _share(free),
        "trials with an active path": _share([is_active(o) for o in own]),
        "most energy given on a path": f"{max(energy, default=math.nan):+.1%}",
        "drive stopped": _share([o.bridge_off for o in own]),
    }


def most_given(o: Outcome) -> float:
    """Return the most energy given on a closed path of a trial, of what it exchanged."""
    return o.turn_energy if math.isnan(o.net_energy) else max(o.turn_energy, o.net_energy)


def median_of(outcomes: Sequence[Outcome], law: str, task: str) -> tuple[float, float, float]:
    """Return median, 95th percentile and worst error ratio of a law in a task; nan where none."""
    ratios = [ratio for o, ratio, _ in trial_ratios(outcomes, law) if o.task == task]
    if not ratios:
        return math.nan, math.nan, math.nan
    return float(np.median(ratios)), float(np.quantile(ratios, 0.95)), max(ratios)


def best_published(outcomes: Sequence[Outcome], laws: Sequence[str]) -> str | None:
    """Return which of the laws has the lowest median error, all tasks pooled; None of none."""
    medians = {
        law: float(np.median(ratios))
        for law in laws
        if (ratios := pooled_ratios(outcomes, law, bool))
    }
    return min(medians, key=medians.__getitem__) if medians else None


def quantile_cell(values: Sequence[float], q: float) -> str:
    """Write a quantile with its interval."""
    value, low, high = interval(values, q)
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"


def _share(hits: Sequence[bool]) -> str:
    low, high = wilson(sum(hits), len(hits))
    return f"{sum(hits)} of {len(hits)} [{low:.1%}, {high:.1%}]"
