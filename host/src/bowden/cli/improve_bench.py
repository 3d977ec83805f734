"""A drive as `improve_rounds` needs it: takes models, records the tunnel, is diagnosed.

Joins what `apply`, `experiment tunnel` and `diagnose` do; asks for consent before each motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from bowden.cli.diagnose import show
from bowden.cli.improve_rounds import Applied, Improvement, in_words
from bowden.cli.output import say, stages
from bowden.cli.tunnel_experiment import SETTLE_S, render, telling_the_law, tunnel_of
from bowden.counted import counted
from bowden.diagnosis.diagnose import diagnose
from bowden.diagnosis.result import Diagnosis
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import reduced_model
from bowden.model import Model
from bowden.recording.atomic import replace_whole
from bowden.recording.enabled import until_disabled
from bowden.report.improvement import Step, improvement_report
from bowden.report.rendering import LawRun

REPORT_FILE = "report.html"


@dataclass(frozen=True)
class DriveBench:
    """A drive, the law that runs on it, and who allows it to move.

    Parameters
    ----------
    drive : Drive
        Its tunnel is configured; the operator moves the load while it renders.
    law : CompensationLaw
    duration_s : float, s
        Of each recording.
    seed : int
        Of the diagnosis.
    consent : callable (round), optional
        Called before each motion; raises where it is not allowed.
    names : sequence of str, optional
        Candidates of the diagnosis; the whole catalogue when absent.
    """

    drive: Drive
    law: CompensationLaw
    duration_s: float
    seed: int
    consent: Callable[[int], None] = lambda _: None
    names: Sequence[str] | None = None

    def apply(self, model: Model) -> Applied:
        """Write a model, reduced to what the drive supports, to the drive."""
        reduced = reduced_model(model)
        changes = difference(self.drive, reduced.entries | {"compensation_law": self.law})
        write(self.drive, changes)
        say(f"{counted(len(changes), 'entry', 'entries')} of the drive changed")
        for one in reduced.left_out:
            say(f"the drive runs without {one}")
        return Applied(len(changes), reduced.left_out)

    def record(self, number: int, path: Path) -> LawRun:
        """Record the tunnel with compensation; the bridge is off afterwards."""
        self.consent(number)
        tunnel = tunnel_of(self.drive)
        with telling_the_law(self.drive):
            run = render(
                self.drive, tunnel, self.duration_s, path, f"round {number}", overwrite=True
            )
        self.drive.nmt("PRE-OPERATIONAL")  # samples are not recorded meanwhile
        return run

    def diagnose(self, model: Model, run: LawRun) -> Diagnosis:
        """Find what the model lacks to explain the recording, but for its first strokes.

        The cables still hold tensions of the round before, and of what was done since.
        """
        with stages("diagnosing") as tell:
            found = diagnose(
                model,
                [until_disabled(run.recording).since(SETTLE_S)],
                seed=self.seed,
                names=self.names,
                progress=tell,
            )
        show(found)
        return found

    def write_page(self, found: Improvement, folder: Path) -> Path | None:
        """Write the page of this call's rounds; None where there were none."""
        if not found.runs:
            return None
        path = folder / REPORT_FILE
        steps = [Step(*one) for one in zip(found.runs, found.diagnoses, strict=True)]
        text = improvement_report(
            steps, tunnel_of(self.drive), SETTLE_S, rig="the drive", finding=in_words(found.state)
        )
        with replace_whole(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return path
