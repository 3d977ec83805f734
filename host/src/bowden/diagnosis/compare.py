"""What the model says for a recording's inputs, and the gap between that and what was measured.

Takes a `bowden.model.Model` and `Recording`s, runs the simulator, returns frozen results. Touches
no file. `report` draws them, `cli.compare` prints them, `calibrate` makes them small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.budget import Compared, GapStep, gap_budget, shared_means
from bowden.diagnosis.conditions import Condition, split_by_motion
from bowden.estimation.fit import path_and_floor
from bowden.estimation.search import Progress
from bowden.model import Mode, Model, Trajectory
from bowden.recording.recording import Recording
from bowden.signals.motion import LOCKED_SHARE, Motion
from bowden.signals.noise import rms
from bowden.signals.prediction import PREDICTED, simulate_recording
from bowden.signals.repeatability import find_cycles

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Figures:
    """The gap in figures; all in N m unless said otherwise.

    Parameters
    ----------
    gap : float
        RMS of measured minus simulated over all samples.
    peak : float
        Largest magnitude of it.
    bias : float
        Its mean.
    full_scale : float
        Largest magnitude of the measured quantity.
    relative_gap : float or None
        `gap` / `full_scale`; None when nothing was measured.
    noise_floor : float
        RMS of what noise, counts and the simulator's own error leave of a model that is right.
    first_cycle, steady : float or None
        RMS until both extremes of the motion were visited, and after that; None where the motion
        has no cycles.
    """

    gap: float
    peak: float
    bias: float
    full_scale: float
    relative_gap: float | None
    noise_floor: float
    first_cycle: float | None
    steady: float | None


@dataclass(frozen=True)
class VelocityFit:
    """Straight line through the residual against velocity: the trace of a missing viscous term.

    Parameters
    ----------
    slope : float, N m s/rad
    offset : float, N m
    share_explained : float
        Part of the residual's variance that the line takes, 0..1.
    """

    slope: float
    offset: float
    share_explained: float


@dataclass(frozen=True)
class RecordingComparison:
    """One recording beside its simulation.

    Parameters
    ----------
    recording : Recording
    trajectory : Trajectory
        Simulated on the recording's samples, a predicted angle shifted to the recording's zero.
    residual : ndarray of shape (n,), N m
        Measured minus simulated.
    motion : Motion
    figures, where, velocity_fit
        What is read out of them.
    other_gap : float, rad or N m
        RMS in the mode's other predicted quantity.
    time_gaps : tuple of (float, float)
        Start and length of pauses in the recording, in seconds. The model's state goes on over
        them as if the motion between had been straight.
    """

    recording: Recording
    trajectory: Trajectory
    residual: _Floats
    motion: Motion
    figures: Figures
    where: tuple[Condition, ...]
    velocity_fit: VelocityFit
    other_gap: float
    time_gaps: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Comparison:
    """A model beside one or several recordings of one rig.

    Parameters
    ----------
    model : Model
    mode : Mode
    recordings : tuple of RecordingComparison
    figures : Figures
        Over all samples of all recordings.
    where : tuple of Condition
        Likewise, after the constants of the budget.
    budget : tuple of GapStep
        The gap step by step, from raw to nothing.
    """

    model: Model
    mode: Mode
    recordings: tuple[RecordingComparison, ...]
    figures: Figures
    where: tuple[Condition, ...]
    budget: tuple[GapStep, ...]

    @property
    def quantity(self) -> str:
        """The column whose gap counts."""
        return PREDICTED[self.mode][0]

    @property
    def other_quantity(self) -> str:
        """The mode's other predicted column."""
        return PREDICTED[self.mode][1]

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden compare --json`` prints: plain dictionaries, lists and numbers."""
        return {
            "quantity": self.quantity,
            "metric": "RMS",
            "unit": "N m",
            "mode": self.mode.value,
            **asdict(self.figures),
            "budget": [asdict(step) for step in self.budget],
            "where": [asdict(condition) for condition in self.where],
            "recordings": [
                {
                    "recording": one.recording.source,
                    "samples": int(one.residual.size),
                    "duration_s": float(one.recording.time_s[-1] - one.recording.time_s[0]),
                    **asdict(one.figures),
                    f"{self.other_quantity}_gap": one.other_gap,
                    "velocity_fit": asdict(one.velocity_fit) | {"end": one.motion.end},
                    "slack_share": float(np.mean(one.trajectory.slack != 0)),
                    "time_gaps": [
                        {"start_s": start, "length_s": length} for start, length in one.time_gaps
                    ],
                    "where": [asdict(condition) for condition in one.where],
                }
                for one in self.recordings
            ],
        }


def compare(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    zeros: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Simulate each recording and measure the gap.

    Parameters
    ----------
    model : Model
    recordings : sequence of Recording
        One or more runs of one rig; each starts virgin.
    mode : Mode, default torque-position
        Decides which two series are given and which are predicted.
    zeros : sequence of str, optional
        A label for each recording: those of one label share their zeros. Each has its own when
        absent.
    progress : callable (stage, share of the whole), optional

    Returns
    -------
    Comparison

    Raises
    ------
    bowden.model.ModelError
        A recording of fewer than two samples, or one that the model cannot run.
    """
    for recording in recordings:
        recording.require([*mode.columns, *PREDICTED[mode]], f"comparing in mode {mode.value}")
    tell = progress or (lambda _stage, _share: None)
    parts = []
    for number, recording in enumerate(recordings):
        tell(f"comparing {recording.source}", number / len(recordings))
        parts.append(_compare_one(model, recording, mode, number))
    residual = np.concatenate([part.residual for part in parts])
    motion = Motion.joined([part.motion for part in parts])
    floors = np.array([part.figures.noise_floor for part in parts])
    figures = _figures(
        residual,
        np.concatenate([getattr(part.recording, PREDICTED[mode][0]) for part in parts]),
        noise_floor=float(
            np.sqrt(np.average(floors**2, weights=[part.residual.size for part in parts]))
        ),
        steady=motion.steady,
    )
    quantity = PREDICTED[mode][0]
    labels = list(zeros) if zeros is not None else [str(k) for k in range(len(parts))]
    compared = [
        Compared(
            part.recording.time_s,
            part.recording[quantity],
            getattr(part.trajectory, quantity),
            find_cycles(part.recording.time_s, _moving(part.recording)),
            label,
        )
        for part, label in zip(parts, labels, strict=True)
    ]
    constants = np.repeat(
        shared_means([part.residual for part in parts], labels),
        [part.residual.size for part in parts],
    )
    where = split_by_motion(residual - constants, motion)
    return Comparison(model, mode, tuple(parts), figures, where, gap_budget(quantity, compared))


def _moving(recording: Recording) -> _Floats:
    """Return the angle of the end that moves."""
    load, motor = recording.load_angle_rad, recording.motor_angle_rad
    locked = np.ptp(load) <= LOCKED_SHARE * np.ptp(motor)
    return motor if locked else load


def _compare_one(
    model: Model, recording: Recording, mode: Mode, number: int
) -> RecordingComparison:
    path, noise_floor = path_and_floor(model, recording, mode, number)
    trajectory = simulate_recording(model, mode, path)
    quantity, other = PREDICTED[mode]
    if other.endswith(
        "_rad"
    ):  # an encoder's zero is arbitrary: angles are compared by their course
        simulated = getattr(trajectory, other)
        shift = float(np.mean(getattr(recording, other) - simulated))
        trajectory = replace(trajectory, **{other: simulated + shift})
    measured: _Floats = getattr(recording, quantity)
    residual = measured - getattr(trajectory, quantity)
    motion = Motion.of(recording)
    return RecordingComparison(
        recording=recording,
        trajectory=trajectory,
        residual=residual,
        motion=motion,
        figures=_figures(residual, measured, noise_floor=noise_floor, steady=motion.steady),
        where=split_by_motion(residual, motion),
        velocity_fit=_fit_to_velocity(residual, motion.velocity_rad_s),
        other_gap=rms(getattr(recording, other) - getattr(trajectory, other)),
        time_gaps=recording.gaps,
    )


def _figures(
    residual: _Floats, measured: _Floats, *, noise_floor: float, steady: NDArray[np.bool_]
) -> Figures:
    gap = rms(residual)
    full_scale = float(np.max(np.abs(measured)))
    cycles = bool(steady.any())
    return Figures(
        gap=gap,
        peak=float(np.max(np.abs(residual))),
        bias=float(residual.mean()),
        full_scale=full_scale,
        relative_gap=gap / full_scale if full_scale > 0.0 else None,
        noise_floor=noise_floor,
        first_cycle=rms(residual[~steady]) if cycles and not steady.all() else None,
        steady=rms(residual[steady]) if cycles else None,
    )


def _fit_to_velocity(residual: _Floats, velocity_rad_s: _Floats) -> VelocityFit:
    spread = float(np.var(velocity_rad_s))
    slope = (
        float(np.mean((residual - residual.mean()) * velocity_rad_s)) / spread
        if spread > 0
        else 0.0
    )
    variance = float(np.var(residual))
    return VelocityFit(
        slope=slope,
        offset=float(residual.mean() - slope * velocity_rad_s.mean()),
        share_explained=slope**2 * spread / variance if variance > 0 else 0.0,
    )
