"""The index page of many diagnoses: a row each, with a link to its page.

Takes what `cli.diagnose_each` has found, returns HTML text. The words are those of its terminal.
"""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from bowden.counted import counted
from bowden.diagnosis.result import Diagnosis
from bowden.digits import interval
from bowden.report.page import Section, items, page, table

HEADER = ("recording", "verdict", "effects", "gap / floor before", "after", "time")


@dataclass(frozen=True)
class DiagnosisRow:
    """One recording's diagnosis in words.

    Parameters
    ----------
    recording : str
    verdict : str
    effects : tuple of str
        Each number with its unit and 95 % interval.
    before, after : str
        Gap over noise floor.
    seconds : float
    problem : str
        What is wrong with data or input.
    page : str or None
        File name of its own page.
    """

    recording: str
    verdict: str
    effects: tuple[str, ...] = ()
    before: str = "–"
    after: str = "–"
    seconds: float = 0.0
    problem: str = ""
    page: str | None = None

    @classmethod
    def of(cls, recording: str, diagnosis: Diagnosis, seconds: float) -> DiagnosisRow:
        """Put a diagnosis in words."""
        effects = tuple(
            f"{effect.name}.{name} = {one.value:.4g} {one.unit} ({interval(one.low, one.high)})"
            for effect in diagnosis.effects
            for name, one in effect.parameters.items()
        )
        gap = diagnosis.gap
        before, after = (
            f"{one / gap.noise_floor:.3g}" if gap.noise_floor > 0.0 else "–"
            for one in (gap.before, gap.after)
        )
        verdict = diagnosis.verdict.replace("_", " ")
        problem = diagnosis.sentence if diagnosis.verdict == "bad_data" else ""
        return cls(recording, verdict, effects, before, after, seconds, problem)

    @property
    def refusal(self) -> str:
        """Recording and problem in one sentence; a message on a file names it already."""
        named = self.problem.startswith(self.recording)
        return self.problem if named or not self.problem else f"{self.recording}: {self.problem}"

    @property
    def lines(self) -> list[tuple[str, ...]]:
        """Its lines of a table: one an effect's number."""
        first, *others = self.effects or ("–",)
        seconds = f"{self.seconds:.0f} s"
        return [
            (self.recording, self.verdict, first, self.before, self.after, seconds),
            *(("", "", one, "", "", "") for one in others),
        ]


def diagnoses_report(rows: Sequence[DiagnosisRow], facts: Mapping[str, str]) -> str:
    """Make the index page.

    Parameters
    ----------
    rows : sequence of DiagnosisRow
    facts : mapping of str to str
        More lines for the small print.
    """
    verdicts = Counter(one.verdict for one in rows)
    lines = [line for one in rows for line in one.lines]
    links = [link for one in rows for link in (one.page, *[None] * (len(one.lines) - 1))]
    problems = [one.refusal for one in rows if one.problem]
    return page(
        "Diagnoses, recording by recording",
        f"{counted(len(rows), 'recording', 'recordings')}, each diagnosed by itself.",
        ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common()) + ".",
        [
            Section("", [table(HEADER, lines, links)]),
            *([Section("Not diagnosed", [items(problems)])] if problems else []),
        ],
        {
            **facts,
            "made with": f"bowden {version('bowden')}, Python {platform.python_version()}",
        },
    )
