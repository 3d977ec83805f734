"""Requests to a `LiveSession`, and its snapshot of the drive. Data only."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from bowden.drive.live_experiment import TimedRun
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.errors import BadInput

_PLACES = 11
#: Entries of the tensions along each cable, from motor to load.
TENSION_PROFILES = {
    cable: tuple(f"model_tension_along_{cable}.{place}" for place in range(1, _PLACES + 1))
    for cable in "ab"
}


@dataclass(frozen=True)
class StartMotor:
    """Turn the bridge on and run."""

    run: Run


@dataclass(frozen=True)
class StopMotor:
    """Quick stop, bridge off; also of a drive that another program runs."""


@dataclass(frozen=True)
class StartRecording:
    """Write everything on the bus to a capture from now on."""

    path: Path
    notes: str = ""


@dataclass(frozen=True)
class RunTimed:
    """Record into a new capture while the bridge is on; both end by the drive's clock."""

    timed: TimedRun
    path: Path


@dataclass(frozen=True)
class EndRecording:
    """Close the capture."""


@dataclass(frozen=True)
class MarkMoment:
    """Set a mark in the capture under way."""

    text: str


@dataclass(frozen=True)
class WriteValues:
    """Show what would change in the configuration, or write it and read it back; bridge off."""

    values: dict[str, float | str]
    dry_run: bool


Command = (
    StartMotor | StopMotor | StartRecording | RunTimed | EndRecording | MarkMoment | WriteValues
)


@dataclass(frozen=True)
class Snapshot:
    """What is known of the drive now; SI units, names as in the dictionary."""

    node_id: int
    nmt_state: str = "UNKNOWN"
    power_state: str = "unknown"
    is_on: bool = False
    is_ours: bool = False
    fault: str | None = None
    values: dict[str, float] = field(default_factory=dict)
    tunnel: dict[str, float] = field(default_factory=dict)
    ratio: float = 1.0
    samples: int = 0
    lost: int = 0
    rate_hz: float = 0.0
    frames_per_s: float = 0.0
    bus_share: float = 0.0
    error_frames: int = 0
    recording: str | None = None
    recorded_s: float = 0.0
    runs_until_s: float | None = None
    last_recording: str | None = None
    changes: list[dict[str, object]] = field(default_factory=list)
    message: str = ""


def run_named(word: str, torque_nm: float | None) -> Run:
    """Return what to run for a word of `ModeOfOperation`: ``tunnel`` or ``torque``."""
    if word == "tunnel":
        return Run(ModeOfOperation.TUNNEL)
    if word == "torque" and torque_nm is not None:
        return Run(ModeOfOperation.TORQUE, torque_nm)
    found = "torque without a torque" if word == "torque" else word
    raise BadInput("mode", found, "tunnel, or torque with a torque in N m")


def tension_profile(values: dict[str, float], cable: str) -> list[float]:
    """Return a cable's tensions, N, evenly spaced from motor to load, by the drive's model.

    Empty as long as they are not all known.
    """
    names = TENSION_PROFILES[cable]
    return [values[name] for name in names] if all(name in values for name in names) else []
