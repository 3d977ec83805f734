"""The offline model in scripts and notebooks: simulate, compare, calibrate, estimate, diagnose.

A model may be given as a `Model` or as the path of a model file, a recording as a `Recording` or
as the path of one. All quantities are SI, all arrays have the shape (n,).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from bowden.diagnosis import compare as _compare
from bowden.diagnosis import diagnose as _diagnose
from bowden.diagnosis.result import Diagnosis
from bowden.errors import BadInput
from bowden.estimation import calibrate as _calibrate
from bowden.estimation import quantities as _quantities
from bowden.estimation import verify as _verify
from bowden.model import Mode, Model, format_model, parse_model
from bowden.recording.atomic import replace_whole
from bowden.recording.channels import MAIN_CHANNELS, SIMULATED_CHANNELS
from bowden.recording.enabled import until_disabled
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden.signals.prediction import simulate_recording

ModelLike = Model | str | Path
RecordingLike = Recording | str | Path
ModeName = Literal["torque-position", "position-torque", "position-position"]

_WITHOUT_MODEL = ("unlisted", "insufficient_excitation", "bad_data")


def read_model(path: str | Path) -> Model:
    """Read and check a model file.

    Parameters
    ----------
    path : str or Path
        A YAML file; the model-file reference lists its keys.

    Raises
    ------
    BadInput
        The file cannot be read.
    bowden.ModelError
        The file describes no rig; the message lists every problem with its path.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(
            str(path), error.strerror or str(error), "a readable model file (YAML)"
        ) from error
    except UnicodeDecodeError as error:
        raise BadInput(str(path), "bytes that are not UTF-8 text", "a model file (YAML)") from error
    return parse_model(text, source=str(path))


def write_model(model: Model, path: str | Path) -> None:
    """Write a model file, whole or not at all."""
    with replace_whole(Path(path)) as temporary:
        temporary.write_text(format_model(model), encoding="utf-8")


def simulate(
    model: ModelLike,
    recording: RecordingLike,
    mode: ModeName = "torque-position",
    *,
    before: RecordingLike | None = None,
) -> Recording:
    """Run the model on the two series of a recording that the mode names.

    Parameters
    ----------
    model : Model or path
    recording : Recording or path
        Needs the two series that the mode takes as given, motor first; see `Mode`.
    mode : str
        ``"torque-position"``, ``"position-torque"`` or ``"position-position"``.
    before : Recording or path, optional
        What the rig did just before. Without it the rig is virgin at the first sample.

    Returns
    -------
    Recording
        The recording's channels with the simulated ones in their place, and the tensions at both
        ends of both cables (N) and a slack flag added.

    Raises
    ------
    BadInput
        A channel is missing that the mode needs.
    bowden.ModelError
        A series that the model cannot run.
    """
    run = _recording(recording)
    trajectory = simulate_recording(
        model_of(model), Mode(mode), run, before=None if before is None else _recording(before)
    )
    series = {name: getattr(trajectory, name) for name in (*MAIN_CHANNELS, *SIMULATED_CHANNELS)}
    return replace_metadata(run.with_channels(series), mode=mode)


def compare(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    mode: ModeName = "torque-position",
) -> _compare.Comparison:
    """Compare recordings with a model: the residual, its RMS, and the conditions it occurs in."""
    return _compare.compare(model_of(model), _recordings(recordings), Mode(mode))


def calibrate(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    mode: ModeName = "torque-position",
    *,
    free: Sequence[str] | None = None,
    widen: bool = False,
    held_out: RecordingLike | Sequence[RecordingLike] | None = None,
) -> _calibrate.Calibration:
    """Fit parameters of a model to recordings.

    Parameters
    ----------
    model : Model or path
    recordings : Recording, path, or sequence of them
    mode : str
    free : sequence of str, optional
        Parameters to move, such as ``"friction.mu_d"``; by default those with a tolerance.
    widen : bool
        Set the stated tolerances aside.
    held_out : Recording, path, or sequence of them, optional
        Validates the fit; by default every third recording, of one every third second.
    """
    return _calibrate.calibrate(
        model_of(model),
        _recordings(recordings),
        Mode(mode),
        free=list(free) if free is not None else None,
        widen=widen,
        held_out=() if held_out is None else _recordings(held_out),
    )


def estimate(
    quantity: Literal["stiffness", "friction", "pretension"],
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
) -> _quantities.Estimation:
    """Estimate stiffness, friction or pretension, with 95 % intervals.

    Parameters
    ----------
    quantity : str
    model : Model or path
        What the estimate starts from; other numbers move within their tolerances.
    recordings : Recording, path, or sequence of them
        Each from a virgin rig.
    """
    if quantity not in _quantities.QUANTITIES:
        raise BadInput("quantity", repr(quantity), ", ".join(_quantities.QUANTITIES))
    return _quantities.estimate(quantity, model_of(model), _recordings(recordings))


def verify(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    mode: ModeName = "torque-position",
) -> _verify.Verification:
    """Check whether a model explains recordings that it has not seen, to their noise floor."""
    return _verify.verify(model_of(model), _recordings(recordings), Mode(mode))


def diagnose(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    mode: ModeName = "torque-position",
    *,
    seed: int = 0,
    effects: Sequence[str] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Diagnosis:
    """Name the physical effect that a model lacks to explain recordings, or say why none is named.

    Parameters
    ----------
    model : Model or path
    recordings : Recording, path, or sequence of them
        Of one rig. Samples after the drive's bridge went off are left out.
    mode : str
    seed : int
        The same seed gives the same answer.
    effects : sequence of str, optional
        Candidates by name; the whole catalogue when absent.
    progress : callable, optional
        Called with the stage's name and the share that is done, 0 .. 1.
    """
    return _diagnose.diagnose(
        model_of(model),
        [until_disabled(run) for run in _recordings(recordings)],
        Mode(mode),
        seed=seed,
        names=list(effects) if effects is not None else None,
        progress=progress,
    )


#: The loop's first verb: find, extend, verify, apply, write_report.
find = diagnose


def extend(found: Diagnosis, path: str | Path | None = None) -> Model:
    """Return a diagnosis' model: calibrated, with the effects or the law that it found.

    Parameters
    ----------
    found : Diagnosis
    path : str or Path, optional
        Write it there as a model file, too.

    Raises
    ------
    BadInput
        The diagnosis found nothing that a model could be extended with.
    """
    if found.verdict in _WITHOUT_MODEL and found.learned is None:
        accepted = "a diagnosis that is complete, names effects or learned a law"
        raise BadInput("diagnosis", found.verdict.replace("_", " "), accepted)
    if path is not None:
        write_model(found.model, path)
    return found.model


def replace_metadata(recording: Recording, **entries: str) -> Recording:
    """Return the recording with entries of its metadata added or replaced."""
    return replace(recording, metadata={**recording.metadata, **entries})


def model_of(given: ModelLike) -> Model:
    """Return the model, read from its file where a path is given."""
    return given if isinstance(given, Model) else read_model(given)


def _recording(given: RecordingLike) -> Recording:
    return given if isinstance(given, Recording) else read_recording(Path(given))


def _recordings(given: RecordingLike | Sequence[RecordingLike]) -> list[Recording]:
    if isinstance(given, Recording | str | Path):
        return [_recording(given)]
    return [_recording(one) for one in given]
