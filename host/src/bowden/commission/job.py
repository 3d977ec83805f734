"""What every step of a commissioning works with: drive, model, folder, operator.

`steps` measures through it; `run` makes it and keeps its state.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from bowden.commission.state import StepFinding
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.torque_profile import TorqueProfile
from bowden.model import Model
from bowden.model.model_file import Source
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording

WRITABLE = ("config", "calibration")


class Operator(Protocol):
    """The operator at the rig: confirms each motion and does the manual work."""

    def ask(self, title: str, moves: str, todo: str) -> None:
        """Show a step and wait until it may begin; raises `Declined` where it may not.

        `moves`: what the drive is going to move; empty where its bridge stays off.
        """

    def mend(self, fault: str, todo: str) -> None:
        """Return what is wrong with the rig and wait until it is mended; or `Declined`."""

    def tell(self, finding: StepFinding) -> None:
        """Show what was found."""


class Declined(Exception):  # noqa: N818  (reads as the sentence)
    """The operator ended the commissioning; what is done stays done."""


@dataclass(frozen=True)
class Facts:
    """What only the operator knows.

    Parameters
    ----------
    angle_rad, angle_tolerance_rad : float, rad
        Between two marks of the load, and how well it is known (95 %).
    weights_kg : tuple of float, kg
        To hang on the load one after the other; at least two.
    lever_m : float, m
        At which they pull.
    by_hand_s : float, s
        How long the operator turns the load in a step.
    ramp_nm_per_s : float, N m/s
        Slope of the torque on the locked load.
    learn_index : bool
        Both encoders have an index pulse: note in the drive where they lie.
    """

    angle_rad: float
    angle_tolerance_rad: float
    weights_kg: tuple[float, ...]
    lever_m: float
    by_hand_s: float = 10.0
    ramp_nm_per_s: float = 0.1
    learn_index: bool = False

    def named(self, names: Iterable[str]) -> dict[str, tuple[float, ...]]:
        """Return some of the numbers by name."""
        values = {name: getattr(self, name) for name in names}
        return {k: one if isinstance(one, tuple) else (one,) for k, one in values.items()}


@dataclass
class Job:
    """A commissioning under way.

    Parameters
    ----------
    drive : Drive
        With its bridge off between the steps.
    model : Model
        As known so far.
    folder : Path
        For recordings, state, model and configuration.
    operator : Operator
    facts : Facts
    recordings, written
        Of the step that runs.
    """

    drive: Drive
    model: Model
    folder: Path
    operator: Operator
    facts: Facts
    recordings: list[str] = field(default_factory=list)
    written: dict[str, float] = field(default_factory=dict)

    @property
    def ratio(self) -> float:
        """Load pulley's radius over the motor's."""
        return self.model.transmission.pulley_ratio

    def record(
        self, name: str, duration_s: float, profile: TorqueProfile | None = None
    ) -> Recording:
        """Record into a new file of the folder; with a profile the motor follows it."""
        number = 1
        while (path := self.folder / f"{name}{'' if number == 1 else f'_{number}'}.blf").exists():
            number += 1
        run = None if profile is None else Run(ModeOfOperation.TORQUE, profile=profile)
        self.recordings.append(path.name)
        record(self.drive, path, duration_s, run=run, metadata={"notes": f"commissioning, {name}"})
        return read_recording(path)

    def last_recording(self) -> Recording:
        """Return the step's last recording, also one that a fault of the drive has cut."""
        return read_recording(self.folder / self.recordings[-1])

    def write(self, entries: Mapping[str, float]) -> None:
        """Write entries of the drive, read them back, and note them for a resumed run."""
        write(self.drive, difference(self.drive, entries, WRITABLE))
        self.written |= entries

    def source(self, name: str) -> Source:
        """Return a recording of the folder with its hash, for the model's posterior."""
        digest = hashlib.sha256((self.folder / name).read_bytes()).hexdigest()
        return Source(file=name, sha256=digest)
