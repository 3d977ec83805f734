"""Progress of a commissioning: a file in its folder, so that an interrupted run continues.

    commissioning: 1
    drive: {node_id: 16, serial_number: 42}
    model_sha256: 3b0c...
    steps:
    - {name: directions, ended: 2026-11-22T09:12:00+00:00, recordings: [directions.blf], ...}

A step is in the file once it is done; what it wrote to the drive stands with it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

from pydantic import Field

from bowden.commission.measures import Measured
from bowden.errors import BadInput
from bowden.recording.yaml_file import FilePart, read_yaml, write_yaml

STATE_FILE = "commissioning.yaml"
WHAT = "where a commissioning stands (bowden commission)"

Verdict = Literal["as stated", "corrected", "mended", "measured"]


class StepFinding(FilePart):
    """One thing that a step looked at.

    Parameters
    ----------
    what : str
        ``"load cell gain"``.
    verdict : str
        ``"as stated"``; ``"corrected"``: written to drive and model; ``"mended"``: by the operator,
        who was told what to do; ``"measured"``: nothing had been stated.
    found : str
        In words and numbers, with what was stated before.
    value, low, high : float, optional
        With its 95 % interval, in `unit`.
    """

    what: str
    verdict: Verdict
    found: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""

    @classmethod
    def of(
        cls, what: str, verdict: Verdict, found: str, number: Measured, unit: str
    ) -> StepFinding:
        """Make the finding of a measured number."""
        return cls(
            what=what, verdict=verdict, found=found, unit=unit,
            value=number.value, low=number.low, high=number.high,
        )  # fmt: skip


class DoneStep(FilePart):
    """A step that is over: what it recorded, found and wrote to the drive (names, SI values).

    `facts`: what the operator said of the rig that it took, by name.
    """

    name: str
    ended: str
    facts: dict[str, tuple[float, ...]] = Field(default_factory=dict)
    recordings: tuple[str, ...] = ()
    findings: tuple[StepFinding, ...] = ()
    written: dict[str, float] = Field(default_factory=dict)


class DriveIdentity(FilePart):
    """Which drive it is."""

    node_id: int
    serial_number: int


class CommissioningState(FilePart):
    """The whole file."""

    commissioning: Literal[1]
    drive: DriveIdentity
    model_sha256: str
    steps: tuple[DoneStep, ...] = ()

    def done(self, name: str) -> DoneStep | None:
        """Return a step that is done, or None."""
        return next((step for step in self.steps if step.name == name), None)

    @property
    def written(self) -> dict[str, float]:
        """All that was written to the drive so far, the last value of each entry."""
        return {name: value for step in self.steps for name, value in step.written.items()}


def open_state(folder: Path, model: Path, drive: DriveIdentity) -> CommissioningState:
    """Read the progress of a commissioning, or begin one.

    Raises
    ------
    BadInput
        The folder belongs to another drive or another model, or its file is damaged.
    """
    digest = hashlib.sha256(model.read_bytes()).hexdigest()
    path = folder / STATE_FILE
    if not path.exists():
        return CommissioningState(commissioning=1, drive=drive, model_sha256=digest)
    state = read_yaml(path, CommissioningState, WHAT)
    if state.drive != drive:
        found = f"node {state.drive.node_id} with serial number {state.drive.serial_number}"
        accepted = (
            f"the drive that is connected (node {drive.node_id}, serial number "
            f"{drive.serial_number}), or another folder (--output)"
        )
        raise BadInput(str(path), found, accepted)
    if state.model_sha256 != digest:
        accepted = "the model that it began with, or another folder (--output)"
        raise BadInput(str(path), f"a commissioning of another model than {model}", accepted)
    return state


def save_state(folder: Path, state: CommissioningState) -> None:
    """Write it, whole or not at all."""
    write_yaml(folder / STATE_FILE, state)
