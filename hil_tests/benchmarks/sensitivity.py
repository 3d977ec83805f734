"""How a diagnosis depends on its constants: `python -m hil_tests.benchmarks.sensitivity --seed N`.

Cases of the hidden-effect benchmark, shorter ones, are diagnosed with each constant of the decision
path (`decision_constants`) as it is, at half and at double. Steps of the search that a constant
does not reach are not repeated (`remembered`). The table goes to --page after every case.
Developing seeds are below 1000; interrupted, it keeps what is done.
"""

from __future__ import annotations

import argparse
import datetime
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np
from bowden.diagnosis.candidates import Candidate, candidates
from bowden.diagnosis.material import Material, make_material
from bowden.diagnosis.search import search
from bowden.diagnosis.verdict import decide, stated
from bowden.model import Mode, Model, parse_model
from bowden.recording.atomic import replace_whole
from bowden.workers import workers

from hil_tests.benchmarks.decision_constants import ODDS, OUTSIDE, Constant, Numbers, constants
from hil_tests.benchmarks.diagnosis import Job, excited, jobs, recordings_of
from hil_tests.benchmarks.remembered import Memory
from hil_tests.benchmarks.side_by_side import each

FACTORS: Final = (0.5, 2.0)
KINDS: Final = ("single", "complete", "unlisted", "pair", "single", "several")  # in turn
PAGE: Final = """\
# The constants of a diagnosis

Written by `{command}`; do not edit.

Version {version}, {date}, seed {seed}: {count} of {asked} cases of {length:g} s at 1 kHz ({kinds}),
recorded by the independent solver (`hil_tests/hidden_effects`). Each constant in the decision
path of `bowden.diagnosis` is halved and doubled, all others as they are. Whole numbers round half
up; a share ({odds}) is scaled by its odds. With the constants as they are the verdicts were:
{verdicts}.

- **changed**: verdicts, or names with them, that differ from those with the constant as it is.
- **probability**: the largest change of the stated probability of any explanation in any case.
- **time**: of search and verdict over that with the constant as it is, CPU seconds of all cases.

Not in the table: {outside}.

{header}
{rows}

In these cases neither a verdict nor a probability (to 0.005) changes with {idle}.
"""
HEADER: Final = (
    "| constant | value | what it bounds | changed x 0.5 | x 2 | probability x 0.5 | x 2 "
    "| time x 0.5 | x 2 |\n|---|---|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True)
class Stated:
    """What is said of a case.

    Parameters
    ----------
    verdict : str
    names : tuple of str
    odds : dict of str to float
    seconds : float
        CPU time of the search and the verdict.
    """

    verdict: str
    names: tuple[str, ...]
    odds: dict[str, float]
    seconds: float

    def differs(self, other: Stated) -> bool:
        """Whether the verdict or the names that come with it differ."""
        return (self.verdict, set(self.names)) != (other.verdict, set(other.names))

    def odds_moved(self, other: Stated) -> float:
        """Return the largest change of the probability of an explanation."""
        every = self.odds.keys() | other.odds.keys()
        return max(abs(self.odds.get(one, 0.0) - other.odds.get(one, 0.0)) for one in every)


@dataclass(frozen=True)
class Tried:
    """One case with the constants as they are, and with each changed.

    Parameters
    ----------
    kind : str
    usual : Stated
    changed : dict of (str, str, float) to Stated
        By module, name and factor.
    """

    kind: str
    usual: Stated
    changed: dict[tuple[str, str, float], Stated]


def diagnosed(
    material: Material, model: Model, every: Sequence[Candidate], seed: int, memory: Memory
) -> Stated:
    """Diagnose, with what the memory has of earlier searches of the same case."""
    began, saved = time.process_time(), memory.saved_s
    try:
        found = search(material, model, every, seed=seed)
        decision = decide(found)
        verdict: str = stated(decision, found)
    except (ValueError, ArithmeticError, LookupError, np.linalg.LinAlgError) as error:
        return Stated(f"failed: {error}", (), {"failed": 1.0}, time.process_time() - began)
    seconds = time.process_time() - began + memory.saved_s - saved
    names = tuple(one.name for one in decision.effects)
    return Stated(verdict, names, decision.odds, seconds)


def tried(job: Job) -> Tried | None:
    """Diagnose one case with each constant changed; None where no rig can be drawn."""
    try:
        case = excited(job)
    except ArithmeticError:
        return None
    model, every, memory = parse_model(case.model_yaml), candidates(), Memory()
    changes: list[tuple[Constant, float]] = [(one, f) for one in constants() for f in FACTORS]
    with workers(1) as pool:
        mode = Mode.TORQUE_POSITION
        material = make_material(recordings_of(case), model, mode, job.seed, pool)
        diagnosed(material, model, every, job.seed, memory)  # compiles what is compiled on demand
        with memory.used():
            usual = diagnosed(material, model, every, job.seed, memory)
            found = {}
            for one, factor in changes:
                value = one.scaled(factor)
                with nullcontext() if _is_same(value, one.value) else one.set_to(value):
                    answer = diagnosed(material, model, every, job.seed, memory)
                found[one.module, one.name, factor] = answer
                sys.stderr.write(f"  {one.module}.{one.name} x {factor:g}: {answer.verdict}\n")
    return Tried(job.kind, usual, found)


def _is_same(one: Numbers, other: Numbers) -> bool:
    return bool(np.all(np.asarray(one) == np.asarray(other)))


def page(found: Sequence[Tried], command: str, seed: int, asked: int, length_s: float) -> str:
    """Return the documentation's page; of so many cases as were asked for, those that are done."""
    every = constants()
    idle = [one for one in every if _is_idle(one, found)]
    return PAGE.format(
        command=command,
        version=version("bowden"),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        seed=seed,
        count=len(found),
        asked=asked,
        length=length_s,
        kinds=", ".join(f"{n} {kind}" for kind, n in Counter(one.kind for one in found).items()),
        odds=", ".join(f"`{name}`" for name in ODDS),
        verdicts=", ".join(
            f"{n} {verdict}" for verdict, n in Counter(one.usual.verdict for one in found).items()
        ),
        outside="; ".join(f"`{module}` ({why})" for module, why in OUTSIDE.items()),
        header=HEADER,
        rows="\n".join(row(one, found) for one in every),
        idle=", ".join(f"`{one.module}.{one.name}`" for one in idle) or "none of them",
    )


def row(one: Constant, found: Sequence[Tried]) -> str:
    """Return a constant's row."""
    usual = sum(case.usual.seconds for case in found)
    cells: dict[str, list[str]] = {"changed": [], "moved": [], "time": []}
    for factor in FACTORS:
        pairs = [(case.changed[one.module, one.name, factor], case.usual) for case in found]
        cells["changed"].append(f"{sum(a.differs(b) for a, b in pairs)} of {len(pairs)}")
        cells["moved"].append(f"{max(a.odds_moved(b) for a, b in pairs):.2f}")
        cells["time"].append(f"{sum(a.seconds for a, _ in pairs) / usual:.2f}")
    figures = [*cells["changed"], *cells["moved"], *cells["time"]]
    return f"| {' | '.join([*heading(one), *figures])} |"


def heading(one: Constant) -> tuple[str, str, str]:
    """Return the cells of a constant's row that no figure is in."""
    return f"`{one.module}.{one.name}`", _in_words(one.value), one.bounds


def _is_idle(one: Constant, found: Sequence[Tried]) -> bool:
    pairs = [(t.changed[one.module, one.name, f], t.usual) for t in found for f in FACTORS]
    return all(not a.differs(b) and a.odds_moved(b) < 0.005 for a, b in pairs)


def _in_words(value: Numbers) -> str:
    every = np.atleast_1d(np.asarray(value, dtype=float))
    if every.size > 5:
        return f"{every[0]:g} .. {every[-1]:g} ({every.size})"
    return ", ".join(f"{x:g}" for x in every)


def cases(seed: int, count: int, length_s: float) -> list[Job]:
    """Return a balanced set: the kinds in turn."""
    left = jobs(seed, 1 + count // len(KINDS), [], Job(seed, "", (), length_s))
    found = []
    for k in range(count):
        one = next(job for job in left if job.kind == KINDS[k % len(KINDS)])
        left.remove(one)
        found.append(one)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.sensitivity",
        description=(__doc__ or "").split("\n")[0],
        epilog="example: --seed 7 --cases 6 --page docs/diagnosis-constants.md",
    )
    parser.add_argument("--seed", type=int, required=True, help="developing seeds: below 1000")
    parser.add_argument("--cases", type=int, default=6, help="(default: %(default)s)")
    parser.add_argument("--length-s", type=float, default=12.0, help="(default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="cases at the same time")
    parser.add_argument("--page", type=Path, default=Path("build/diagnosis-constants.md"))
    args = parser.parse_args(arguments)
    command = (
        f"python -m hil_tests.benchmarks.sensitivity --seed {args.seed} --cases {args.cases} "
        f"--length-s {args.length_s:g} --page {args.page}"
    )
    args.page.parent.mkdir(parents=True, exist_ok=True)
    found: list[Tried] = []
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        todo = cases(args.seed, args.cases, args.length_s)
        for one in each(tried, ((job,) for job in todo), args.jobs):
            if one is None:
                continue
            found.append(one)
            with replace_whole(args.page) as temporary:
                temporary.write_text(
                    page(found, command, args.seed, args.cases, args.length_s), encoding="utf-8"
                )
            usual = one.usual
            sys.stderr.write(
                f"{len(found)}/{args.cases} {one.kind}: {usual.verdict} "
                f"{', '.join(usual.names)}, {usual.seconds:.0f} s\n"
            )
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
    return 0 if found else 1


if __name__ == "__main__":
    sys.exit(main())
