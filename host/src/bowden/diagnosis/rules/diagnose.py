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

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.excitation import Excitation
from bowden.diagnosis.localise import Where, localise
from bowden.diagnosis.next_experiment import NextExperiment, next_experiment
from bowden.diagnosis.result import Diagnosis, Ranked, Series
from bowden.diagnosis.rules.closer import closely
from bowden.diagnosis.rules.decide import (
    calibration,
    decide,
    invisible,
    look_alikes,
    without_rejected,
)
from bowden.diagnosis.rules.figures import gap_in, rest_of, series_of
from bowden.diagnosis.rules.fit import HypothesisFit, solve, solve_widely
from bowden.diagnosis.rules.form_error import with_form_error
from bowden.diagnosis.rules.free_parameters import free_parameters
from bowden.diagnosis.rules.hypothesis import FittedEffects
from bowden.diagnosis.rules.prepare import prepare
from bowden.diagnosis.rules.problem import WeighedRecording, WeighedRecordings
from bowden.diagnosis.rules.select import Progress, Selection, select, silent
from bowden.diagnosis.wording import as_solved_before, sentence_of
from bowden.estimation.gate.finding import Finding
from bowden.model import Mode, Model, ModelError
from bowden.model.experiments.variants import with_segments
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED, simulate_recording

SEGMENTS = 50  # of a cable, while fitting; what that costs in accuracy is part of sigma


def diagnose_by_rules(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    seed: int = 0,
    names: Sequence[str] | None = None,
    quality: tuple[Finding, ...] = (),
    contents: tuple[Excitation, ...] = (),
    progress: Progress = silent,
) -> Diagnosis:
    """Find what a model lacks to explain recordings that the data gate has admitted.

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
    quality, contents
        What the gate and `excitation` found.
    progress : callable (stage, share of the whole), optional

    Raises
    ------
    ModelError
        A recording that the model cannot run at all.
    """
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
        selection, rest = without_rejected(
            selection, rest_of(selection, WeighedRecordings(mode, ready), pool)
        )
        selection, rest = with_form_error(selection, rest, mode, recordings, seed=seed, pool=pool)
        selection, rest = closely(selection, rest, mode, recordings, every, seed=seed, pool=pool)
        series = series_of(selection, mode, ready, pool)
    gaps = tuple(gap_in(name, series) for name in PREDICTED[mode])
    decision = decide(selection, rest)
    hidden = invisible(selection)
    verdict = decision.verdict
    if verdict == "complete" and len({x.candidate.name for x in selection.screened}) <= len(hidden):
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
        sentence=sentence_of(verdict, decision.effects, gap, where),
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
        model=as_solved_before(decision.model.fitted.joint_model, model),
        mode=mode,
        series=series,
        notes=tuple(notes),
        seed=seed,
        odds={},
        budget=(),
    )


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


def _coarse(model: Model) -> Model:
    """Return the model on the mesh that fits are made on: the same for every candidate."""
    if model.solver == "lumped":
        return model
    segments = model.transmission.segments or SEGMENTS
    return with_segments(model, min(segments, SEGMENTS))


def _ranking(selection: Selection) -> tuple[Ranked, ...]:
    """Every candidate: the fitted ones by their score, then the others by what they promised."""

    def gap(one: FittedEffects) -> float:
        return one.fit.problem.misfit(one.fitted.model).judged_gap

    base = selection.base
    found, base_gap = [], gap(base)
    seen: set[tuple[str, str]] = set()
    for one in selection.rivals:
        key = one.effects[-1].key
        if key not in seen:
            seen.add(key)
            found.append(Ranked(*key, one.score - base.score, gap(one)))
    for outcome in selection.screened:
        if outcome.candidate.key not in seen:
            seen.add(outcome.candidate.key)
            found.append(Ranked(*outcome.candidate.key, 0.0, base_gap))
    return tuple(found)
