"""Move a model's parameters, within what is known of them, until it fits recordings best.

`Model` and recordings in, a `Calibration` with the moved model and its posterior out. Touches no
file; `cli.calibrate` prints it, `report` draws it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from bowden.estimation.fit import Fit, fit, require_mode
from bowden.estimation.gap import Gap
from bowden.estimation.parameters import parameters_of
from bowden.estimation.posterior import Estimate, NuisanceEstimate, Posterior
from bowden.estimation.search import Progress
from bowden.model import Mode, Model, ModelError
from bowden.model.model_file import Source
from bowden.recording.recording import Recording


@dataclass(frozen=True)
class Calibration:
    """The calibrated model, its posterior and its gaps.

    Parameters
    ----------
    model : Model
        With the values, solved as the file says.
    mode : Mode
    posterior : Posterior
    fitted, held_out : tuple of Gap
        One a predicted channel.
    held_out_is : str
        What was held out, in words.
    recordings : tuple of str
        Where they came from, held-out ones last.
    """

    model: Model
    mode: Mode
    posterior: Posterior
    fitted: tuple[Gap, ...]
    held_out: tuple[Gap, ...]
    held_out_is: str
    recordings: tuple[str, ...]

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The calibrated parameters."""
        return self.posterior.estimates

    @property
    def nuisances(self) -> tuple[NuisanceEstimate, ...]:
        """The nuisance numbers of the measurement."""
        return self.posterior.nuisances

    @property
    def caveats(self) -> tuple[str, ...]:
        """Caveats of the result."""
        found = list(self.posterior.only_together)
        names = [one.quantity for one in self.held_out]
        for gap in self.held_out:
            if gap.noise_floor == 0.0:
                found.append(
                    f"{gap.quantity}: no held-out gap: not recorded, constant, or too short."
                )
        for name, size in zip(names, self.posterior.discrepancy, strict=True):
            if not self.posterior.holds and size == max(self.posterior.discrepancy):
                found.append(
                    f"The residual in {name} exceeds the noise floor: the model lacks something, "
                    "so no interval is given. `bowden diagnose` looks for it."
                )
        for one in self.estimates:
            if not one.identifiable:
                found.append(f"{one.path}: not identifiable here; its tolerance stands.")
            if one.at_bound:
                found.append(f"{one.path}: the fit ended at a bound, {one.value:.4g}.")
        return tuple(found)

    def as_model(self, fitted: Sequence[Source] = ()) -> Model:
        """Return the model with the posterior in it, the next fit's prior.

        Parameters
        ----------
        fitted : sequence of Source
            The recordings' files, with their hashes.
        """
        return self.posterior.as_prior(self.model, fitted, [self.held_out_is])

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden calibrate --json`` prints."""
        first = self.held_out[0]
        return {
            "mode": self.mode.value,
            "parameters": {
                one.path: {k: v for k, v in asdict(one).items() if k != "path"}
                for one in self.estimates
            },
            "measurement": [
                asdict(one) | {"recordings": [self.recordings[k] for k in one.recordings]}
                for one in self.nuisances
            ],
            "cannot_tell_apart": [list(pair) for pair in self.posterior.cannot_tell_apart],
            "caveats": list(self.caveats),
            "gap": {
                "quantity": first.quantity,
                "metric": "RMS, held out",
                "unit": "rad" if first.quantity.endswith("_rad") else "N m",
                "before": first.before,
                "after": first.after,
                "noise_floor": first.noise_floor,
                "held_out": self.held_out_is,
                "fitted_before": self.fitted[0].before,
                "fitted_after": self.fitted[0].after,
            },
            "gaps": [asdict(one) for one in self.held_out],
        }


def calibrate(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    free: Sequence[str] | None = None,
    widen: bool = False,
    held_out: Sequence[Recording] = (),
    zeros: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Calibration:
    """Fit named parameters to recordings.

    Parameters
    ----------
    model : Model
    recordings : sequence of Recording
        Of one rig; each starts virgin.
    mode : Mode, default torque-position
        The channels that it predicts are fitted; one of the two may be missing.
    free : sequence of str, optional
        Paths in the model file; every parameter with a tolerance when absent.
    widen : bool, default False
        Set the tolerances aside: flat priors.
    held_out : sequence of Recording, optional
        Recordings to validate on; see `bowden.estimation.fit.fit` for the default.
    zeros : sequence of str, optional
        A label for each recording, held-out ones last: those of one label share their zeros.
    seed : int
    progress : callable (stage, share of the whole), optional

    Returns
    -------
    Calibration

    Raises
    ------
    bowden.model.ModelError
        A path that is no number of the model, nothing to move, or a recording it cannot run.
    """
    if not recordings:
        raise ModelError("recordings: found none, accepted: at least one")
    every = [*recordings, *held_out]
    for one in every:
        require_mode(one, mode, "calibrating")
    parameters = parameters_of(model, free, widen=widen)
    found = fit(
        parameters, recordings, mode, held_out=held_out, zeros=zeros, seed=seed, progress=progress
    )
    return calibration_of(found, model, mode, [one.source for one in every])


def calibration_of(found: Fit, model: Model, mode: Mode, recordings: Sequence[str]) -> Calibration:
    """Word a fit as a calibration of the file's model."""
    values = {one.path: one.value for one in found.posterior.estimates}
    return Calibration(
        model=model.with_values(values),
        mode=mode,
        posterior=found.posterior,
        fitted=found.fitted,
        held_out=found.held_out,
        held_out_is=found.held_out_is,
        recordings=tuple(recordings),
    )
