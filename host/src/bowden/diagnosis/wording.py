"""What both ways to diagnose say in the same words: the sentence, and a refusal of bad data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bowden.diagnosis.excitation import Excitation
from bowden.diagnosis.localise import Where
from bowden.diagnosis.odds import NOTHING, UNLISTED, credible
from bowden.diagnosis.result import Diagnosis, Learned, NamedEffect, Verdict
from bowden.estimation.gap import Gap
from bowden.estimation.gate.finding import Finding
from bowden.model import Mode, Model
from bowden.model.effects import CATALOGUE
from bowden.model.effects.law_table import ARGUMENTS, DIRECTION, SLIP_DIRECTION
from bowden.signals.prediction import PREDICTED


def stopped(
    model: Model,
    mode: Mode,
    quality: tuple[Finding, ...],
    contents: tuple[Excitation, ...],
    seed: int,
) -> Diagnosis:
    """Return what is said where the data allow no verdict."""
    gaps = tuple(Gap(name, float("nan"), float("nan"), float("nan")) for name in PREDICTED[mode])
    return Diagnosis(
        verdict="bad_data",
        sentence=f"Nothing was fitted, for the data cannot be trusted. {quality[0].text}",
        effects=(),
        ranking=(),
        cannot_tell_apart=(),
        where=(),
        where_map=None,
        gap=gaps[0],
        gaps=gaps,
        calibration=(),
        quality=quality,
        excitation=contents,
        next_experiment=f"Record again, without this: {quality[0].text}",
        next_command="",
        model=model,
        mode=mode,
        series=(),
        notes=("Nothing was fitted.",),
        seed=seed,
        odds={},
        budget=(),
    )


def sentence_of(
    verdict: Verdict,
    effects: Sequence[NamedEffect],
    gap: Gap,
    where: Where,
    *,
    learned: Learned | None = None,
    tied: Sequence[tuple[str, str]] = (),
    odds: Mapping[str, float],
) -> str:
    """Say the verdict in one sentence or two.

    Parameters
    ----------
    verdict : str
    effects : sequence of NamedEffect
        Those that are named.
    gap : Gap
    where : Where
    learned : Learned, optional
    tied : sequence of (str, str)
        Effects, by name, of which the recordings cannot say which is there.
    odds : dict of str to float
        Probability of each explanation.
    """
    scale, unit = (1e3, "mrad") if gap.quantity.endswith("_rad") else (1e3, "mN m")
    channel = gap.quantity.rpartition("_")[0].replace("_", " ")
    before, after, floor = (
        f"{scale * value:.3g} {unit}" for value in (gap.before, gap.after, gap.noise_floor)
    )
    titles = [_title(one) for one in effects]
    if verdict == "named":
        beside = sorted({name for pair in tied for name in pair} - {one.name for one in effects})
        which = " or ".join(_lower(CATALOGUE[name].title) for name in beside)
        open_tie = f", and {which} (these recordings cannot say which)" if which else ""
        goes = "falls" if gap.after < gap.before else "rises"  # where both lie below the floor
        return (
            f"The model lacks {' and '.join(titles)}{open_tie}: with it, the held-out gap in "
            f"{channel} {goes} from {before} to {after}; the noise floor is {floor}."
        )
    if verdict == "ambiguous":
        unnamed = {
            NOTHING: "nothing",
            UNLISTED: "something that no effect of the catalogue explains",
        }
        which = " or ".join([*titles, *(unnamed[one] for one in credible(odds) if one in unnamed)])
        either = "Each" if len(titles) > 1 else "The effect"
        said = f"The model lacks {which}; these recordings cannot say which."
        if not titles:
            return said
        return (
            f"{said} {either} brings the held-out gap in {channel} from {before} to about {after}."
        )
    if verdict == "unlisted" and learned is not None:
        return (
            f"Something is missing that no effect of the catalogue explains: "
            f"{law_in_words(learned)}. Learned as a law, it brings the held-out gap in {channel} "
            f"from {before} to {after}; the noise floor is {floor}."
        )
    if verdict == "unlisted":
        place = next((f" It sits at: {one.condition}." for one in where.places[:1]), "")
        return (
            f"Something is missing that no effect of the catalogue explains: the best leaves "
            f"{after} in {channel}, the noise floor is {floor}.{place}"
        )
    if verdict == "complete":
        return (
            f"Calibration within the tolerances explains these recordings: the held-out gap in "
            f"{channel} is {before}, the noise floor {floor}, and no effect predicts them better."
        )
    return "These recordings would show no effect of the catalogue at its usual size."


PLACES_IN_WORDS = {
    "load_torque_nm": "a torque at the load cell",
    "motor_torque_nm": "a torque at the motor",
    "friction_factor": "friction",
}


def law_in_words(one: Learned) -> str:
    """Say what a learned law is: friction that rises with load angle and changes with direction."""
    over = [name for name in one.arguments if name in ARGUMENTS]
    course = _course(one) if len(over) == 1 else "varies with"
    arguments = " and ".join(ARGUMENT_WORDS.get(name, name) for name in over)
    ways = [ARGUMENT_WORDS[name] for name in one.arguments if name not in over]
    turning = "".join(f" and changes with the {way}" for way in ways)
    return f"{PLACES_IN_WORDS[one.place]} that {course} {arguments}{turning}"


def _course(one: Learned) -> str:
    """Say whether a curve rises or falls; what its band leaves open is neither."""
    value, low, high = one.curve[:, 1], one.curve[:, 2], one.curve[:, 3]
    sigma = float(np.median(high - low))
    steps = np.diff(value)
    rise, fall = float(steps[steps > 0.0].sum()), -float(steps[steps < 0.0].sum())
    if fall <= max(0.1 * rise, 0.5 * sigma):
        return "rises with"
    if rise <= max(0.1 * fall, 0.5 * sigma):
        return "falls with"
    return "varies with"


def place_in_words(where: str) -> str:
    """Say where a law of the odds sits: friction over load angle and direction."""
    place, _, arguments = where.partition(" over ")
    words = [ARGUMENT_WORDS.get(one, one) for one in arguments.split(" and ")]
    return f"{PLACES_IN_WORDS.get(place, place)} over {' and '.join(words)}"


ARGUMENT_WORDS = {
    "load_angle_rad": "load angle",
    "motor_angle_rad": "motor angle",
    "load_speed_rad_per_s": "load speed",
    "motor_speed_rad_per_s": "motor speed",
    "motor_torque_nm": "motor torque",
    "load_torque_nm": "load torque",
    "time_s": "time",
    "time_since_reversal_s": "time since the last reversal",
    "conduit_temperature_c": "conduit temperature",
    DIRECTION: "direction of motion",
    SLIP_DIRECTION: "direction in which the cable slides",
}


def _title(one: NamedEffect) -> str:
    return _lower(one.title) + (f" ({one.variant})" if one.variant else "")


def _lower(title: str) -> str:
    return title[0].lower() + title[1:]


def as_solved_before(fitted: Model, file: Model) -> Model:
    """Return the fitted model with the numerics of the file."""
    document = fitted.document.model_copy(update={"numerics": file.document.numerics})
    return replace(fitted, document=document)
