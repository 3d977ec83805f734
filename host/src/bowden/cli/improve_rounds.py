"""The rounds of `bowden improve`: record with compensation, diagnose from the posterior, apply.

Knows the order, when to stop and what is kept; how a drive records and takes a model, and how a
recording is diagnosed, comes in as `Bench`. Each round is kept in its own folder and stands in
`STATE_FILE` once its model is in the drive, so that the same command goes on where one was broken
off.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from bowden.cli.output import plain
from bowden.diagnosis.result import Diagnosis
from bowden.errors import BadInput
from bowden.model import Model, format_model, parse_model
from bowden.recording.atomic import replace_whole
from bowden.recording.yaml_file import FilePart, read_yaml, write_yaml
from bowden.report.diagnosis import diagnosis_report
from bowden.report.rendering import LawRun

STATE_FILE = "improve.yaml"
MODEL_FILE = "model.yaml"
_WHAT = "where an improvement stands (bowden improve)"

#: Verdicts whose model explains the recording better than the one before it, or as well.
USABLE = ("complete", "named", "ambiguous")

Ended = Literal["", "complete", "nothing found", "nothing for the drive", "bad data"]


class Round(FilePart):
    """A round that is over; gaps are those of the verdict's channel, on held-out samples.

    Parameters
    ----------
    verdict, sentence, quantity : str
    gap_before, gap_after, noise_floor : float
        In the unit of `quantity`.
    rendering_error_nm : float, N m
        RMS at the load, with the model that the drive had while it recorded.
    effects : tuple of str
        Those of the verdict; ``learned`` for a learned law.
    changed : int
        Entries of the drive that its model changed.
    left_out : tuple of str
        What of the model the drive cannot run.
    """

    verdict: str
    sentence: str
    quantity: str
    gap_before: float | None
    gap_after: float | None
    noise_floor: float | None
    rendering_error_nm: float
    effects: tuple[str, ...] = ()
    changed: int = 0
    left_out: tuple[str, ...] = ()


class ImproveState(FilePart):
    """The whole file: the model that it began with, the rounds, and why it ended."""

    improve: Literal[1] = 1
    model_sha256: str
    rounds: tuple[Round, ...] = ()
    ended: Ended = ""


@dataclass(frozen=True)
class Applied:
    """What a drive took of a model: entries that changed, and what it cannot run."""

    changed: int
    left_out: tuple[str, ...] = ()


class Bench(Protocol):
    """What a round needs of a rig and of the diagnosis."""

    def apply(self, model: Model) -> Applied:
        """Write a model, reduced to what the drive supports, to the drive."""

    def record(self, number: int, path: Path) -> LawRun:
        """Record the tunnel with compensation, from 1 on; the bridge is off afterwards."""

    def diagnose(self, model: Model, run: LawRun) -> Diagnosis:
        """Find what the model lacks to explain the recording."""


@dataclass(frozen=True)
class Improvement:
    """What came out.

    Parameters
    ----------
    state : ImproveState
    runs : tuple of LawRun
        The recordings of this call.
    diagnoses : tuple of Diagnosis
        One of each.
    """

    state: ImproveState
    runs: tuple[LawRun, ...]
    diagnoses: tuple[Diagnosis, ...]


def improve(
    bench: Bench,
    text: str,
    source: str,
    folder: Path,
    rounds: int,
    *,
    tell: Callable[[str], None] = lambda _: None,
) -> Improvement:
    """Go through the rounds that are not done yet.

    Parameters
    ----------
    bench : Bench
    text, source : str
        The model file to begin with, and its name for messages.
    folder : Path
        Made where it is not there. At any time `MODEL_FILE` in it is the model in the drive.
    rounds : int
        At most, those that are done included.
    tell : callable, optional
        Is told what happens.

    Raises
    ------
    BadInput
        A folder of another model, or a damaged one.
    DriveFailed
    """
    state = open_state(folder, text)
    model = parse_model(text, source)
    if state.rounds:
        model = _read_model(folder / MODEL_FILE)
        tell(f"{len(state.rounds)} rounds are done; going on with {folder / MODEL_FILE}")
    folder.mkdir(parents=True, exist_ok=True)
    runs: list[LawRun] = []
    diagnoses: list[Diagnosis] = []
    if not state.ended and len(state.rounds) < rounds:
        bench.apply(model)
        _write(folder / MODEL_FILE, format_model(model))
    while not state.ended and (number := len(state.rounds) + 1) <= rounds:
        here = folder / f"round-{number}"
        here.mkdir(exist_ok=True)
        run = bench.record(number, here / "recording.blf")
        found = bench.diagnose(model, run)
        _keep(found, here)
        applied = Applied(0)
        if usable(found):
            applied = bench.apply(found.model)
            model = found.model
            _write(folder / MODEL_FILE, format_model(model))
        state = _with_round(state, run, found, applied)
        write_yaml(folder / STATE_FILE, state)
        runs.append(run)
        diagnoses.append(found)
    return Improvement(state, tuple(runs), tuple(diagnoses))


def usable(found: Diagnosis) -> bool:
    """Return whether a diagnosis has a model for the drive."""
    return found.verdict in USABLE or found.learned is not None


def _with_round(
    state: ImproveState, run: LawRun, found: Diagnosis, applied: Applied
) -> ImproveState:
    names = ["learned"] if found.learned else [one.name for one in found.effects]
    gap = found.gap
    one = Round(
        verdict=found.verdict,
        sentence=found.sentence,
        quantity=gap.quantity,
        gap_before=_finite(gap.before),
        gap_after=_finite(gap.after),
        noise_floor=_finite(gap.noise_floor),
        rendering_error_nm=run.figures.rms_error_nm,
        effects=tuple(names),
        changed=applied.changed,
        left_out=applied.left_out,
    )
    ended: Ended = ""
    if found.verdict == "complete":
        ended = "complete"
    elif found.verdict == "bad_data":
        ended = "bad data"
    elif not usable(found):
        ended = "nothing found"
    elif not applied.changed:
        ended = "nothing for the drive"
    return state.model_copy(update={"rounds": (*state.rounds, one), "ended": ended})


def open_state(folder: Path, text: str) -> ImproveState:
    """Read where an improvement stands, or begin one."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    path = folder / STATE_FILE
    if not path.exists():
        return ImproveState(model_sha256=digest)
    state = read_yaml(path, ImproveState, _WHAT)
    if state.model_sha256 != digest:
        accepted = "the model that it began with, or another folder (--output)"
        raise BadInput(str(path), "rounds with another model file", accepted)
    return state


def in_words(state: ImproveState) -> str:
    """Say how it ended and what it brought."""
    rounds = state.rounds
    why = {
        "": f"{len(rounds)} rounds done; the last model is in the drive, not yet recorded with",
        "complete": "the gap is at the noise floor",
        "nothing found": "something is missing that no model explains",
        "nothing for the drive": "the drive can take nothing of what was found",
        "bad data": "the recording cannot be trusted",
    }[state.ended]
    errors = [one.rendering_error_nm for one in rounds]
    if len(errors) < 2:
        return f"{why}."
    return (
        f"{why}. The rendered torque was {1e3 * errors[0]:.3g} mN m RMS from the wanted one in "
        f"round 1, {1e3 * errors[-1]:.3g} mN m in round {len(errors)}."
    )


def _keep(found: Diagnosis, folder: Path) -> None:
    document = json.dumps(plain(found.to_document()), indent=2, ensure_ascii=False)
    _write(folder / "diagnosis.json", document + "\n")
    _write(folder / "diagnosis.html", diagnosis_report(found, {}))
    _write(folder / "found.yaml", format_model(found.model))


def _write(path: Path, text: str) -> None:
    with replace_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _read_model(path: Path) -> Model:
    try:
        return parse_model(path.read_text(encoding="utf-8"), source=str(path))
    except OSError as error:
        accepted = "the model of the last round, or another folder (--output)"
        raise BadInput(str(path), error.strerror or str(error), accepted) from error


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None  # NaN compares false
