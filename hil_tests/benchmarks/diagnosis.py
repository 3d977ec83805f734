"""The hidden-effect benchmark: `python -m hil_tests.benchmarks.diagnosis --seed N [...]`.

Draws cases (`hil_tests.hidden_effects`, or `hil_tests.rig_cases` with `--source rig`) from the seed
at run time, lets `bowden.diagnosis` and the baselines answer each of them, and writes
build/diagnosis.json, a table and a picture of the confusion matrix beside it. Developing seeds are
below 1000; figures are reported with a seed of 1000 or above that was not used in development.
Interrupted, it writes what it has; `--resume` goes on from there.

Cases whose effect is worth less than 3 noise floors even at the largest plausible magnitude are
redrawn: the recording does not excite them.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from bowden.diagnosis.diagnose import diagnose
from bowden.diagnosis.result import Diagnosis
from bowden.model import Mode, ModelError, parse_model
from bowden.recording.atomic import replace_whole
from bowden.recording.channels import TIME
from bowden.recording.recording import Recording
from pydantic import TypeAdapter, ValidationError

from hil_tests.benchmarks import diagnosis_baselines as baselines
from hil_tests.benchmarks.diagnosis_picture import svg
from hil_tests.benchmarks.diagnosis_score import Answer, Result, markdown
from hil_tests.benchmarks.diagnosis_truth import law_inside, over_truth
from hil_tests.benchmarks.side_by_side import each
from hil_tests.hidden_effects import effects, random_laws, sets, unlisted
from hil_tests.hidden_effects.recordings import LAW_KINDS, SURFACE, Case, draw_case
from hil_tests.hidden_effects.strength import WEAKEST
from hil_tests.rig_cases import cases as rig_cases

OURS = "bowden"
LEARNING, VERDICT = "learning a law that no name fits", "computing the verdict"  # stages
REDRAWS = 5
SOURCES = ("continuum", "rig")


@dataclass(frozen=True)
class Job:
    """One case to draw, and who answers it."""

    seed: int
    kind: str
    names: tuple[str, ...]
    length_s: float = 30.0
    source: str = "continuum"
    recordings: int = 1
    stiction: bool = False


def jobs(seed: int, per_effect: int, only: list[str], alike: Job) -> list[Job]:
    """List the cases as one that is `alike`; rounds over all effects: any part is balanced."""
    rng = np.random.default_rng([seed, 77])
    found: list[tuple[int, str, tuple[str, ...]]] = []
    for k in range(per_effect):
        number = 1000 * seed + k
        found += [(number, "single", (name,)) for name in effects.HIDE]
        found += [(number, "unlisted", (name,)) for name in unlisted.HIDE]
        if alike.source == "continuum" and alike.recordings == 1:
            # The rig's motor has no recorded torque to add one to; a law follows one range.
            found += [(number, "smooth_law", (name,)) for name in random_laws.HIDE]
            if SURFACE in only:
                found += [(number, SURFACE, (name,)) for name in random_laws.SURFACES]
        found += [(number + 100 * i, "complete", ()) for i in range(12)]
        for kind, count in (("pair", 2), ("several", 4)):
            for i in range(8):
                names = rng.choice(list(effects.HIDE), count, replace=False)
                found.append((number + 100 * i, kind, tuple(str(x) for x in names)))
    if only:
        found = [j for j in found if set(only) & {j[1], *j[2]}]
    order = np.random.default_rng([seed, 78]).permutation(len(found))
    chosen = [found[i] for i in order]
    return [replace(alike, seed=number, kind=kind, names=names) for number, kind, names in chosen]


def excited(job: Job) -> Case:
    """Draw the case; again with the next rig and motion while its effect cannot be seen."""
    case: Case | None = None
    for again in range(REDRAWS):
        seed = job.seed + 10_000_000 * again
        try:
            if job.recordings > 1:
                case = sets.draw_set(
                    seed,
                    job.kind,
                    job.names,
                    job.length_s,
                    job.recordings,
                    stiction=job.stiction,
                )
            elif job.source == "rig":
                case = rig_cases.draw_case(seed, job.kind, job.names, job.length_s)
            else:
                case = draw_case(seed, job.kind, job.names, job.length_s, stiction=job.stiction)
        except ArithmeticError:  # the solver has no answer for this rig
            continue
        if job.kind == "complete" or case.truth.strength >= WEAKEST:
            break
    if case is None:
        names = ", ".join(job.names)
        raise ArithmeticError(f"no rig of seed {job.seed} can be solved with {names}")
    return case


def recordings_of(case: Case) -> list[Recording]:
    """Return the case's recordings as a reader would."""
    return [
        Recording(one[TIME], {name: values for name, values in one.items() if name != TIME})
        for one in (case.columns, *case.more)
    ]


def ours(
    found: Diagnosis,
    seconds: float,
    gap_over_truth: float = math.nan,
    inside: float = math.nan,
    learning_s: float = math.nan,
) -> Answer:
    """Reduce a diagnosis to what is scored."""
    gaps = [g for g in found.gaps if g.noise_floor > 0.0]
    parameters = {
        one.name: {k: (v.value, v.low, v.high) for k, v in one.parameters.items()}
        for one in found.effects
    }
    return Answer(
        found.verdict,
        tuple(dict.fromkeys(one.name for one in found.effects)),
        tuple(dict.fromkeys(one.name for one in found.ranking)),
        parameters,
        max((g.after / g.noise_floor for g in gaps), default=math.nan),  # none where data are bad
        gap_over_truth,
        seconds,
        _credible(found.law_odds),
        inside,
        dict(found.odds),
        learning_s,
    )


def _credible(odds: Mapping[str, float]) -> tuple[str, ...]:
    """Return the laws that hold 95 % of the probability together."""
    shares = np.cumsum(list(odds.values()))
    return tuple(odds)[: int(np.searchsorted(shares, 0.95)) + 1]


def run(job: Job) -> tuple[Job, dict[str, Result]]:
    """Draw one case and let every method answer it; nothing where no rig can be drawn."""
    try:
        case = excited(job)
    except ArithmeticError:
        return job, {}
    truth = dict(case.truth.effects)
    model, recordings = parse_model(case.model_yaml), recordings_of(case)

    def result(answer: Answer) -> Result:
        t = case.truth
        return Result(t.seed, t.source, t.kind, truth, t.strength, answer)

    answers: dict[str, Answer] = {}
    since: dict[str, float] = {}

    def tell(stage: str, _share: float) -> None:
        since.setdefault(stage, time.perf_counter())

    start = time.perf_counter()
    try:
        found = diagnose(model, recordings, Mode.TORQUE_POSITION, seed=job.seed, progress=tell)
    except ModelError as error:
        answers[OURS] = Answer(f"failed: {error}", (), seconds=time.perf_counter() - start)
    else:
        seconds = time.perf_counter() - start
        inside = law_inside(case, found) if job.kind in LAW_KINDS else math.nan
        learning_s = since[VERDICT] - since[LEARNING] if LEARNING in since else math.nan
        over = over_truth(case, recordings, found)
        answers[OURS] = ours(found, seconds, over, inside, learning_s)
        if not baselines.missing():
            answers |= baselines.answers(found, recordings[0])
    return job, {method: result(answer) for method, answer in answers.items()}


@dataclass
class Run:
    """What a benchmark has so far: cases that were asked, and each method's results."""

    seed: int
    asked: list[Job]
    results: dict[str, list[Result]]

    def take(self, job: Job, found: Mapping[str, Result]) -> None:
        """Add a case."""
        self.asked.append(job)
        for name, one in found.items():
            self.results.setdefault(name, []).append(one)


def _write(output: Path, done: Run) -> None:
    texts = {output: json.dumps(asdict(done), indent=1) + "\n"}
    if done.results:
        texts |= {
            output.with_suffix(".md"): markdown(done.results),
            output.with_suffix(".svg"): svg(done.results[OURS]),
        }
    for path, text in texts.items():
        with replace_whole(path) as temporary:
            temporary.write_text(text, encoding="utf-8")


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.diagnosis", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--seed", type=int, required=True, help="reporting seeds: 1000 and above")
    parser.add_argument("--cases-per-effect", type=int, default=4, metavar="K")
    parser.add_argument(
        "--source", choices=SOURCES, default="continuum", help="who makes the recordings"
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", help=f"or a kind; {SURFACE} only so"
    )
    parser.add_argument(
        "--recordings",
        type=int,
        choices=range(1, len(sets.MOTIONS) + 1),
        default=1,
        help="of each rig: locked load, tunnel, nested strokes, multisine; 200 Hz .. 2 kHz",
    )
    parser.add_argument(
        "--stiction", action="store_true", help="rigs whose mu_s is above their mu_d"
    )
    parser.add_argument("--length-s", type=float, default=30.0, help="of each recording")
    parser.add_argument("--jobs", type=int, default=1, help="cases at the same time")
    parser.add_argument("--most-minutes", type=float, default=float("inf"))
    parser.add_argument("--output", type=Path, default=Path("build/diagnosis.json"))
    parser.add_argument("--resume", action="store_true", help="go on with the run in --output")
    args = parser.parse_args()
    args.output.parent.mkdir(parents=True, exist_ok=True)
    if args.recordings > 1 and args.source != "continuum":
        parser.error(f"--recordings: found {args.recordings}; accepted with --source rig: 1")
    if args.stiction and args.source != "continuum":
        parser.error(f"--stiction: found --source {args.source}; accepted: --source continuum")
    alike = Job(args.seed, "", (), args.length_s, args.source, args.recordings, args.stiction)
    done = Run(args.seed, [], {})
    if args.resume and args.output.exists():
        try:
            done = TypeAdapter(Run).validate_json(args.output.read_text(encoding="utf-8"))
        except ValidationError as error:
            parser.error(f"--resume: found in {args.output}: {error}; accepted: what a run wrote")
        if done.seed != args.seed:
            parser.error(
                f"--resume: found seed {done.seed} in {args.output}; accepted: {args.seed}"
            )
    every = jobs(args.seed, args.cases_per_effect, args.only, alike)
    todo = [job for job in every if job not in done.asked]
    if lacking := baselines.missing():
        sys.stderr.write(f"no baselines without {', '.join(lacking)}: make setup-baselines\n")
    start = time.monotonic()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        for now, (job, found) in enumerate(each(run, ((job,) for job in todo), args.jobs), 1):
            done.take(job, found)
            _write(args.output, done)
            passed = time.monotonic() - start
            left = passed / now * (len(todo) - now)
            told = f"{len(done.asked)}/{len(every)} left {left / 60:.0f} min | "
            sys.stderr.write(told + (_line(found[OURS]) if found else "no rig could be drawn\n"))
            if passed > 60 * args.most_minutes:
                break
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
    if not done.results:
        return 1
    sys.stdout.write(markdown(done.results))
    return 0


def _line(one: Result) -> str:
    answer = one.answer
    return (
        f"{one.kind} {one.label} x{one.strength:.1f} -> {answer.verdict} {', '.join(answer.named)}"
        f" (gap {answer.gap_over_floor:.2f}, {answer.seconds:.0f} s, seed {one.seed})\n"
    )


if __name__ == "__main__":
    sys.exit(main())
