"""`diagnose`: a model and recordings in, the missing effect with all that is known about it out.

The stages in order: the data gate and `excitation` check the data, `material` makes them ready,
`search` (with `screening`, `hypothesis`, `predict`, `odds`) compares sets of effects by how well
they predict what they have not seen, `verdict` words the posterior, `localise` and
`next_experiment` say where the gap sits and what would tell more. Touches no file;
`report.diagnosis` draws the result, `cli.diagnose` prints it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.excitation import excitation
from bowden.diagnosis.figures import gap_in, learned_of, series_of
from bowden.diagnosis.found import Found
from bowden.diagnosis.law_candidates import learned_among
from bowden.diagnosis.learn import could_explain, with_laws
from bowden.diagnosis.localise import Where, localise
from bowden.diagnosis.material import make_material
from bowden.diagnosis.next_experiment import NextExperiment, next_experiment
from bowden.diagnosis.numbers_known import estimates_of, with_posterior
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.result import Diagnosis, Series, Verdict
from bowden.diagnosis.search import search
from bowden.diagnosis.time_limit import TimeLimit
from bowden.diagnosis.validation import validate
from bowden.diagnosis.verdict import Decision, decide, invisible, odds_of_laws, ranking, stated
from bowden.diagnosis.waterfall import gap_steps
from bowden.diagnosis.wording import as_solved_before, place_in_words, sentence_of, stopped
from bowden.estimation.gap import Gap
from bowden.estimation.gate.check import check_data
from bowden.estimation.gate.finding import stops
from bowden.estimation.search import Progress
from bowden.model import Mode, Model
from bowden.model.effects import LEARNED
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED, simulate_recording
from bowden.workers import workers


def diagnose(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    seed: int = 0,
    names: Sequence[str] | None = None,
    time_limit_s: float = math.inf,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find what a model lacks to explain recordings.

    Parameters
    ----------
    model : Model
        Numbers with a tolerance may move by about that; effects that it has stay.
    recordings : sequence of Recording
        Of one rig. Every figure is of stretches that its fit has not seen.
    mode : Mode, default torque-position
        Both channels that it predicts count.
    seed : int, default 0
        The result depends on nothing else.
    names : sequence of str, optional
        Candidates; the whole catalogue when absent.
    time_limit_s : float, optional
        After so long no further set of effects and no law is fitted; a note says so.
    progress : callable (stage, share of the whole), optional

    Raises
    ------
    ModelError
        A recording that the model cannot run at all.
    """
    tell = progress or (lambda _stage, _share: None)
    limit = TimeLimit(time_limit_s)
    tell("checking the data", 0.0)
    quality = check_data(model, recordings, mode)
    contents = excitation(model, recordings, mode)
    if stops(quality):
        return stopped(model, mode, quality, contents, seed)
    with workers() as pool:
        material = make_material(recordings, model, mode, seed, pool)
        found = search(
            material,
            model,
            candidates(names),
            seed=seed,
            limit=limit,
            progress=tell,
        )
        decision = decide(found)
        if found.in_time and (decision.verdict == "unlisted" or could_explain(found)):
            found = with_laws(material, model, found, seed, limit=limit, progress=tell)
            decision = decide(found)
        tell("computing the verdict", 0.95)
        base = next(one for one in found.weighed if not one.hypothesis.effects)
        series = series_of(material, base, decision.chosen)
        looked_at = len({one.candidate.name for one in found.screened})
        validation = validate(found.weighed, decision.chosen, looked_at, seed)
    gaps = tuple(gap_in(name, series) for name in PREDICTED[mode])
    hidden = invisible(found)
    verdict = stated(decision, found)
    where = _where(base, recordings, mode, series, seed)
    advice = _advice(found.weighed, mode, series)
    gap = max(gaps, key=lambda one: _in_floors(one, verdict))
    chosen = decision.chosen.hypothesis
    is_learned = learned_among(chosen.effects) is not None
    learned = learned_of(chosen, recordings) if is_learned else None
    law_odds = odds_of_laws(found.weighed) if is_learned else {}
    tell("done", 1.0)
    return Diagnosis(
        verdict=verdict,
        sentence=sentence_of(
            verdict,
            decision.effects,
            gap,
            where,
            learned=learned,
            tied=decision.tied,
            odds=decision.odds,
        ),
        effects=decision.effects,
        ranking=ranking(found),
        cannot_tell_apart=decision.tied,
        where=where.places,
        where_map=where.map,
        gap=gap,
        gaps=gaps,
        calibration=estimates_of(chosen),
        quality=quality,
        excitation=contents,
        next_experiment=advice.text if advice else "",
        next_command=advice.command if advice else "",
        model=as_solved_before(with_posterior(chosen), model),
        mode=mode,
        series=series,
        notes=_notes(decision, found, hidden, moving=bool(model.free_parameters())),
        seed=seed,
        odds=decision.odds,
        budget=gap_steps(
            found.filed,
            base,
            decision.chosen,
            found.weighed,
            PREDICTED[mode].index(gap.quantity),
        ),
        learned=learned,
        law_odds=law_odds,
        validation=validation,
    )


def _notes(
    decision: Decision, found: Found, hidden: Sequence[str], *, moving: bool
) -> tuple[str, ...]:
    odds = ", ".join(
        f"{names} {100.0 * share:.0f} %" for names, share in decision.odds.items() if share > 0.005
    )
    notes = [f"Posterior by prediction of unseen stretches: {odds}."]
    if not found.in_time:
        notes.append(
            "The time limit ended the search: further sets of effects and laws were not tried."
        )
    if not moving:
        notes.append("The model file states no tolerances, so nothing was calibrated.")
    if hidden:
        notes.append(f"Would not show here at their usual size: {', '.join(hidden)}.")
    return tuple(notes)


def _in_floors(gap: Gap, verdict: Verdict) -> float:
    """Return a channel's gap in noise floors: as it was, or what stays unexplained."""
    size = gap.after if verdict == "unlisted" else gap.before
    return size / gap.noise_floor if gap.noise_floor else 0.0


def _where(
    base: Weighed,
    recordings: Sequence[Recording],
    mode: Mode,
    series: Sequence[Series],
    seed: int,
) -> Where:
    """Find where the calibrated model alone is wrong, in the channel where that is clearest."""

    def left(name: str) -> list[np.ndarray[tuple[int], np.dtype[np.float64]]]:
        return [(one.measured - one.before) / one.sigma for one in series if one.quantity == name]

    def size(name: str) -> float:
        return float(np.mean(np.concatenate(left(name)) ** 2))

    name = max({one.quantity for one in series}, key=size)
    model = base.hypothesis.model
    return localise(
        left(name),
        recordings,
        [simulate_recording(model, mode, one) for one in recordings],
        seed=seed,
    )


def _advice(
    every: Sequence[Weighed], mode: Mode, series: Sequence[Series]
) -> NextExperiment | None:
    """Choose what would tell the best hypotheses apart."""
    named: dict[str, Model] = {}
    for one in every:
        hypothesis = one.hypothesis
        law = learned_among(hypothesis.effects)
        names = [
            place_in_words(law.variant.where) if law and name == LEARNED else name
            for name in hypothesis.names
        ]
        words = " + ".join(names) or "no effect"
        named.setdefault(f"({words})" if len(names) > 1 else words, hypothesis.model)
    sigma = {
        name: float(np.median(np.concatenate([x.sigma for x in series if x.quantity == name])))
        for name in PREDICTED[mode]
        if any(x.quantity == name for x in series)
    }
    if len(sigma) < len(PREDICTED[mode]):
        return None
    return next_experiment(list(named.items())[:2], mode, sigma)
