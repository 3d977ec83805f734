"""Experiments that a live page offers: what each asks for, and the run that its values make.

Data and arithmetic only; `LiveSession` runs and records them, ending by the drive's clock. The
paper's experiments have the numbers of `bowden experiment N --on-drive` by default.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bowden.drive.meanings import ModeOfOperation
from bowden.drive.position_follower import FollowLoad
from bowden.drive.power import Run
from bowden.drive.torque_profile import TorqueProfile
from bowden.errors import BadInput
from bowden.model.experiments.locked_load import DWELL_S, PEAK_TORQUE_NM, SLOPE_NM_PER_S
from bowden.model.experiments.signals import ramp_period_s, ramps_with_dwells, sample_times

#: With which the default rig does not ring over a bus that is late by up to 10 ms.
DEFAULT_GAINS = (0.2, 1.0)
CYCLES = 2
_PROFILE_RATE_HZ = 100.0
_LONGEST_S = 3600.0


@dataclass(frozen=True)
class ExperimentParameter:
    """One number that an experiment asks for, within its range."""

    name: str
    label: str
    unit: str
    default: float
    low: float
    high: float


@dataclass(frozen=True)
class TimedRun:
    """A run that ends by itself, and what its recording says of it."""

    run: Run
    duration_s: float
    notes: str


@dataclass(frozen=True)
class LiveExperiment:
    """One experiment of the page.

    Parameters
    ----------
    name : str
        Stable; the paper's number where it has one.
    title : str
    before : str
        What the operator does; shown before it is started.
    parameters : tuple of ExperimentParameter
    make : callable
        Makes the run from a value for each parameter.
    """

    name: str
    title: str
    before: str
    parameters: tuple[ExperimentParameter, ...]
    make: Callable[[Mapping[str, float]], TimedRun]

    def timed_run(self, values: Mapping[str, float]) -> TimedRun:
        """Return the run for these values, defaults for those that are not given.

        Raises
        ------
        BadInput
            An unknown parameter, or a value out of its range.
        """
        known = {one.name: one for one in self.parameters}
        if unknown := sorted(set(values) - set(known)):
            raise BadInput(f"experiment {self.name}", ", ".join(unknown), ", ".join(known))
        whole = {name: float(values.get(name, one.default)) for name, one in known.items()}
        for name, value in whole.items():
            one = known[name]
            if not (math.isfinite(value) and one.low <= value <= one.high):
                accepted = f"{one.low:g} .. {one.high:g} {one.unit}"
                raise BadInput(f"experiment {self.name}, {one.label}", f"{value:g}", accepted)
        return self.make(whole)


def ramps_profile(peak_nm: float, slope_nm_per_s: float, cycles: float, name: str) -> TorqueProfile:
    """Return Experiment 1's motor torque: ramps to both peaks with dwells, for whole cycles."""
    period_s = ramp_period_s(peak_nm, slope_nm_per_s, DWELL_S)
    time_s = sample_times(cycles * period_s, _PROFILE_RATE_HZ)
    torque = ramps_with_dwells(time_s, peak_nm, slope_nm_per_s, DWELL_S)
    return TorqueProfile(time_s, torque, name)


def _duration(default_s: float) -> ExperimentParameter:
    return ExperimentParameter("duration_s", "duration", "s", default_s, 0.1, _LONGEST_S)


def _locked(values: Mapping[str, float]) -> TimedRun:
    peak_nm, slope = values["peak_nm"], values["slope_nm_per_s"]
    profile = ramps_profile(peak_nm, slope, round(values["cycles"]), "experiment 1a")
    run = Run(ModeOfOperation.TORQUE, profile=profile)
    return TimedRun(run, profile.duration_s, f"Experiment 1a, {peak_nm:g} N m at {slope:g} N m/s")


def _tunnel(values: Mapping[str, float]) -> TimedRun:
    return TimedRun(Run(ModeOfOperation.TUNNEL), values["duration_s"], "Experiment 2")


def _follower(values: Mapping[str, float]) -> TimedRun:
    gains = FollowLoad(values["kp_nm_per_rad"], values["ki_nm_per_rad_s"])
    run = Run(ModeOfOperation.TORQUE, follow=gains)
    return TimedRun(run, values["duration_s"], f"Experiment 3, {gains}")


def _torque(values: Mapping[str, float]) -> TimedRun:
    torque_nm = values["torque_nm"]
    run = Run(ModeOfOperation.TORQUE, torque_nm)
    return TimedRun(run, values["duration_s"], f"constant motor torque, {torque_nm:g} N m")


EXPERIMENTS = {
    one.name: one
    for one in (
        LiveExperiment(
            "1a",
            "Experiment 1: load locked, ramps of motor torque",
            "lock the load",
            (
                ExperimentParameter("peak_nm", "peak", "N m", PEAK_TORQUE_NM, 1e-3, 10.0),
                ExperimentParameter("slope_nm_per_s", "slope", "N m/s", SLOPE_NM_PER_S, 1e-3, 10.0),
                ExperimentParameter("cycles", "cycles", "", CYCLES, 1, 100),
            ),
            _locked,
        ),
        LiveExperiment(
            "2",
            "Experiment 2: an operator moves the load, the motor renders the tunnel",
            "move the load to and fro",
            (_duration(20.0),),
            _tunnel,
        ),
        LiveExperiment(
            "3",
            "Experiment 3: the motor follows the load",
            "move the load to and fro",
            (
                ExperimentParameter(
                    "kp_nm_per_rad", "kp", "N m/rad", DEFAULT_GAINS[0], 1e-6, 100.0
                ),
                ExperimentParameter(
                    "ki_nm_per_rad_s", "ki", "N m/(rad s)", DEFAULT_GAINS[1], 0.0, 1000.0
                ),
                _duration(10.0),
            ),
            _follower,
        ),
        LiveExperiment(
            "torque",
            "Constant motor torque",
            "move the load to and fro",
            (ExperimentParameter("torque_nm", "torque", "N m", 0.05, -10.0, 10.0), _duration(10.0)),
            _torque,
        ),
    )
}
