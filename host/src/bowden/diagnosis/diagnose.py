"""`diagnose`: a model and recordings in, the missing effect with all that is known about it out.

The stages in order: the data gate and `excitation` look at the data, `prepare` makes them ready,
`select` (with `candidates`, `screening`, `fit`, `problem`) tries the catalogue, `decide` finds the
verdict, `localise` and `next_experiment` say where the gap sits and what would tell more. Touches
no file; `report.diagnosis` draws the result, `cli.diagnose` prints it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.closer import closely
from bowden.diagnosis.decide import (
    NamedEffect,
    Verdict,
    calibration,
    decide,
    heard,
    invisible,
    look_alikes,
)
from bowden.diagnosis.excitation import Excitation, excitation
from bowden.diagnosis.figures import Series, gap_in, rest_of, series_of
from bowden.diagnosis.fit import HypothesisFit, solve, solve_widely
from bowden.diagnosis.free_parameters import free_parameters
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.leeway import leniently
from bowden.diagnosis.localise import Place, ResidualMap, Where, localise
from bowden.diagnosis.next_experiment import NextExperiment, next_experiment
from bowden.diagnosis.prepare import prepare
from bowden.diagnosis.problem import WeighedRecording, WeighedRecordings
from bowden.diagnosis.select import Progress, Selection, select, silent
from bowden.estimation.gap import Gap
from bowden.estimation.gate.check import check_data
from bowden.estimation.gate.finding import Finding, stops
from bowden.estimation.posterior import Estimate
from bowden.model import Mode, Model, ModelError
from bowden.model.experiments.variants import with_segments
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED, simulate_recording


@dataclass(frozen=True)
class Ranked:
    """A candidate that was tried: best of its name and place."""

    name: str
    variant: str
    score: float
    held_out_gap: float


@dataclass(frozen=True)
class Diagnosis:
    """The verdict and everything behind it; `to_document` gives the JSON of CONTRACTS.

    Parameters
    ----------
    verdict : str
    sentence : str
    effects : tuple of NamedEffect
    ranking : tuple of Ranked
    cannot_tell_apart : tuple of tuple of str
    where : tuple of Place
        Conditions with their share of the calibrated model's gap.
    where_map : ResidualMap or None
        That gap over angle and velocity; None where nothing was simulated.
    gap : Gap
        In the channel that the verdict is about.
    gaps : tuple of Gap
        In every channel that the mode predicts.
    calibration : tuple of Estimate
    quality : tuple of Finding
    excitation : tuple of Excitation
    next_experiment, next_command : str
    model : Model
        Calibrated, with the effects.
    mode : Mode
    series : tuple of Series
    notes : tuple of str
    seed : int
    """

    verdict: Verdict
    sentence: str
    effects: tuple[NamedEffect, ...]
    ranking: tuple[Ranked, ...]
    cannot_tell_apart: tuple[tuple[str, ...], ...]
    where: tuple[Place, ...]
    where_map: ResidualMap | None
    gap: Gap
    gaps: tuple[Gap, ...]
    calibration: tuple[Estimate, ...]
    quality: tuple[Finding, ...]
    excitation: tuple[Excitation, ...]
    next_experiment: str
    next_command: str
    model: Model
    mode: Mode
    series: tuple[Series, ...]
    notes: tuple[str, ...]
    seed: int

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden diagnose --json`` prints; the keys of CONTRACTS and more."""
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "effects": [
                {
                    "name": one.name,
                    "variant": one.variant,
                    "parameters": {name: asdict(value) for name, value in one.parameters.items()},
                    "confidence": one.confidence,
                }
                for one in self.effects
            ],
            "ranking": [asdict(one) for one in self.ranking],
            "cannot_tell_apart": [list(group) for group in self.cannot_tell_apart],
            "where": [asdict(one) for one in self.where[:PLACES]],
            "gap": asdict(self.gap) | {"metric": self.gap.metric},
            "gaps": [asdict(one) | {"metric": one.metric} for one in self.gaps],
            "calibration": {
                one.path: {k: v for k, v in asdict(one).items() if k != "path"}
                for one in self.calibration
            },
            "quality": [asdict(one) for one in self.quality],
            "excitation": [asdict(one) for one in self.excitation],
            "next_experiment": self.next_experiment,
            "next_command": self.next_command,
            "notes": list(self.notes),
            "mode": self.mode.value,
            "seed": self.seed,
            "model": None,
        }


PLACES = 12  # conditions in the JSON
SEGMENTS = 50  # of a cable, while fitting; what that costs in accuracy is part of sigma


def diagnose(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    seed: int = 0,
    names: Sequence[str] | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Find what a model lacks to explain recordings.

    Parameters
    ----------
    model : Model
        Numbers with a tolerance may move by about that; effects that it has stay.
    recordings : sequence of Recording
        Of one rig. Every third block of half-cycles of each is held out for the verdict.
    mode : Mode, default torque-position
        Both channels that it predicts count.
    seed : int, default 0
        The result depends on nothing else.
    names : sequence of str, optional
        Candidates; the whole catalogue when absent.
    progress : callable (stage, share of the whole), optional

    Raises
    ------
    ModelError
        A recording that the model cannot run at all.
    """
    progress("looking at the data", 0.0)
    quality = check_data(model, recordings, mode)
    contents = excitation(model, recordings, mode)
    if stops(quality):
        return _stopped(model, mode, quality, contents, seed)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        coarse = _coarse(model)
        moving = free_parameters(model) if model.free_parameters() else []

        def weigh(one: Model) -> list[WeighedRecording]:
            return prepare(one, mode, recordings, seed, pool)

        # Noise depends on the numbers that are calibrated: first roughly, then with what came out.
        rough = HypothesisFit(coarse, moving, WeighedRecordings(mode, weigh(coarse)), pool.map)
        about = solve_widely(rough, solve(rough, np.zeros(len(moving)))).model
        problem = WeighedRecordings(mode, weigh(about), weigh).with_noise_of(about)
        every = candidates(names)
        selection = select(coarse, moving, every, problem, pool=pool, progress=progress)
        progress("judging", 0.9)
        try:
            final = selection.chosen.fitted.model
            ready = prepare(final, mode, recordings, seed, pool, step_s=0.0)
        except ModelError:  # it runs what was measured, but not every path beside it
            ready = prepare(about, mode, recordings, seed, pool, step_s=0.0)
        selection, rest = heard(selection, rest_of(selection, WeighedRecordings(mode, ready), pool))
        selection, rest = leniently(selection, rest, mode, recordings, seed=seed, pool=pool)
        selection, rest = closely(selection, rest, mode, recordings, every, seed=seed, pool=pool)
        series = series_of(selection, mode, ready, pool)
    gaps = tuple(gap_in(name, series) for name in PREDICTED[mode])
    decision = decide(selection, rest)
    hidden = invisible(selection)
    verdict = decision.verdict
    if verdict == "complete" and len({x.candidate.name for x in selection.looks}) <= len(hidden):
        verdict = "insufficient_excitation"
    where = _where(selection, mode, ready, series, seed)
    advice = _advice(selection, mode, series)
    gap = max(gaps, key=lambda one: one.before / one.noise_floor if one.noise_floor else 0.0)
    if gaps[0].before > 1.1 * gaps[0].noise_floor:
        gap = gaps[0]
    notes = [
        f"Held-out data leave {rest.after:.2f} of the noise, {rest.before:.2f} without an effect "
        f"({rest.samples:.0f} independent samples)."
    ]
    if not moving:
        notes.append("The model file states no tolerances, so nothing was calibrated.")
    if hidden:
        notes.append(f"Would not show here at their usual size: {', '.join(hidden)}.")
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, decision.effects, gap, where),
        effects=decision.effects,
        ranking=_ranking(selection),
        cannot_tell_apart=look_alikes(selection),
        where=where.places,
        where_map=where.map,
        gap=gap,
        gaps=gaps,
        calibration=calibration(decision.model),
        quality=quality,
        excitation=contents,
        next_experiment=advice.text if advice else "",
        next_command=advice.command if advice else "",
        model=_as_solved_before(decision.model.fitted.joint_model, model),
        mode=mode,
        series=series,
        notes=tuple(notes),
        seed=seed,
    )


def _stopped(
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
    )


def _sentence(verdict: Verdict, effects: Sequence[NamedEffect], gap: Gap, where: Where) -> str:
    """Say the verdict in one sentence or two."""
    scale, unit = (1e3, "mrad") if gap.quantity.endswith("_rad") else (1e3, "mN m")
    channel = gap.quantity.rpartition("_")[0].replace("_", " ")
    before, after, floor = (
        f"{scale * value:.3g} {unit}" for value in (gap.before, gap.after, gap.noise_floor)
    )
    titles = [_title(one) for one in effects]
    if verdict == "named":
        return (
            f"The model lacks {' and '.join(titles)}: with it, the held-out gap in {channel} "
            f"falls from {before} to {after}; the noise floor is {floor}."
        )
    if verdict == "ambiguous":
        return (
            f"The model lacks {' or '.join(titles)}; these recordings cannot say which. Either "
            f"brings the held-out gap in {channel} from {before} to about {after}."
        )
    if verdict == "unlisted":
        place = next((f" It sits at: {one.condition}." for one in where.places[:1]), "")
        return (
            f"Something is missing that no effect of the catalogue explains: the best leaves "
            f"{after} in {channel}, the noise floor is {floor}.{place}"
        )
    if verdict == "complete":
        return (
            f"Nothing is missing beyond what calibration within the tolerances explains: the "
            f"held-out gap in {channel} is {before}, the noise floor {floor}."
        )
    return "These recordings would show no effect of the catalogue at its usual size."


def _title(one: NamedEffect) -> str:
    return one.title[0].lower() + one.title[1:] + (f" ({one.variant})" if one.variant else "")


def _where(
    selection: Selection,
    mode: Mode,
    ready: Sequence[WeighedRecording],
    series: Sequence[Series],
    seed: int,
) -> Where:
    """Find where the calibrated model alone is wrong, in the channel where that is clearest."""

    def left(name: str) -> list[NDArray[np.float64]]:
        return [(one.measured - one.before) / one.sigma for one in series if one.quantity == name]

    def size(name: str) -> float:
        return float(np.mean(np.concatenate(left(name)) ** 2))

    name = max(PREDICTED[mode], key=size)
    recordings = [one.recording for one in ready]
    model = selection.base.fitted.model
    return localise(
        left(name),
        recordings,
        [simulate_recording(model, mode, one) for one in recordings],
        seed=seed,
    )


def _advice(selection: Selection, mode: Mode, series: Sequence[Series]) -> NextExperiment | None:
    """Choose what would tell the best hypotheses apart."""
    order = [selection.chosen, *selection.rivals, selection.base]
    named: dict[str, Model] = {}
    for one in order:
        words = " + ".join(one.names) or "no effect"
        named.setdefault(f"({words})" if len(one.names) > 1 else words, one.fitted.model)
    sigma = {
        name: float(np.median(np.concatenate([x.sigma for x in series if x.quantity == name])))
        for name in PREDICTED[mode]
    }
    return next_experiment(list(named.items())[:2], mode, sigma)


def _as_solved_before(fitted: Model, file: Model) -> Model:
    """Return the fitted model with the numerics of the file."""
    document = fitted.document.model_copy(update={"numerics": file.document.numerics})
    return replace(fitted, document=document)


def _coarse(model: Model) -> Model:
    """Return the model on the mesh that fits are made on: the same for every candidate."""
    if model.solver == "lumped":
        return model
    segments = model.transmission.segments or SEGMENTS
    return with_segments(model, min(segments, SEGMENTS))


def _ranking(selection: Selection) -> tuple[Ranked, ...]:
    """Every candidate: the fitted ones by their score, then the others by what they promised."""

    def gap(one: Hypothesis) -> float:
        return one.fit.problem.misfit(one.fitted.model).judged_gap

    base = selection.base
    found, base_gap = [], gap(base)
    seen: set[tuple[str, str]] = set()
    for one in selection.rivals:
        key = one.effects[-1].key
        if key not in seen:
            seen.add(key)
            found.append(Ranked(*key, one.score - base.score, gap(one)))
    for look in selection.looks:
        if look.candidate.key not in seen:
            seen.add(look.candidate.key)
            found.append(Ranked(*look.candidate.key, 0.0, base_gap))
    return tuple(found)
