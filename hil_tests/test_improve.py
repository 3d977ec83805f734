"""The rounds of `bowden improve`: when they stop, what they keep, how a broken run goes on."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.demo_diagnosis import LAB_MODEL
from bowden.cli.improve_rounds import Applied, improve
from bowden.diagnosis.rendering import Rendering
from bowden.diagnosis.result import Diagnosis, NamedEffect, Verdict
from bowden.diagnosis.wording import stopped
from bowden.errors import BadInput
from bowden.estimation.gap import Gap
from bowden.estimation.gate.finding import Finding
from bowden.model import Mode, Model, parse_model
from bowden.recording.recording import Recording
from bowden.report.rendering import LawRun

_ZERO = np.zeros(2)
_FIGURES = Rendering(0.1, 0.2, 0.0, 0.0, 1.0)
_FINDING = Finding("unit", "load torque", "zeros", "a load cell", "stop")
_GAP = Gap("load_torque_nm", 0.05, 0.01, 0.01)


def diagnosis_of(verdict: Verdict, model: Model) -> Diagnosis:
    found = stopped(model, Mode.TORQUE_POSITION, (_FINDING,), (), 0)
    effects = (NamedEffect("wrap_angle_change", "Wrap", "", {}, 1.0),) * (verdict == "named")
    return replace(found, verdict=verdict, effects=effects, gap=_GAP)


class QuickBench:
    """Gives one verdict a round; 'named' has a little more friction."""

    def __init__(self, verdicts: Sequence[Verdict], changes: int = 1) -> None:
        self.verdicts: Iterator[Verdict] = iter(verdicts)
        self.changes = changes
        self.applied: list[float] = []
        self.recorded: list[int] = []

    def apply(self, model: Model) -> Applied:
        self.applied.append(round(model.value("friction.mu_d"), 6))
        return Applied(self.changes)

    def record(self, number: int, path: Path) -> LawRun:
        self.recorded.append(number)
        series = Recording(
            np.array([0.0, 1.0]),
            motor_angle_rad=_ZERO,
            load_angle_rad=_ZERO,
            motor_torque_nm=_ZERO,
            load_torque_nm=_ZERO,
        )
        return LawRun("coulomb", series, _FIGURES, path.name, "")

    def diagnose(self, model: Model, run: LawRun) -> Diagnosis:
        del run
        verdict = next(self.verdicts, None)
        if verdict is None:
            raise KeyboardInterrupt
        more = {"friction.mu_d": model.value("friction.mu_d") + 0.01}
        return diagnosis_of(verdict, model.with_values(more) if verdict == "named" else model)


@pytest.mark.parametrize(
    ("verdicts", "changes", "ended", "rounds"),
    [
        (["named", "complete"], 1, "complete", 2),
        (["named"] * 9, 1, "", 4),
        (["named", "unlisted"], 1, "nothing found", 2),
        (["named"] * 9, 0, "nothing for the drive", 1),
        (["bad_data"], 1, "bad data", 1),
    ],
)
def test_rounds_end_where_nothing_is_to_be_gained(
    verdicts: list[Verdict], changes: int, ended: str, rounds: int, tmp_path: Path
) -> None:
    bench = QuickBench(verdicts, changes)
    found = improve(bench, LAB_MODEL, "lab.yaml", tmp_path, rounds=4)
    assert found.state.ended == ended
    assert len(found.state.rounds) == len(bench.recorded) == rounds
    # What no model explains changes nothing in the drive.
    good = sum(one in ("named", "complete") for one in verdicts[:rounds])
    assert len(bench.applied) == 1 + good


def test_a_broken_run_keeps_the_last_good_model_and_goes_on(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        improve(QuickBench(["named"]), LAB_MODEL, "lab.yaml", tmp_path, rounds=3)
    kept = parse_model((tmp_path / "model.yaml").read_text())
    assert kept.value("friction.mu_d") == pytest.approx(0.22)
    again = QuickBench(["complete"])
    found = improve(again, LAB_MODEL, "lab.yaml", tmp_path, rounds=3)
    assert again.recorded == [2]
    assert again.applied[0] == 0.22
    assert [one.verdict for one in found.state.rounds] == ["named", "complete"]
    assert (
        json.loads((tmp_path / "round-2" / "diagnosis.json").read_text())["verdict"] == "complete"
    )
    # Nothing is left to do.
    over = QuickBench([])
    assert improve(over, LAB_MODEL, "lab.yaml", tmp_path, rounds=3).runs == ()
    assert over.applied == over.recorded == []


def test_a_folder_of_another_model_is_refused(tmp_path: Path) -> None:
    improve(QuickBench(["complete"]), LAB_MODEL, "lab.yaml", tmp_path, rounds=1)
    other = LAB_MODEL.replace("0.21", "0.22")
    with pytest.raises(BadInput, match="another model"):
        improve(QuickBench(["complete"]), other, "other.yaml", tmp_path, rounds=1)
