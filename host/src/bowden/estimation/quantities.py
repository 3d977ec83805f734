"""Stiffness, friction or pretension from recorded runs (the paper, III-B), by the one estimator.

`Model` and recordings in, an `Estimation` out: the quantity's parameters with flat priors where the
file states no tolerance, and whatever else carries a tolerance moves within it. For stiffness, what
one would read off the raw curve stands beside it (`stretch`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from bowden.estimation.calibrate import Calibration, calibrate
from bowden.estimation.search import Progress
from bowden.estimation.stretch import StretchReadings, stretch_readings
from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording

QUANTITIES = ("stiffness", "friction", "pretension")
LOCKED_SHARE = 0.05  # of the motor's travel: a load that moves less is locked


@dataclass(frozen=True)
class Estimation:
    """A quantity's parameters.

    Parameters
    ----------
    quantity : {"stiffness", "friction", "pretension"}
    paths : tuple of str
        The parameters asked for; others moved within their tolerances.
    calibration : Calibration
    readings : StretchReadings or None
        Of stiffness only, where a cable slides alone.
    """

    quantity: str
    paths: tuple[str, ...]
    calibration: Calibration
    readings: StretchReadings | None

    @property
    def caveats(self) -> tuple[str, ...]:
        """What a reader has to know before the numbers are used."""
        found = self.calibration.caveats
        if self.quantity == "stiffness" and self.readings is None:
            found += (
                "No cable slides alone in these runs, so nothing can be read off the raw curve: "
                "more torque or less pretension would tell the stiffness better.",
            )
        return found

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden estimate --json`` prints."""
        readings = asdict(self.readings) if self.readings else None
        return {
            "quantity": self.quantity,
            "paths": list(self.paths),
            "readings": readings,
            **self.calibration.to_document(),
            "caveats": list(self.caveats),
        }


def estimate(
    quantity: str,
    model: Model,
    recordings: Sequence[Recording],
    *,
    zeros: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Estimation:
    """Estimate a quantity's parameters from recordings in mode torque-position.

    Parameters
    ----------
    quantity : {"stiffness", "friction", "pretension"}
        Stiffness: EA (or K), pretension and mu_d from runs with the load locked. Friction: mu_d,
        mu_s where the model has it, the viscous coefficient where the model lists that effect.
    model : Model
    recordings : sequence of Recording
        Each starts virgin.
    zeros : sequence of str, optional
        A label for each recording: those of one label share their zeros.
    seed : int
    progress : callable (stage, share of the whole), optional

    Raises
    ------
    ModelError
        An unknown quantity, a load that moves where it has to be locked, a channel that is missing.
    """
    paths = _paths(quantity, model)
    for one in recordings:
        one.require([*Mode.TORQUE_POSITION.columns, *Mode.TORQUE_POSITION.predicted], quantity)
        if quantity == "stiffness" and not _is_locked(model, one):
            raise ModelError(
                "stiffness: found a load that moves, accepted: runs with it locked", one.source
            )
    moving = [path for path, _, _ in model.free_parameters()]
    if model.document.posterior is not None:
        moving += model.document.posterior.paths
    free = list(dict.fromkeys([*paths, *moving]))
    found = calibrate(model, recordings, free=free, zeros=zeros, seed=seed, progress=progress)
    readings = stretch_readings(found.model, recordings) if quantity == "stiffness" else None
    return Estimation(quantity, paths, found, readings)


def _paths(quantity: str, model: Model) -> tuple[str, ...]:
    if quantity == "stiffness":
        given = model.document.rig.cable.axial_stiffness_n is not None
        name = "axial_stiffness_n" if given else "end_to_end_stiffness_n_per_m"
        return (f"rig.cable.{name}", "rig.cable.pretension_n", "friction.mu_d")
    if quantity == "pretension":
        return ("rig.cable.pretension_n",)
    if quantity != "friction":
        raise ModelError(f"found {quantity!r}, accepted: {', '.join(QUANTITIES)}")
    paths = ["friction.mu_d"]
    if model.document.friction.mu_s is not None:
        paths.append("friction.mu_s")
    for i, effect in enumerate(model.document.effects):
        if effect.get("name") == "viscous_friction":
            paths.append(f"effects[{i}].mu_v_s_per_m")
    return tuple(paths)


def _is_locked(model: Model, run: Recording) -> bool:
    ratio = model.transmission.pulley_ratio
    return bool(ratio * np.ptp(run.load_angle_rad) <= LOCKED_SHARE * np.ptp(run.motor_angle_rad))
