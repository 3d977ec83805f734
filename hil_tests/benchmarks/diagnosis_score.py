"""How an answer of `bowden diagnose` is held against the truth, and the figures of many of them.

Pure functions over plain results: `diagnosis` runs the cases and passes them in. Rates come with
Wilson intervals. A tie that cannot be told apart counts as right if the truth is in it and it has
at most three members.
"""

from __future__ import annotations

import itertools
import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from hil_tests.hidden_effects.recordings import LAW_KINDS, SURFACE

LARGEST_TIE = 3
PERIODIC = ("phase_rad", "load_phase_rad")
NO_EFFECT = "(none)"
UNKNOWN = "(unlisted)"
ALSO_DONE = {"frictional_lag": "presliding_compliance"}  # it unloads over some slip: `cable_law`
STATED = (0.02, 0.2, 0.5, 0.8, 0.95, 1.0)  # edges between which probabilities are pooled


@dataclass(frozen=True)
class Answer:
    """What a method said about one case.

    Parameters
    ----------
    verdict : str
        As in the contracts.
    named : tuple of str
        The effects, or the tie.
    ranking : tuple of str
        Names, best first, each once.
    parameters : dict
        Effect -> parameter -> (value, low, high); empty where the method gives none.
    gap_over_floor : float
        After the diagnosis, held out; nan where the method gives none.
    gap_over_truth : float
        That over what the true model leaves; nan where there is none.
    seconds : float
    laws : tuple of str
        Learned laws that hold 95 % of the probability together, likeliest first.
    law_inside : float
        Share of the law's knots at which the true curve lies inside the 95 % band; nan where it is
        another law.
    odds : dict of str to float
        Probability of each explanation, as the method states it; none where it states none.
    learning_s : float
        Of `seconds`, to learn laws; nan where none was to be learned.
    """

    verdict: str
    named: tuple[str, ...]
    ranking: tuple[str, ...] = ()
    parameters: dict[str, dict[str, tuple[float, float, float]]] = field(default_factory=dict)
    gap_over_floor: float = math.nan
    gap_over_truth: float = math.nan
    seconds: float = math.nan
    laws: tuple[str, ...] = ()
    law_inside: float = math.nan
    odds: dict[str, float] = field(default_factory=dict)
    learning_s: float = math.nan


@dataclass(frozen=True)
class Result:
    """One case with its truth and one method's answer."""

    seed: int
    source: str
    kind: str
    truth: dict[str, dict[str, float]]
    strength: float
    answer: Answer

    @property
    def label(self) -> str:
        """What stands in the confusion matrix's row."""
        return " + ".join(self.truth) if self.truth else NO_EFFECT

    @property
    def said(self) -> str:
        """What stands in its column."""
        if self.answer.verdict == "complete":
            return NO_EFFECT
        if self.answer.verdict == "unlisted":
            return UNKNOWN
        if self.answer.verdict == "insufficient_excitation":
            return "(no excitation)"
        if self.answer.verdict == "bad_data":
            return "(bad data)"
        if self.tied and set(self.truth) & set(self.answer.named):
            return next(iter(self.truth))
        return self.answer.named[0] if self.answer.named else UNKNOWN

    @property
    def tied(self) -> bool:
        """Return whether the answer is a tie that is small enough to count."""
        return self.answer.verdict == "ambiguous" and len(self.answer.named) <= LARGEST_TIE

    @property
    def first(self) -> bool:
        """Return whether the one hidden effect was named first, or is in a small tie."""
        name = next(iter(self.truth))
        if self.tied:
            return name in self.answer.named
        return self.answer.verdict == "named" and self.answer.named[:1] == (name,)

    @property
    def second(self) -> bool:
        """Return whether it is among the first two, of the answer or of the ranking."""
        name = next(iter(self.truth))
        return self.first or name in self.answer.named[:2] or name in self.answer.ranking[:2]

    @property
    def hits(self) -> int:
        """How many of the hidden effects are among those named."""
        if self.answer.verdict not in {"named", "ambiguous"}:
            return 0
        return len(set(self.truth) & set(self.answer.named))

    @property
    def explanation(self) -> frozenset[str]:
        """The truth in the words of the odds."""
        if self.kind in {"unlisted", *LAW_KINDS}:
            return frozenset({"unlisted"})
        return frozenset(self.truth or {"nothing"})

    def is_right(self, explanation: frozenset[str]) -> bool:
        """Return whether an explanation names all that is hidden, and what does nothing else."""
        also = {ALSO_DONE[name] for name in self.truth if name in ALSO_DONE}
        return self.explanation <= explanation <= self.explanation | also

    @property
    def covered(self) -> list[bool]:
        """For each parameter that was given an interval: whether the truth is inside."""
        found = []
        for name, values in self.truth.items():
            given = self.answer.parameters.get(name, {})
            if set(given) != set(values):
                continue
            for parameter, (value, low, high) in given.items():
                true = values[parameter]
                if parameter in PERIODIC:
                    turns = round((true - value) / (2.0 * math.pi))
                    true -= 2.0 * math.pi * turns
                found.append(low <= true <= high)
        return found


@dataclass(frozen=True)
class Rate:
    """Successes among trials, with the Wilson interval at 95 %."""

    hits: float
    trials: int

    @property
    def share(self) -> float:
        """The plain share; nan without trials."""
        return self.hits / self.trials if self.trials else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval."""
        n, z = self.trials, 1.959964
        if n == 0:
            return 0.0, 1.0
        p = self.share
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return max(0.0, middle - half), min(1.0, middle + half)

    @classmethod
    def of_shares(cls, shares: Iterable[float]) -> Rate:
        """Return the mean of shares, each counted as one trial."""
        found = list(shares)
        return cls(float(np.sum(found)), len(found))

    def __str__(self) -> str:
        """Return it as 93 % (80 .. 98, n = 40)."""
        if not self.trials:
            return "-"
        low, high = self.interval
        return f"{100 * self.share:.0f} % ({100 * low:.0f} .. {100 * high:.0f}, n = {self.trials})"


def rate(values: Iterable[bool]) -> Rate:
    """Count."""
    found = list(values)
    return Rate(sum(found), len(found))


def of_kind(results: Sequence[Result], kind: str) -> list[Result]:
    """Those of one kind."""
    return [r for r in results if r.kind == kind]


def _law_rates(what: str, laws: Sequence[Result]) -> dict[str, Rate]:
    """Return the rates over hidden laws; none where there are none."""
    if not laws:
        return {}
    return {
        f"{what}: recognised, with a law": rate(
            r.answer.verdict == "unlisted" and bool(r.answer.laws) for r in laws
        ),
        f"{what}: place and argument right or tied": rate(
            r.label in r.answer.laws[:LARGEST_TIE] for r in laws
        ),
        f"{what}: gap after <= 1.5 floors": rate(r.answer.gap_over_floor <= 1.5 for r in laws),
        f"{what}: true curve inside the band": Rate.of_shares(
            r.answer.law_inside for r in laws if math.isfinite(r.answer.law_inside)
        ),
    }


def rates(results: Sequence[Result]) -> dict[str, Rate]:
    """Return the rates over all kinds that are there."""
    single, pair = of_kind(results, "single"), of_kind(results, "pair")
    several = of_kind(results, "several")
    complete, unlisted = of_kind(results, "complete"), of_kind(results, "unlisted")
    return {
        "single: named first": rate(r.first for r in single),
        "single: among the first two": rate(r.second for r in single),
        "single: called complete": rate(r.answer.verdict == "complete" for r in single),
        "single: called unlisted": rate(r.answer.verdict == "unlisted" for r in single),
        "complete: false alarm": rate(
            r.answer.verdict in {"named", "ambiguous", "unlisted"} for r in complete
        ),
        "unlisted: recognised": rate(r.answer.verdict == "unlisted" for r in unlisted),
        "unlisted: given a name": rate(
            r.answer.verdict in {"named", "ambiguous"} for r in unlisted
        ),
        **_law_rates("smooth law", of_kind(results, "smooth_law")),
        **_law_rates("law of two arguments", of_kind(results, SURFACE)),
        "complete or listed: given a law": rate(
            bool(r.answer.laws) for r in (*single, *complete, *pair)
        ),
        "pair: both named": rate(r.hits == 2 for r in pair),
        "pair: at least one": rate(r.hits >= 1 for r in pair),
        "four moderate: at least three named": rate(r.hits >= 3 for r in several),
        "four moderate: at least two named": rate(r.hits >= 2 for r in several),
        "parameter inside its interval": rate(
            inside for r in single + pair + several for inside in r.covered
        ),
        "gap after <= 1.1 floors": rate(
            r.answer.gap_over_floor <= 1.1
            for r in single
            if r.first and math.isfinite(r.answer.gap_over_floor)
        ),
        "gap after <= 1.1 x what the truth leaves": rate(
            r.answer.gap_over_truth <= 1.1
            for r in single
            if r.first and math.isfinite(r.answer.gap_over_truth)
        ),
    }


def reliability(results: Sequence[Result]) -> list[tuple[float, Rate]]:
    """Return mean stated probability and how often it was right, of explanations alike likely.

    Every explanation of every answer counts, also those that were not chosen.
    """
    stated = [
        (min(share, 1.0), one.is_right(frozenset(names.split(" + "))))  # sums of shares round
        for one in results
        for names, share in one.answer.odds.items()
    ]
    found = []
    for low, high in itertools.pairwise(STATED):
        pooled = [(p, right) for p, right in stated if low < p <= high]
        if pooled:
            mean = float(np.mean([p for p, _ in pooled]))
            found.append((mean, rate(right for _, right in pooled)))
    return found


def median(results: Sequence[Result], of: Callable[[Result], float]) -> float:
    """Median of what is finite; nan without any."""
    found = [x for x in map(of, results) if math.isfinite(x)]
    return statistics.median(found) if found else math.nan


def times(methods: Sequence[Sequence[Result]]) -> Iterator[tuple[str, list[float]]]:
    """Yield what is timed, in words, and each method's figure, s."""
    for kind in dict.fromkeys(r.kind for r in methods[0]):
        alike = [of_kind(results, kind) for results in methods]
        yield f"median time, {kind}, s", [median(one, lambda r: r.answer.seconds) for one in alike]
    yield "slowest, s", [max((r.answer.seconds for r in one), default=math.nan) for one in methods]
    yield (
        "median time to learn a law, s",
        [median(one, lambda r: r.answer.learning_s) for one in methods],
    )


def _right(r: Result, *, second: bool = False) -> bool:
    if r.kind == "single":
        return r.second if second else r.first
    return r.answer.verdict == r.kind


def per_effect(results: Sequence[Result]) -> dict[str, tuple[Rate, Rate, float, str]]:
    """Return per effect: first, first two, median gap over floor, what it was taken for."""
    groups: dict[str, list[Result]] = defaultdict(list)
    for r in results:
        if r.kind in {"single", "unlisted", "complete"}:
            groups[r.label].append(r)
    found = {}
    for name, group in groups.items():
        firsts, seconds = [_right(r) for r in group], [_right(r, second=True) for r in group]
        wrong = Counter(r.said for r, right in zip(group, firsts, strict=True) if not right)
        taken = ", ".join(f"{n} x {k}" if k > 1 else n for n, k in wrong.most_common(3))
        gap = median(group, lambda r: r.answer.gap_over_floor)
        found[name] = (rate(firsts), rate(seconds), gap, taken)
    return found


def confusion(results: Sequence[Result]) -> tuple[list[str], list[str], list[list[int]]]:
    """Return rows (truth), columns (answer) and counts over single, complete and unlisted cases."""
    used = [r for r in results if r.kind not in {"pair", "several"}]
    rows = list(dict.fromkeys(r.label for r in sorted(used, key=lambda r: r.kind)))
    columns = [x for x in rows if any(r.said == x for r in used)]
    columns += [x for x in dict.fromkeys(r.said for r in used) if x not in columns]
    counts = Counter((r.label, r.said) for r in used)
    return rows, columns, [[counts[row, column] for column in columns] for row in rows]


def markdown(methods: dict[str, list[Result]]) -> str:
    """Return the tables: all methods side by side, then each effect for the first method."""
    names = list(methods)
    lines = ["| | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    tables = {name: rates(results) for name, results in methods.items()}
    for row in tables[names[0]]:
        lines.append(f"| {row} | " + " | ".join(str(tables[n][row]) for n in names) + " |")
    for timed, seconds in times([methods[n] for n in names]):
        lines.append(f"| {timed} | " + " | ".join(f"{s:.0f}" for s in seconds) + " |")
    if stated := reliability(methods[names[0]]):
        lines += ["", "| probability stated | right |", "|---|---|"]
        lines += [f"| {100 * mean:.0f} % | {right} |" for mean, right in stated]
    lines += ["", "| truth | named first | first two | gap after / floor | else taken for |"]
    lines.append("|---|---|---|---|---|")
    for effect, (first, second, gap, taken) in per_effect(methods[names[0]]).items():
        lines.append(f"| {effect} | {first} | {second} | {gap:.2f} | {taken} |")
    return "\n".join(lines) + "\n"
