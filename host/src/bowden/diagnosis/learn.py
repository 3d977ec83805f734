"""Learn a law where no name fits: a smooth function of one argument or two, at one place.

Where no two effects explain the data, every place and argument is screened on top of the calibrated
model, and the most promising laws are fitted with the simulator inside, alone and beside the
likeliest effect, as long as they could still be the likeliest. Where such a law could still be
likelier than the likeliest set at the end, or something unlisted is there, laws are compared with
the sets. The law is the one that predicts unseen stretches best; the evidence sets its smoothness.
Where it, too, leaves what is unlisted, laws of two arguments follow. `law_candidates` lists what is
tried, `search` asks for it, `verdict` words it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.contribution import holds, matters
from bowden.diagnosis.fitting import (
    FRICTION,
    about_first,
    continued,
    finish,
    start_of,
    weighed_under,
)
from bowden.diagnosis.found import Found, Laws
from bowden.diagnosis.growing import without_idle
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import (
    LawCandidate,
    finer,
    laws_over,
    learned_among,
    smooth_precision,
    surface_of,
)
from bowden.diagnosis.material import Material, as_searched
from bowden.diagnosis.odds import SURE, Weighed, merit, penalty_of_law
from bowden.diagnosis.proposals import BEGUN
from bowden.diagnosis.reach import in_reach
from bowden.diagnosis.screening import Screen, ScreenedCandidate
from bowden.diagnosis.time_limit import TimeLimit
from bowden.diagnosis.weighing import weighed_in_turn, weighed_with
from bowden.estimation.problem import WIDEST
from bowden.estimation.search import Progress
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]

BENDS = np.geomspace(0.01, 3.0, 12)  # of the law's own spread: second differences, by evidence


def learn(
    material: Material,
    searched: Model,
    parents: Sequence[Hypothesis],
    rivals: Sequence[Hypothesis],
    limit: TimeLimit,
) -> Laws:
    """Fit the laws of one argument that could be the likeliest, on top of some sets.

    Parameters
    ----------
    material : Material
    searched : Model
        As it is searched, with the file's values.
    parents : sequence of Hypothesis
        The calibrated model first.
    rivals : sequence of Hypothesis
        Sets of effects, under the same covariance.
    limit : TimeLimit
        After it no further law is fitted.
    """
    recordings = [data.estimates.recording for data in material.coarse]
    screened = _screened(material, Screen(parents[0]), laws_over(recordings))
    fitted = _laws(material, searched, parents, screened, rivals, limit=limit)
    return Laws(tuple(parents), tuple(screened), tuple(fitted))


def could_explain(found: Found) -> bool:
    """Whether a law that leaves little could be likelier than the likeliest set."""
    if found.laws is None:
        return False
    likeliest = found.weighed[0].hypothesis
    laws = [weighed_under(one, likeliest.best.noises) for one in found.laws.fitted]
    return bool(in_reach([one for one in laws if holds(one)], [likeliest]))


def with_laws(
    material: Material,
    model: Model,
    found: Found,
    seed: int,
    *,
    limit: TimeLimit,
    progress: Progress | None = None,
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
    limit : TimeLimit
        After it no further law is fitted.
    progress : callable (stage, share of the whole), optional
    """
    tell = progress or (lambda _stage, _share: None)
    tell("learning a law that no name fits", 0.9)
    searched = as_searched(model)
    sets = [one.hypothesis for one in found.weighed]
    learned = found.laws or learn(material, searched, _parents(sets), sets, limit)
    laws, names = learned.fitted, len({one.candidate.name for one in found.screened})
    tell("predicting by learned laws", 0.93)
    weighed = _weighed(material, found.weighed, laws, names, seed)
    best = next((one for one in weighed if learned_among(one.hypothesis.effects)), None)
    if (best is None or best.beyond > best.weight) and limit.has_time():
        tell("learning a law of two arguments", 0.94)
        screen = Screen(learned.parents[0])
        surfaces = _screened(material, screen, _surfaces(material, screen, learned.screened))
        rivals = [weighed_under(one, learned.parents[0].best.noises) for one in sets]
        of_two = _laws(material, searched, learned.parents, surfaces, [*laws, *rivals], limit=limit)
        weighed = _weighed(material, weighed, of_two, names, seed)
    return replace(found, weighed=tuple(weighed), in_time=not limit.cut)


def _laws(
    material: Material,
    searched: Model,
    parents: Sequence[Hypothesis],
    screened: Sequence[ScreenedCandidate],
    rivals: Sequence[Hypothesis],
    *,
    limit: TimeLimit,
) -> list[Hypothesis]:
    """Return the likeliest of some laws, on top of each parent and alone."""
    laws: list[Hypothesis] = []
    for parent in parents:
        if not any(map(holds, laws)):  # as in `search`: beside a set that holds none is grown
            others = [*rivals, *laws]
            laws += _laws_on(material, searched, parent, screened, others, limit=limit)
    done = {one.key: one for one in [*rivals, *laws]}
    alone = [without_idle(material, searched, one, done) for one in laws]
    return laws + [one for one in alone if one is not None and learned_among(one.effects)]


def _weighed(
    material: Material,
    before: Sequence[Weighed],
    laws: Sequence[Hypothesis],
    names: int,
    seed: int,
) -> list[Weighed]:
    """Weigh laws against what carried something before them; as it was where no law can run."""
    if not laws:
        return list(before)
    try:
        _, noises = about_first(sorted(laws, key=merit))
    except ModelError:  # so steep that they describe no rig
        return list(before)
    known = [
        one.hypothesis for one in before if one.share > 1.0 - SURE or not one.hypothesis.effects
    ]
    weighed: list[Weighed] = []
    for one in finish(material, [weighed_under(one, noises) for one in known], noises):
        if not one.effects or matters(one):
            weighed = weighed_with(weighed, one, names, seed)
    here = sorted((weighed_under(one, noises) for one in laws), key=merit)
    ended = (law for one in here for law in finish(material, [one], noises) if matters(law))
    return weighed_in_turn(weighed, ended, names, seed)


def _parents(sets: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the calibrated model and the likeliest single effect, under one covariance."""
    base = next(one for one in sets if not one.effects)
    singles = [one for one in sets if len(one.effects) == 1]
    return [base, *(weighed_under(one, base.best.noises) for one in singles[:1])]


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
    return [surfaces[k] for k in np.argsort(gains)[::-1][:BEGUN]]


def _laws_on(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    screened: Sequence[ScreenedCandidate],
    rivals: Sequence[Hypothesis],
    *,
    limit: TimeLimit,
) -> list[Hypothesis]:
    """Return the laws on top of a set of effects that could be the likeliest, fitted to the end.

    Gains are predicted to first order, and those of strong laws badly: further laws are begun until
    one holds, or those that promise less bring none likelier than those before. The likeliest are
    fitted first, until one leaves much or ends out of reach: the less likely ones do, too.
    """
    laws: list[Hypothesis] = []
    chosen = _proposed(material, parent, screened)
    for first in range(0, len(chosen), BEGUN):
        batch = material.pool.map(
            partial(_begun, material, searched, parent, limit), chosen[first : first + BEGUN]
        )
        before = min(map(merit, laws), default=np.inf)
        for one in in_reach([one for one in batch if one is not None], [*rivals, *laws]):
            if not limit.has_time():
                break
            smooth = _smoothed(material, searched, continued(one))
            if smooth is None:
                break
            law = continued(smooth)
            laws.append(law)
            if not holds(law) or not in_reach([law], [*rivals, *laws]):
                break
        if any(map(holds, laws)) or min(map(merit, laws), default=np.inf) >= before:
            break
    return in_reach(laws, rivals)


def _proposed(
    material: Material, parent: Hypothesis, screened: Sequence[ScreenedCandidate]
) -> list[ScreenedCandidate]:
    """Return the laws that would gain more than they cost on top of a set, best first."""
    screen = Screen(parent)
    here = [screen.again(one) for one in screened]
    gains = list(material.pool.map(screen.annealed, here))

    def pays(k: int) -> bool:
        law = here[k].candidate
        assert isinstance(law, LawCandidate)
        return gains[k] > penalty_of_law(law)

    return [here[k] for k in np.argsort(gains)[::-1] if pays(int(k))]


def _begun(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    limit: TimeLimit,
    screened: ScreenedCandidate,
) -> Hypothesis | None:
    """Fit a law on top of a set of effects, one round, and find its smoothness.

    None where there is no rig, or no time.
    """
    if not limit.has_time():
        return None
    assert isinstance(screened.candidate, LawCandidate)
    law, values = finer(screened.candidate, screened.values)
    if law.scales_friction:  # on the file's mu, not on what calibration made of it
        share = parent.model.value(FRICTION[0]) / searched.value(FRICTION[0])
        values = {name: share * (1.0 + f) - 1.0 for name, f in values.items()}
    known = [(effect, parent.values(i)) for i, effect in enumerate(parent.effects)]
    effects = [*known, (law, values)]
    start, like = parent.coordinates(), parent.best
    begun = start_of(material, searched, effects, start, like)
    return None if begun is None else _smoothed(material, searched, begun.begun())


def _smoothed(material: Material, searched: Model, first: Hypothesis) -> Hypothesis | None:
    """Give a fitted law the smoothness of the largest evidence, and fit it one round so."""
    *known, law = first.effects
    assert isinstance(law, LawCandidate)
    law = replace(law, bend=_likeliest_bend(first, law))
    effects = [
        *((effect, first.values(i)) for i, effect in enumerate(known)),
        (law, first.values(len(known))),
    ]
    start = start_of(material, searched, effects, first.coordinates(), first.best)
    return None if start is None else start.begun(first.slopes)


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
