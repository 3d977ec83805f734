"""The tables of the benchmark of feel: per law, per task, and the worst trial of each task.

Input: runs of every law on the same rigs and tasks, by plant. Output: a page in Markdown. Rigs
whose friction alone takes most of the motor's torque are left out of all but the number of them.
Medians and 95th percentiles over rigs have percentile intervals (95 %, bootstrap), shares Wilson's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Protocol

import numpy as np

from hil_tests.render.laws import LAWS, NAIVE
from hil_tests.render.rigs import draw
from hil_tests.render.tasks import TASKS
from hil_tests.render.trial import Outcome

ACTIVE_ABOVE: Final = 0.01  # of what a path exchanges
REDRIVEN_ABOVE: Final = 0.05  # of what the handle had when it was let go
WORSE_BY: Final = 1.01  # times the naive error, and by more than is felt:
FELT_NM: Final = 0.02
RESAMPLED: Final = 2000
Z: Final = 1.96
LIKE: Final = frozenset(task.name for task in TASKS)


class Ran(Protocol):
    """What a row is made from."""

    @property
    def outcome(self) -> Outcome:
        """Figures of the trial."""

    @property
    def bound_nm(self) -> float:
        """Error that no drive can stay below; 0 where nothing is known."""


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


def page(runs: Mapping[str, Sequence[Ran]], laws: Sequence[str], seeds: Sequence[int]) -> str:
    """Write the page.

    Parameters
    ----------
    runs : mapping of str to sequence
        By plant.
    laws : sequence of str
    seeds : sequence of int
    """
    parts = [
        f"# Feel: the benchmark\n\nRigs drawn from the seeds {seeds[0]} to {seeds[-1]}. The error "
        "is the RMS of torque on the load less wanted torque; naive is 1. In brackets 95 % "
        "intervals.\n"
    ]
    for plant, found in runs.items():
        counted = [r for r in found if not r.outcome.apart]
        rigs = {r.outcome.seed for r in counted}
        apart = {r.outcome.seed for r in found} - rigs
        parts.append(
            f"## Plant: {plant}\n\n{len(rigs)} rigs whose motor can do it; {len(apart)} left out, "
            "whose friction alone takes most of the motor.\n"
        )
        if counted:
            outcomes = [r.outcome for r in counted]
            real = [law for law in laws if any(law == x.name for x in LAWS)]
            parts += [_laws(outcomes, laws), _tasks(counted, laws), _worst(outcomes, real)]
    return "\n".join(parts)


def _quantile(values: Sequence[float], q: float) -> str:
    value, low, high = interval(values, q)
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"


def _share(hits: Sequence[bool]) -> str:
    low, high = wilson(sum(hits), len(hits))
    return f"{sum(hits)} of {len(hits)} [{low:.1%}, {high:.1%}]"


def _laws(outcomes: Sequence[Outcome], laws: Sequence[str]) -> str:
    """Write a row a figure, a column a law."""
    rows: dict[str, list[str]] = {}

    def put(name: str, text: str) -> None:
        rows.setdefault(name, []).append(text)

    shown = [law for law in laws if law != NAIVE.name]
    for law in shown:
        trials = trial_ratios(outcomes, law)
        own = [o for o, _, _ in trials]
        like = pooled_ratios(outcomes, law, LIKE.__contains__)
        put("like tasks, median", _quantile(like, 0.5))
        put("like tasks, 95th percentile", _quantile(like, 0.95))
        put("all tasks pooled, median", _quantile(pooled_ratios(outcomes, law, bool), 0.5))
        for task in ("tremor", "release", "grasp"):
            ratios = [ratio for o, ratio, _ in trials if o.task == task]
            put(f"{task}, median", _quantile(ratios, 0.5))
            put(f"{task}, worst", f"{max(ratios, default=math.nan):.2f}")
        put("trials worse than naive", _share([is_worse(o.rms_nm, n) for o, _, n in trials]))
        rest = [o.limit_cycle for o in own if o.task.startswith("rest")]
        put("limit cycles at standstill", _share(rest))
        free = [o.redriven > REDRIVEN_ABOVE for o in own if not math.isnan(o.redriven)]
        put("free handles driven again by over 5 %", _share(free))
        put("trials with an active path", _share([is_active(o) for o in own]))
        energy = [max(o.turn_energy, o.net_energy) for o in own if not math.isnan(o.net_energy)]
        put("most energy given on a path", f"{max(energy, default=math.nan):+.1%}")
        put("drive stopped", _share([o.bridge_off for o in own]))
    head = "| figure | " + " | ".join(shown) + " |\n| --- |" + " ---: |" * len(shown)
    lines = [f"| {name} | " + " | ".join(cells) + " |" for name, cells in rows.items()]
    return "\n".join([head, *lines]) + "\n"


def _tasks(runs: Sequence[Ran], laws: Sequence[str]) -> str:
    """Median ratio, task by task, and what waves alone make."""
    outcomes = [r.outcome for r in runs]
    shown = [law for law in laws if law != NAIVE.name]
    lines = [
        "| task, median ratio | " + " | ".join(shown) + " | wave bound |",
        "| --- |" + " ---: |" * (len(shown) + 1),
    ]
    for task in dict.fromkeys(o.task for o in outcomes):
        cells = []
        for law in shown:
            ratios = [ratio for o, ratio, _ in trial_ratios(outcomes, law) if o.task == task]
            cells.append(f"{np.median(ratios):.3f}" if ratios else "")
        naive = [r for r in runs if r.outcome.task == task and r.outcome.law == NAIVE.name]
        bounds = [r.bound_nm / r.outcome.rms_nm for r in naive if r.outcome.rms_nm > 0.0]
        cells.append(f"{np.median(bounds):.3f}" if any(bounds) else "")
        lines.append(f"| {task} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _worst(outcomes: Sequence[Outcome], laws: Sequence[str]) -> str:
    """Write the worst trial of each task, and what rig it is."""
    lines = [
        "| task | law | worst ratio | seed | friction, of the motor's limit | operator | late | "
        "hidden |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for task in dict.fromkeys(o.task for o in outcomes):
        for law in (law for law in laws if law != NAIVE.name):
            trials = [t for t in trial_ratios(outcomes, law) if t[0].task == task]
            if not trials:
                continue
            o, ratio, _ = max(trials, key=lambda t: t[1])
            rig = draw(o.seed)
            lines.append(
                f"| {task} | {law} | {ratio:.2f} | {o.seed} "
                f"| {rig.friction_nm / rig.motor_limit_nm:.0%} "
                f"| {rig.rig.operator.stiffness_nm_per_rad:.0f} N m/rad "
                f"| {0.25 * rig.rig.sensing.load_encoder_delay_ticks:.2g} ms "
                f"| {', '.join(rig.hidden)} |"
            )
    return "\n".join(lines) + "\n"
