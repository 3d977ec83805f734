"""Coverage, ranks and widths of fitted numbers against the truth, and the page that shows them.

Pure functions over `Trial`s, which `calibration_cases` makes. Rates carry Wilson's 95 % interval. A
rank is where the truth lies among the posterior's draws; they are uniform where intervals are
calibrated (Talts et al. 2018, simulation-based calibration).
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from hil_tests.benchmarks.diagnosis_score import Rate, rate

BINS = 10
LEAST_FOR_RANKS = 5 * BINS  # the chi-squared test wants five a bin
INTERVAL = 1.959964  # standard deviations that hold 95 %
GOOD_BLOCK = (0.5, 1.1)  # chi-squared over its count, at the truth


@dataclass(frozen=True)
class Number:
    """One estimated number beside its truth; low and high are None where no interval was given."""

    path: str
    truth: float
    value: float
    low: float | None
    high: float | None

    @property
    def inside(self) -> bool:
        """Return whether the truth is in the interval."""
        return (
            self.low is not None and self.high is not None and self.low <= self.truth <= self.high
        )

    @property
    def score(self) -> float:
        """Truth minus estimate in standard deviations, in the logarithm, by the interval's side."""
        if self.low is None or self.high is None:
            return math.nan
        end = self.high if self.truth > self.value else self.low
        reach = abs(math.log(end / self.value)) / INTERVAL
        away = math.log(self.truth / self.value)
        return away / reach if reach > 0.0 else math.copysign(math.inf, away)

    @property
    def rank(self) -> float:
        """Share of the posterior below the truth, 0..1."""
        return float(stats.norm.cdf(self.score))

    @property
    def half_width(self) -> float:
        """Of the interval, over the value."""
        if self.low is None or self.high is None:
            return math.nan
        return 0.5 * (self.high - self.low) / abs(self.value)


@dataclass(frozen=True)
class Trial:
    """One fit.

    Parameters
    ----------
    rig : int
    setting : str
    rate_hz : float
    recordings : int
    seconds : float
    numbers : tuple of Number
    blocks : tuple of float
        Chi-squared over its count of each block, at the true numbers.
    error : str
        Why there is no fit; empty where there is one.
    """

    rig: int
    setting: str
    rate_hz: float
    recordings: int
    seconds: float = 0.0
    numbers: tuple[Number, ...] = ()
    blocks: tuple[float, ...] = ()
    error: str = ""


@dataclass(frozen=True)
class Row:
    """What the fits of one setting say of one number."""

    setting: str
    path: str
    coverage: Rate
    without: int
    ranks: tuple[int, ...]
    uniform_p: float
    spread: float
    half_width: float


def uniform_p(ranks: Sequence[float]) -> float:
    """Return the probability of ranks as uneven as these if they are uniform; nan with too few."""
    if len(ranks) < LEAST_FOR_RANKS:
        return math.nan
    return float(stats.chisquare(histogram(ranks)).pvalue)


def histogram(ranks: Sequence[float]) -> tuple[int, ...]:
    """Count ranks in equal bins over 0..1."""
    return tuple(int(n) for n in np.histogram(ranks, BINS, (0.0, 1.0))[0])


def rows(trials: Sequence[Trial]) -> list[Row]:
    """Return one row a setting and number, in the order in which they first appear."""
    groups: dict[tuple[str, str], list[Number]] = {}
    for trial in sorted(trials, key=lambda one: one.setting):
        for one in trial.numbers:
            groups.setdefault((trial.setting, one.path), []).append(one)
    found = []
    for (setting, path), every in groups.items():
        given = [one for one in every if one.low is not None]
        ranks = [one.rank for one in given]
        scores = [one.score for one in given]
        found.append(
            Row(
                setting,
                path,
                rate(one.inside for one in given),
                len(every) - len(given),
                histogram(ranks),
                uniform_p(ranks),
                math.sqrt(statistics.fmean(z * z for z in scores)) if scores else math.nan,
                statistics.median(one.half_width for one in given) if given else math.nan,
            )
        )
    return found


def good_blocks(trials: Sequence[Trial]) -> Rate:
    """Return the share of blocks whose chi-squared at the truth is what it should be."""
    low, high = GOOD_BLOCK
    return rate(low <= value <= high for trial in trials for value in trial.blocks)


def markdown(trials: Sequence[Trial]) -> str:
    """Return both tables: number by number, then setting by setting."""
    lines = [
        "| fit | number | truth in the 95 % interval | no interval | ranks, ten bins | p uniform "
        "| RMS z | half width |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows(trials):
        p = "-" if math.isnan(row.uniform_p) else f"{row.uniform_p:.2g}"
        ranks = " ".join(str(n) for n in row.ranks)
        lines.append(
            f"| {row.setting} | {row.path.rpartition('.')[2]} | {row.coverage} | {row.without} "
            f"| {ranks} | {p} | {row.spread:.2f} | {100 * row.half_width:.3f} % |"
        )
    lines += [
        "",
        "| fit | fits | good blocks at the truth | median time, s | failed |",
        "|---|---|---|---|---|",
    ]
    for setting in sorted({one.setting for one in trials}):
        mine = [one for one in trials if one.setting == setting]
        done = [one for one in mine if not one.error]
        seconds = f"{statistics.median(one.seconds for one in done):.1f}" if done else "-"
        lines.append(
            f"| {setting} | {len(done)} | {good_blocks(mine)} | {seconds} "
            f"| {len(mine) - len(done)} |"
        )
    return "\n".join(lines) + "\n"
