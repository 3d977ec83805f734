"""How well each compensation law renders, on rigs drawn at random that the drive's model is not.

    python -m hil_tests.benchmarks --only render
    python -m hil_tests.benchmarks.render --first-seed 1 --rigs 20      while developing

The figures are reported on the seeds from `REPORTED` on; laws are developed on 1 to 999 only. Every
law does the same tasks on the same rigs. Ten of the rigs are also run on the flashed ELF.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from bowden.recording.atomic import replace_whole

from hil_tests.benchmarks.measurement import Figure
from hil_tests.render.document import document
from hil_tests.render.laws import LAWS, NAIVE, OURS, WITHOUT_CELL, Law, law_named
from hil_tests.render.rigs import RenderRig, draw
from hil_tests.render.table import Summary, error_ratios, markdown, summarise
from hil_tests.render.tasks import TASKS, task_named
from hil_tests.render.trial import Outcome, judge, run
from hil_tests.targets.emulated import ELF, EmulatedTarget

REPORTED: Final = 600_000
RIGS: Final = 100
EMULATED_RIGS: Final = 10
EMULATED_TASKS: Final = ("tunnel", "rest-in-wall")
TICK_INTERRUPT: Final = 14
JOBS: Final = 2


def figures() -> list[Figure]:
    """Measure; the tables go to stderr."""
    start_s = time.process_time()
    outcomes = measure(REPORTED, RIGS)
    took_s = time.process_time() - start_s
    simulated_s = RIGS * len(LAWS) * sum(task.duration_s for task in TASKS)
    sys.stderr.write(markdown(outcomes))
    counted = [o for o in outcomes if not o.apart]
    apart = [o for o in outcomes if o.apart]
    context = (
        f"{len({o.seed for o in counted})} of {RIGS} rigs drawn from the seeds {REPORTED} to "
        f"{REPORTED + RIGS - 1}, {len(TASKS)} tasks each, native target"
    )
    found = [f for law in LAWS for f in _law_figures(summarise(counted, law.name), context)]
    if apart:
        for name in (OURS, WITHOUT_CELL):
            worst = summarise(apart, name).ratio_worst
            where = f"{len({o.seed for o in apart})} rigs apart, of the same draw"
            found.append(Figure(f"render.apart.{_key(name)}.ratio_worst", worst, "1", where, "1"))
    speed = Figure(
        "render.realtime_factor",
        simulated_s / took_s,
        "simulated s per s",
        "rig, sensors and natively built drive in one compiled loop, configured over the bus and "
        "measured; of core time",
    )
    return [*found, speed, *_emulated(REPORTED)]


def measure(first_seed: int, rigs: int, laws: Sequence[Law] = LAWS) -> list[Outcome]:
    """Run all tasks with all laws, naive always among them, on rigs of consecutive seeds."""
    chosen = (NAIVE, *(law for law in laws if law != NAIVE))

    def of_a_rig(seed: int) -> list[Outcome]:
        rig = draw(seed)
        return [judge(run(rig, law, task)) for law in chosen for task in TASKS]

    outcomes: list[Outcome] = []
    with ThreadPoolExecutor(JOBS) as pool:
        seeds = range(first_seed, first_seed + rigs)
        for found in _told(pool.map(of_a_rig, seeds), rigs):
            outcomes += found
    return outcomes


def _told(results: Iterator[list[Outcome]], count: int) -> Iterator[list[Outcome]]:
    """Pass results on and say on stderr how far it is."""
    start = time.monotonic()
    for done, found in enumerate(results, 1):
        left_s = (time.monotonic() - start) / done * (count - done)
        sys.stderr.write(f"\r  {done} of {count} rigs, {left_s:.0f} s left ")
        sys.stderr.flush()
        yield found
    sys.stderr.write("\n")


def _key(law: str) -> str:
    return law.replace("-", "_")


def _law_figures(s: Summary, context: str) -> list[Figure]:
    goals = {OURS: ("0.12", "0.35", "1"), WITHOUT_CELL: ("0.20", "0.35", "1")}
    median, p95, worst = goals.get(s.law, ("", "", ""))
    ours = s.law in goals
    rows = (
        ("ratio_median", s.ratio_median, "1", median),
        ("ratio_p95", s.ratio_p95, "1", p95),
        ("ratio_worst", s.ratio_worst, "1", worst),
        ("trials_worse_than_naive", s.trials_above_naive, "1", "0" if ours else ""),
        ("peak_ratio_median", s.peak_median, "1", ""),
        ("felt_friction_median", s.felt_median, "1", "0.10" if ours else ""),
        ("felt_friction_p95", s.felt_p95, "1", ""),
        ("stiffness_median", s.stiffness_median, "1", ""),
        ("limit_cycles", float(s.limit_cycles), "rigs", "0" if ours else ""),
        ("active_paths", float(s.active), "rigs", "0" if ours else ""),
        ("net_energy_worst", s.energy_worst, "1", "0.01" if ours else ""),
        ("net_energy_to_friction_worst", s.energy_to_friction, "1", ""),
        ("slack_median", s.slack_median, "1", ""),
    )
    return [
        Figure(f"render.{_key(s.law)}.{name}", value, unit, context, goal)
        for name, value, unit, goal in rows
    ]


def _emulated(first_seed: int) -> list[Figure]:
    """Ten rigs on the flashed ELF: error ratio to the naive native drive, worst tick."""
    if not ELF.is_file():
        sys.stderr.write(f"  skipped: {ELF} is missing; run 'make firmware'\n")
        return []
    outcomes, worst = [], 0
    for seed in range(first_seed, first_seed + EMULATED_RIGS):
        rig = draw(seed)
        for name in EMULATED_TASKS:
            outcome, instructions = _on_the_chip(rig, name)
            outcomes += [outcome, judge(run(rig, NAIVE, task_named(name)))]
            worst = max(worst, instructions)
    ratios = sorted(error_ratios(outcomes, OURS).values())
    context = (
        f"{EMULATED_RIGS} rigs from seed {first_seed} on, {' and '.join(EMULATED_TASKS)}, the "
        "flashed ELF on the emulated chip"
    )
    middle = 0.5 * (ratios[(len(ratios) - 1) // 2] + ratios[len(ratios) // 2])
    return [
        Figure("render.emulated.ratio_median", middle, "1", context, "0.12"),
        Figure("render.emulated.ratio_worst", ratios[-1], "1", context, "1"),
        Figure(
            "render.emulated.worst_instructions", float(worst), "instructions", context, "14000"
        ),
    ]


def _on_the_chip(rig: RenderRig, task: str) -> tuple[Outcome, int]:
    target = EmulatedTarget(
        motor_counts_per_turn=rig.rig.sensing.motor_counts_per_turn,
        load_counts_per_turn=rig.rig.sensing.load_counts_per_turn,
    )
    chip = target.chip
    outcome = judge(run(rig, law_named(OURS), task_named(task), target, chip.reset_accounts))
    return outcome, chip.account(TICK_INTERRUPT).worst_exclusive


def main() -> int:
    """Run and write the tables; for developing, and for the table in the docs."""
    parser = argparse.ArgumentParser(prog="python -m hil_tests.benchmarks.render")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--rigs", type=int, default=10)
    parser.add_argument("--law", action="append", help="repeatable; default: all of them")
    parser.add_argument("--chip", action="store_true", help="ten rigs on the flashed ELF as well")
    parser.add_argument("--output", type=Path, metavar="OUT.md", help="default: stdout")
    options = parser.parse_args()
    try:
        laws = [law_named(name) for name in options.law] if options.law else list(LAWS)
    except ValueError as error:
        parser.error(str(error))
    outcomes = measure(options.first_seed, options.rigs, laws)
    _tell_worst(outcomes)
    if options.output is None:
        sys.stdout.write(markdown(outcomes))
        return 0
    chip = {f.name: f.value for f in _emulated(options.first_seed)} if options.chip else {}
    text = document(outcomes, options.first_seed, options.rigs, chip)
    with replace_whole(options.output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return 0


def _tell_worst(outcomes: Sequence[Outcome]) -> None:
    """List on stderr the rigs and tasks that fail."""
    naive = {(o.seed, o.task): o.rms_nm for o in outcomes if o.law == NAIVE.name}
    for o in outcomes:
        if o.law not in {OURS, WITHOUT_CELL}:
            continue
        ratio = o.rms_nm / naive[o.seed, o.task]
        found = []
        if ratio > 0.5:
            found.append(f"error ratio {ratio:.2f}")
        if o.limit_cycle:
            found.append("limit cycle")
        if o.net_energy > 0.01:
            found.append(f"net energy {o.net_energy:.1%}")
        if o.bridge_off:
            found.append("bridge off")
        if o.fallback > 0.0:
            found.append(f"fell back {o.fallback:.0%} of the time")
        if found:
            apart = " (apart)" if o.apart else ""
            sys.stderr.write(f"  seed {o.seed}{apart} {o.law} {o.task}: {', '.join(found)}\n")


if __name__ == "__main__":
    sys.exit(main())
