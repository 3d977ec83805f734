"""From predictions to a posterior over hypotheses, "something unlisted" among them.

Every set of effects stands twice: as the truth, when what is left is no more than its laws may
leave, and with an unknown discrepancy beyond that. Sums of log predictive density over few blocks
are uncertain themselves; weights are averaged over a Bayesian bootstrap of the blocks (pseudo-BMA+,
Yao, Vehtari, Simpson, Gelman 2018), which keeps one lucky block from making anything certain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import LAWS, SURFACES, LawCandidate
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.model.effects import CATALOGUE, LEARNED, Effect

_Floats = NDArray[np.float64]

PRIOR_UNLISTED = 0.1  # of rigs miss something that the catalogue hasn't
MORE = 0.25  # of rigs that miss some effects miss one more
RESAMPLES = 2000  # draws of the Bayesian bootstrap
SURE = 0.95  # of the posterior: an effect is named; what carries less than the rest is no rival
NOTHING, UNLISTED = "nothing", "unlisted"  # explanations that name no effect


@dataclass(frozen=True)
class Weighed:
    """A hypothesis with its predictions and its share of the posterior.

    Parameters
    ----------
    hypothesis : Hypothesis
    prediction : UnseenPrediction
    weight : float
        Posterior probability that these effects are all there is.
    beyond : float
        That these are there and something unlisted.
    """

    hypothesis: Hypothesis
    prediction: UnseenPrediction
    weight: float = 0.0
    beyond: float = 0.0

    @property
    def share(self) -> float:
        """Posterior probability that these effects are there, alone or not."""
        return self.weight + self.beyond


def log_prior(one: Hypothesis, candidates: int = len(CATALOGUE)) -> float:
    """Return the logarithm of the prior of a set of effects, each alike, in whatever order.

    A learned law is what the catalogue hasn't: one of many. The strength of a listed effect is
    anywhere up to its usual one, as likely here as there. Two effects that do the same to the data
    are known to the same share of themselves, so that the one which needs a hundredth of its usual
    strength for it takes up a hundredth of its range (the Occam factor, MacKay 2003, 28.1).
    """
    laws = [effect for effect in one.effects if isinstance(effect, LawCandidate)]
    listed = [
        (effect.effect, one.relative_strength(index))
        for index, effect in enumerate(one.effects)
        if not isinstance(effect, LawCandidate)
    ]
    there = [(effect, strength) for effect, strength in listed if strength > 0.0]
    penalties = sum(penalty(effect, candidates - k) for k, (effect, _) in enumerate(there))
    room = sum(math.log(min(strength, 1.0)) for _, strength in there)
    orders = math.lgamma(len(there) + 1)
    return orders - penalties + room - sum(map(penalty_of_law, laws))


def penalty_of_law(law: LawCandidate) -> float:
    """Return the log prior odds against a learned law; a second argument is one thing more."""
    return -math.log(PRIOR_UNLISTED * (MORE / SURFACES if law.table.y else 1.0 / LAWS))


def merit(one: Hypothesis) -> float:
    """Return -log posterior of a set of effects where its fit ended, up to a constant."""
    return one.best.cost - log_prior(one)


def penalty(effect: Effect, candidates: int = len(CATALOGUE)) -> float:
    """Return the log prior odds against one more effect, among so many that it may be."""
    return math.log(candidates * len(effect.variants) / MORE)


def log_tolerances(one: Hypothesis) -> float:
    """Return the logarithm of the prior of the calibrated numbers where the fit left them."""
    residual, _ = one.problem.prior(one.best.x)
    return -0.5 * float(residual @ residual)


def posterior(
    found: Sequence[tuple[Hypothesis, UnseenPrediction]], candidates: int, seed: int
) -> list[Weighed]:
    """Weigh hypotheses, best first.

    Parameters
    ----------
    found : sequence of (Hypothesis, UnseenPrediction)
    candidates : int
        How many effects were looked at.
    seed : int
        Of the bootstrap.
    """
    affected, weights = _shares_affected()
    density = np.stack(
        [one[1].density for one in found]
        + [one[1].affected(share) for share in affected for one in found]
    )  # ((1 + shares) h, blocks)
    prior = np.array([log_prior(one[0], candidates) + log_tolerances(one[0]) for one in found])
    unlisted = [prior + math.log(PRIOR_UNLISTED * weight) for weight in weights]
    prior = np.concatenate([prior + math.log1p(-PRIOR_UNLISTED), *unlisted])
    by_share = shares_of(density, prior, seed).reshape(-1, len(found))
    weighed = [
        Weighed(*one, weight=float(by_share[0, i]), beyond=float(by_share[1:, i].sum()))
        for i, one in enumerate(found)
    ]
    return sorted(weighed, key=lambda one: -one.share)


def _shares_affected() -> tuple[list[float], list[float]]:
    """Return shares of the blocks that something unlisted may affect, and how likely each is.

    Every share is as likely as any other: Gauss and Legendre's points and weights between 0 and 1.
    """
    at, weights = np.polynomial.legendre.leggauss(5)
    return (0.5 * (1.0 + at)).tolist(), (0.5 * weights).tolist()


def is_likelier(share: float) -> bool:
    """Whether an explanation that carries such a share is likelier than all others together."""
    return share > 1.0 - share


def shares_of(density: _Floats, prior: _Floats, seed: int) -> _Floats:
    """Return the share of each hypothesis, averaged over a Bayesian bootstrap of the blocks.

    Parameters
    ----------
    density : ndarray of shape (h, blocks)
        Logarithms.
    prior : ndarray of shape (h,)
        Logarithms.
    seed : int
        Of the bootstrap.
    """
    blocks = density.shape[1]
    draws = np.random.default_rng([seed, 41]).dirichlet(np.ones(blocks), RESAMPLES) * blocks
    total = draws @ density.T + prior
    total -= total.max(axis=1, keepdims=True)
    share = np.exp(total)
    return np.asarray((share / share.sum(axis=1, keepdims=True)).mean(axis=0))


def explanation(one: Hypothesis) -> str:
    """Return what a set of effects says is missing, in a word."""
    if LEARNED in one.names:
        return UNLISTED
    return " + ".join(one.names) or NOTHING


def explanations(every: Sequence[Weighed]) -> dict[str, float]:
    """Return the posterior of each explanation, likeliest first; "unlisted" is always there."""
    found = {UNLISTED: sum(one.beyond for one in every)}
    for one in every:
        names = explanation(one.hypothesis)
        found[names] = found.get(names, 0.0) + one.weight
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def credible(odds: Mapping[str, float]) -> list[str]:
    """Return the likeliest explanations that are right with a probability of 95 % together."""
    before = np.cumsum([0.0, *odds.values()])[:-1]
    return [names for names, less in zip(odds, before, strict=True) if less < SURE]
