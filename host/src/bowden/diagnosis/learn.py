"""Learn a law where no name fits: a smooth function of one argument or two, at one place.

Where no two effects explain the data, every place and argument is screened on top of the calibrated
model, and the most promising laws are fitted with the simulator inside, alone and beside the
likeliest effect, as long as they could still be the likeliest. Where such a law is likelier
than every set of effects, or something unlisted is there, laws are compared with the sets. The law
is the one that predicts unseen stretches best; the evidence sets its smoothness. Where it, too,
leaves what is unlisted, laws of two arguments follow. `law_candidates` lists what is tried,
`search` asks for it, `verdict` words it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.contribution import holds, matters
from bowden.diagnosis.fitting import (
    FRICTION,
    ROUGH,
    about_first,
    finish,
    start_of,
    weighed_under,
)
from bowden.diagnosis.found import Found, Laws
from bowden.diagnosis.growing import without_idle
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import FITTED as KNOTS
from bowden.diagnosis.law_candidates import (
    LawCandidate,
    finer,
    laws_over,
    learned_among,
    smooth_precision,
    surface_of,
    visits,
)
from bowden.diagnosis.material import Material, as_searched, with_offset
from bowden.diagnosis.numbers_known import solver_errors
from bowden.diagnosis.odds import LEAST_WEIGHT, Weighed, log_prior, merit, posterior
from bowden.diagnosis.predict import predict_unseen
from bowden.diagnosis.result import Learned
from bowden.diagnosis.screening import Screen, ScreenedCandidate
from bowden.estimation.covariance import Covariance
from bowden.estimation.descend import ROUNDS, bounded_step, normal_equations
from bowden.estimation.likelihood import best_scales
from bowden.estimation.problem import WIDEST, fitted_parts, objective
from bowden.estimation.search import INTERVAL, Progress
from bowden.model import Model, ModelError
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]

PROPOSED = 4  # laws that are begun at a time on top of each parent
MOST_PROPOSED = 12  # laws that are begun on top of each parent where something unlisted is there
BENDS = np.geomspace(0.01, 3.0, 12)  # of the law's own spread: second differences, by evidence
APART = math.log(1.0 / LEAST_WEIGHT) + KNOTS  # nats: odds for nothing, and a smoothness per knot


def learn(
    material: Material,
    searched: Model,
    parents: Sequence[Hypothesis],
    rivals: Sequence[Hypothesis] = (),
    most: int = MOST_PROPOSED,
) -> Laws:
    """Fit the likeliest laws of one argument on top of some sets.

    Parameters
    ----------
    material : Material
    searched : Model
        As it is searched, with the file's values.
    parents : sequence of Hypothesis
        The calibrated model first.
    rivals : sequence of Hypothesis
        Sets of effects; laws that cannot become as likely are given up.
    most : int
        Laws that are begun on top of each parent, the most promising ones.
    """
    recordings = [data.estimates.recording for data in material.coarse]
    screened = _screened(material, Screen(parents[0]), laws_over(recordings))
    fitted = _laws(material, searched, parents, screened, rivals, most=most)
    return Laws(tuple(parents), tuple(screened), tuple(fitted))


def likelier_laws(material: Material, searched: Model, ones: Sequence[Hypothesis]) -> Laws | None:
    """Return laws that leave little and are likelier than the likeliest set; None if none is.

    Only the most promising ones are begun. All are as the verdict says that something is unlisted.

    Parameters
    ----------
    material : Material
    searched : Model
        As it is searched, with the file's values.
    ones : sequence of Hypothesis
        The calibrated model, the likeliest single effect and the likeliest set, finished under one
        covariance.
    """
    *parents, best = ones
    found = learn(material, searched, parents, [best], PROPOSED)
    weighed = [weighed_under(one, best.best.noises) for one in found.fitted if holds(one)]
    return found if any(merit(one) < merit(best) for one in weighed) else None


def with_laws(
    material: Material, model: Model, found: Found, seed: int, progress: Progress | None = None
) -> Found:
    """Return what the search found with learned laws among the hypotheses.

    Parameters
    ----------
    material : Material
    model : Model
        Of the file.
    found : Found
        What the search ended with.
    seed : int
        Of the bootstrap.
    progress : callable (stage, share of the whole), optional
    """
    tell = progress or (lambda _stage, _share: None)
    tell("learning a law that no name fits", 0.9)
    searched = as_searched(model)
    learned = found.laws or learn(material, searched, _parents(found))
    laws = list(learned.fitted)
    tell("predicting by learned laws", 0.93)
    weighed = _weighed(material, found, laws, seed)
    best = next((one for one in weighed if learned_among(one.hypothesis.effects)), None)
    if best is not None and best.beyond > best.weight:
        tell("learning a law of two arguments", 0.94)
        screen = Screen(learned.parents[0])
        surfaces = _screened(material, screen, _surfaces(material, screen, learned.screened))
        laws += _laws(material, searched, learned.parents, surfaces, laws)
        weighed = _weighed(material, found, laws, seed) or weighed
    return replace(found, weighed=tuple(weighed)) if weighed else found


def _laws(
    material: Material,
    searched: Model,
    parents: Sequence[Hypothesis],
    screened: Sequence[ScreenedCandidate],
    rivals: Sequence[Hypothesis] = (),
    *,
    most: int = MOST_PROPOSED,
) -> list[Hypothesis]:
    """Return the likeliest of some laws, on top of each parent and alone."""
    laws: list[Hypothesis] = []
    for parent in parents:
        if not any(map(holds, laws)):  # as in `search`: beside a set that holds none is grown
            others = [*rivals, *laws]
            laws += _laws_on(material, searched, parent, screened, others, most=most)
    done = {one.key: one for one in [*rivals, *laws]}
    alone = [without_idle(material, searched, one, done) for one in laws]
    return laws + [one for one in alone if one is not None and learned_among(one.effects)]


def _weighed(
    material: Material, found: Found, laws: Sequence[Hypothesis], seed: int
) -> list[Weighed]:
    """Weigh laws against what the search found; nothing where there is no law to run."""
    if not laws:
        return []
    try:
        best, noises = about_first(material, sorted(laws, key=merit))
    except ModelError:  # so steep that they describe no rig
        return []
    known = [
        one.hypothesis
        for one in found.weighed
        if one.share > LEAST_WEIGHT or not one.hypothesis.effects
    ]
    known = [
        one for one in known if not one.effects or _reach(one, noises) <= best.best.cost + APART
    ]
    compared = finish(material, [*laws, *known], noises)
    compared = [one for one in compared if not one.effects or matters(one)]
    names = len({one.candidate.name for one in found.screened})
    return posterior([(one, predict_unseen(one)) for one in compared], names, seed)


def _parents(found: Found) -> list[Hypothesis]:
    """Return the calibrated model and the likeliest single effect, under one covariance."""
    every = [one.hypothesis for one in found.weighed]
    base = next(one for one in every if not one.effects)
    parents = [base]
    for one in [one for one in every if len(one.effects) == 1][:1]:
        noises = with_offset(base.best.noises, [noise.offset for noise in one.best.noises])
        parents.append(replace(one, best=replace(one.best, noises=noises)))
    return parents


def _screened(
    material: Material, screen: Screen, laws: Sequence[LawCandidate]
) -> list[ScreenedCandidate]:
    """Simulate laws on top of the calibrated model."""
    return [one for one in material.pool.map(screen.screen_once, laws) if one is not None]


def _surfaces(
    material: Material, screen: Screen, screened: Sequence[ScreenedCandidate]
) -> list[LawCandidate]:
    """Return the most promising laws of two arguments: whose curves gain most beside each other."""
    probed = list(material.pool.map(screen.probed, screened))
    pairs, surfaces = [], []
    for one, other in itertools.combinations(range(len(screened)), 2):
        first, second = screened[one].candidate, screened[other].candidate
        assert isinstance(first, LawCandidate)
        assert isinstance(second, LawCandidate)
        if (surface := surface_of(first, second)) is not None:
            pairs.append((one, other))
            surfaces.append(surface)

    def gain(pair: tuple[int, int]) -> float:
        return screen.together([screened[k] for k in pair], [probed[k] for k in pair])

    gains = list(material.pool.map(gain, pairs))
    return [surfaces[k] for k in np.argsort(gains)[::-1][:PROPOSED]]


def _laws_on(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    screened: Sequence[ScreenedCandidate],
    rivals: Sequence[Hypothesis],
    *,
    most: int = MOST_PROPOSED,
) -> list[Hypothesis]:
    """Return the likeliest laws on top of a set of effects, fitted to the end.

    The likeliest of each set and of its rivals: beside a named effect that turns out idle a law
    counts without it. Gains are predicted to first order, and those of strong laws badly: further
    ones are tried until one holds.
    """
    laws: list[Hypothesis] = []
    chosen = _proposed(material, parent, screened)[:most]
    for first in range(0, len(chosen), PROPOSED):
        batch = chosen[first : first + PROPOSED]
        begun = [_begun(material, searched, parent, one) for one in batch]
        others = [*rivals, *laws]
        rough = [_fitted(material, searched, one, ROUGH) for one in _in_reach(begun, others)]
        laws += [
            one
            for reached in _in_reach(rough, others)
            if (one := _smoothed(material, searched, reached)) is not None
        ]
        if any(map(holds, laws)):
            break
    return _in_reach(laws, rivals)


def _proposed(
    material: Material, parent: Hypothesis, screened: Sequence[ScreenedCandidate]
) -> list[ScreenedCandidate]:
    """Return the laws with the largest predicted gains on top of a set of effects, best first."""
    screen = Screen(parent)
    here = sorted(map(screen.again, screened), key=lambda one: -one.gain)[:MOST_PROPOSED]
    gains = list(material.pool.map(screen.annealed, here))
    return [here[k] for k in np.argsort(gains)[::-1] if gains[k] > 0.0]


def _begun(
    material: Material, searched: Model, parent: Hypothesis, screened: ScreenedCandidate
) -> Hypothesis | None:
    """Fit a law on top of a set of effects, one round."""
    assert isinstance(screened.candidate, LawCandidate)
    law, values = finer(screened.candidate, screened.values)
    if law.scales_friction:  # on the file's mu, not on what calibration made of it
        share = parent.model.value(FRICTION[0]) / searched.value(FRICTION[0])
        values = {name: share * (1.0 + f) - 1.0 for name, f in values.items()}
    known = [(effect, parent.values(i)) for i, effect in enumerate(parent.effects)]
    effects = [*known, (law, values)]
    start, like = parent.coordinates(), parent.best
    begun = start_of(material, searched, effects, start, like)
    return None if begun is None else begun.begun()


def _smoothed(material: Material, searched: Model, first: Hypothesis) -> Hypothesis | None:
    """Fit a law to the end, with the smoothness of the largest evidence."""
    *known, law = first.effects
    assert isinstance(law, LawCandidate)
    law = replace(law, bend=_likeliest_bend(first, law))
    return _fitted(material, searched, replace(first, effects=(*known, law)), ROUNDS, first.slopes)


def _fitted(
    material: Material,
    searched: Model,
    one: Hypothesis,
    rounds: int,
    slopes: Sequence[_Floats] | None = None,
) -> Hypothesis | None:
    """Continue the fit of a law from where it is."""
    effects = [(effect, one.values(i)) for i, effect in enumerate(one.effects)]
    start = start_of(material, searched, effects, one.coordinates(), one.best)
    return None if start is None else start.fitted(rounds, slopes)


def _in_reach(
    tried: Sequence[Hypothesis | None], rivals: Sequence[Hypothesis] = ()
) -> list[Hypothesis]:
    """Return the laws that could still be as likely as the likeliest, the likeliest first."""
    laws = sorted((one for one in tried if one is not None), key=merit)
    least = min(map(merit, (*laws, *rivals)), default=0.0)
    return [one for one in laws if _reach(one, one.best.noises) - log_prior(one) <= least + APART]


def _reach(one: Hypothesis, noises: Sequence[Covariance]) -> float:
    """Return the -log posterior that a fit could come down to under a covariance.

    Twice the fall that its derivatives predict: no fit is quite a parabola.
    """
    own = with_offset(noises, [noise.offset for noise in one.best.noises])
    like = one.best.x, one.best.residuals
    scales = best_scales(fitted_parts(one.problem, one.best.residuals, own), one.best.scales)
    cost = objective(one.problem, *like, own, scales)
    hessian, gradient = normal_equations(one.problem, *like, one.slopes, (own, scales))
    # What the data don't tell at all is known by its range: see `Problem.root`.
    step = bounded_step(one.problem, one.best.x, hessian, gradient, WIDEST**-2.0)
    return cost + 2.0 * float(gradient @ step + 0.5 * step @ hessian @ step)


def _likeliest_bend(one: Hypothesis, law: LawCandidate) -> float:
    """Return the bend under which the data are most likely, the law linear about its fit."""
    mine = one.rows(len(one.effects) - 1)
    at = one.best.x[mine]
    inner = np.ix_(mine, mine)
    own = law.precision
    # What the data say: the Hessian without the law's prior, and where they have their best; no
    # number is known to less than its range.
    data = np.array(one.best.hessian) + np.diag((WIDEST * one.problem.unit) ** -2.0)
    data[inner] -= own
    pull = np.zeros(data.shape[0])
    pull[mine] = own @ at  # gradient of the data at the optimum, by balance with the prior
    spread = max(float(np.ptp(at)), float(np.max(np.abs(at))), 1e-9)

    def evidence(bend: float) -> float:
        prior = smooth_precision(law.table, bend)
        full = np.array(data)
        full[inner] += prior
        # Quadratic about the fit: step to the new optimum and what it costs.
        gradient = np.zeros(full.shape[0])
        gradient[mine] = prior @ at - pull[mine]
        step = -np.linalg.solve(full, gradient)
        low = 0.5 * float(at @ prior @ at) + 0.5 * float(gradient @ step)
        sign = np.linalg.slogdet(full)[1] - np.linalg.slogdet(prior)[1]
        return -(low + 0.5 * float(sign))

    bends = [float(share) * spread for share in BENDS]
    return max(bends, key=evidence)


def learned_of(one: Hypothesis, recordings: Sequence[Recording]) -> Learned:
    """Return the law of a hypothesis that has one, with its 95 % band and where it was visited."""
    law = learned_among(one.effects)
    assert law is not None
    index = one.effects.index(law)
    mine = one.rows(index)
    value = one.best.x[mine]
    variance = np.maximum(np.diag(one.covariance)[mine], 0.0) + solver_errors(one, index) ** 2
    if law.scales_friction:  # mu (1 + f) is known, mu to its tolerance only
        variance = variance + (_tolerance_of(one.model, FRICTION[0]) * (1.0 + value)) ** 2
    reach = INTERVAL * np.sqrt(variance)
    table, at = law.table, law.table.points
    curve = np.stack([at[:, 0], value, value - reach, value + reach], axis=1)
    second = at[:, 1] if table.y else None
    return Learned(table.place, table.arguments, curve, visits(table, recordings), second)


def _tolerance_of(model: Model, path: str) -> float:
    """Return the relative tolerance of a number; 0 without one."""
    for found, value, sigma in model.free_parameters():
        if found == path:
            return sigma / value
    return 0.0
