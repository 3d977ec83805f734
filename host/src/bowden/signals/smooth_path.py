"""The path behind a coarse or noisy sensor: a smoothing spline that knows what each sample allows.

`dequantise` uses it; `wiener` smooths and `wiener_draws` draws. The path is an integrated Wiener
process, whose posterior mean is a spline (Wahba 1978). Its noise is twofold, bends and corners.
What has mass has an acceleration, so an angle bends by white jerk (a quintic spline): were its
acceleration white, the torque of a mass would have no bound. But a commanded triangle turns at
once, and a stop is hit: corners are white acceleration. A torque is smoothed by one order less: its
slope bends, and it may step.

A node says where x is through a Gaussian of precision `precision` and mean `pull / precision`. A
count says only "x is in this box"; expectation propagation (Minka 2001) finds the Gaussians that
stand for all boxes together, and the noise that blurs the boxes' edges. Either noise of the path
has an intensity of its own in each step, Student-t distributed about a usual one: a corner is a
rare, strong event. Each stroke has usual ones of its own, distributed about those of all strokes;
turns and standstills share theirs (`runs`), distributed about how motions brake: counts tell little
of what happens within one. They are the fixed point of expectation maximisation, iterated by what
the data determine (MacKay 1992): a path without corners, or without bends, loses that noise within
some ten rounds. Draws take turns, the path given the intensities and those given the path (Geman
and Geman 1984), because a path is less sure than its likeliest intensities say.

Lengths in counts (or in standard deviations), time in usual sample steps.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from bowden.model.compiled import compiled
from bowden.signals import wiener, wiener_draws

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

ROUNDS = 100  # of boxes and intensities at most
SETTLED = 1e-3  # counts: a round that moves no node further is the last
DAMPING = 0.7
FREEDOM = 2.0  # degrees of freedom of the Student-t distribution: with 1, draws are twice as wide
POOLED = 1  # steps on either side that share an intensity: when a corner comes is not known better
BENDS_FIRST = 1e-2  # against corners, before anything is known
# Bends and corners in turns: a motion that takes so long for a count brakes, a twentieth at once.
IN_TURNS = np.array([1.0, 0.05**2])
NEVER = 1e-100  # least usual intensity
STRETCH = 100  # samples of a noisy angle that share usual intensities: 0.1 s at 1 kHz
ROUNDING = 1e-6  # of a step's numbers: fewer are determined by rounding alone
SWEEPS = 32  # from which the variance is taken
FORGETTING = 20  # sweeps until the likeliest intensities, where a chain begins, are left
ANGLE_ORDER, TORQUE_ORDER = 3, 2  # derivatives that exist, with x itself
_SQRT_2 = math.sqrt(2.0)
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


@dataclass(frozen=True)
class SmoothPath:
    """The posterior of a path at its nodes.

    Parameters
    ----------
    nodes : Nodes
        Steps, the intensities of either noise, and what each node's sample says.
    states : ndarray of shape (m, order)
        Posterior mean of x and its derivatives.
    relative_intensity : ndarray of shape (m - 1, 2)
        Intensities of each step against the usual ones of its kind.
    usual : ndarray of shape (m - 1, 2)
        Intensities about which those of each step's kind are distributed.
    noise : float
        Standard deviation of what blurs the boxes' edges.
    """

    nodes: wiener.Nodes
    states: _Floats
    relative_intensity: _Floats
    usual: _Floats
    noise: float

    @cached_property
    def variance(self) -> _Floats:
        """Variance of the position at the nodes, whatever the intensities are; shape (m,)."""
        total = np.zeros(self.nodes.precision.size)
        for one in islice(self.draws(np.random.default_rng(0)), SWEEPS):
            found = wiener.smooth(one.nodes, self.states.shape[1])
            total += found.variance + (found.states[:, 0] - self.states[:, 0]) ** 2
        return np.asarray(total / SWEEPS)

    def at(self, node: NDArray[np.intp], share: _Floats) -> _Floats:
        """Return the mean between nodes.

        Parameters
        ----------
        node : ndarray of int, shape (n,)
            The node before each instant, 0..m-2.
        share : ndarray of shape (n,)
            Part of the way to the next node, 0..1.
        """
        h, u = self.nodes.step[node], share
        n = self.states.shape[1]
        mean = np.zeros(share.shape)
        # Hermite's polynomial: from the start forwards, from the end backwards in mirrored time.
        for ends, w, way in ((self.states[node], u, h), (self.states[node + 1], 1 - u, -h)):
            for i in range(n):
                series = sum(math.comb(n - 1 + k, k) * w**k for k in range(n - i))
                mean += (1 - w) ** n * series * (way * w) ** i / math.factorial(i) * ends[:, i]
        return mean

    def variance_at(self, node: NDArray[np.intp], share: _Floats) -> _Floats:
        """Return the variance between nodes; parameters as of `at`."""
        h, u = self.nodes.step[node], share
        n = self.states.shape[1]
        between = (1 - u) * self.variance[node] + u * self.variance[node + 1]
        for each, m in enumerate((n, n - 1)):
            scale = (2 * m - 1) * math.factorial(m - 1) ** 2
            bridge = (h * u * (1 - u)) ** (2 * m - 1) / scale
            between += self.nodes.intensity[node, each] * bridge
        return np.asarray(between)

    def draws(self, generator: np.random.Generator) -> Iterator[SmoothPath]:
        """Yield paths from the posterior in place of its mean, without end; one follows another."""
        return islice(self._sweeps(generator), FORGETTING, None)

    def _sweeps(self, generator: np.random.Generator) -> Iterator[SmoothPath]:
        """Yield Gibbs' sweeps: a path given intensities, which were drawn given the one before."""
        order = self.states.shape[1]
        numbers = np.broadcast_to(np.array([order, order - 1.0]), self.usual.shape)
        freedom, nodes = FREEDOM + _pooled(numbers), self.nodes
        while True:
            states, felt = wiener_draws.draw(nodes, order, generator)
            yield replace(self, nodes=nodes, states=states)
            spread = FREEDOM * self.usual + _pooled(felt / self.relative_intensity)
            intensity = self.relative_intensity * spread / generator.chisquare(freedom)
            nodes = nodes._replace(intensity=intensity)


def path_through_boxes(
    step: _Floats, middle: _Floats, usual_noise: float, relative_intensity: _Floats, kind: _Index
) -> SmoothPath:
    """Find the path whose nodes lie in boxes of width 1.

    Parameters
    ----------
    step : ndarray of shape (m - 1,)
    middle : ndarray of shape (m,)
        Of each node's box.
    usual_noise : float
        Standard deviation of what blurs the boxes' edges, > 0, as far as the data do not tell it.
    relative_intensity : ndarray of shape (m - 1, 2)
        Intensities of each step against the usual ones of its kind.
    kind : ndarray of int, shape (m - 1,)
        Steps of one kind share usual intensities: 0 in turns and standstills, else the stroke.

    Returns
    -------
    SmoothPath
    """
    precision = np.full(middle.size, 12.0)  # of a uniform error of one count
    nodes = wiener.Nodes(step, np.empty(0), precision, precision * middle)
    return _fitted(nodes, ANGLE_ORDER, relative_intensity, kind, (middle, usual_noise))


def path_through_noise(step: _Floats, values: _Floats, order: int) -> SmoothPath:
    """Find the path of an order behind values with white noise of standard deviation 1.

    An angle has strokes and standstills, whose ends noise hides: stretches of time share usual
    intensities instead. All of a torque has the same.
    """
    nodes = wiener.Nodes(step, np.empty(0), np.ones(values.size), values.copy())
    stretch = STRETCH if order == ANGLE_ORDER else values.size
    return _fitted(nodes, order, np.ones((step.size, 2)), 1 + np.arange(step.size) // stretch)


def _fitted(
    nodes: wiener.Nodes,
    order: int,
    relative_intensity: _Floats,
    kind: _Index,
    boxes: tuple[_Floats, float] | None = None,
) -> SmoothPath:
    # Noise that is worth a tenth of a count over a usual step, corners above all: where
    # a path bends, corners give way to bends; where it has a corner, bends would round it off.
    powers = np.array([2.0 * order - 2, 2.0 * order - 4])
    first = np.array([BENDS_FIRST, 1.0]) * 1e-2 / float(np.mean(nodes.step)) ** powers
    usual = np.tile(first, (int(kind.max()) + 2, 1))
    usual[0] = IN_TURNS
    nodes = nodes._replace(intensity=relative_intensity * usual[kind])
    noise = boxes[1] if boxes else 0.0
    before = np.full(nodes.precision.size, np.inf)
    for _ in range(ROUNDS):
        found = wiener.smooth(nodes, order)
        position = found.states[:, 0]
        if float(np.max(np.abs(position - before))) < SETTLED:
            break
        before = position
        if boxes:
            noise = _match_boxes(*boxes, noise, position, found.variance, *nodes[2:])
        felt, determined = _pooled(found.felt / relative_intensity), _pooled(found.known)
        usual = _usual(usual, felt, determined, kind)
        spread = relative_intensity * (FREEDOM * usual[kind] + felt)
        nodes = nodes._replace(intensity=spread / (FREEDOM + determined))
    found = wiener.smooth(nodes, order)
    return SmoothPath(nodes, found.states, relative_intensity, usual[kind], noise)


def _usual(usual: _Floats, felt: _Floats, determined: _Floats, kind: _Index) -> _Floats:
    """Return the usual intensities of each kind; in the last row those of all strokes."""
    # The harmonic mean of all intensities, which the determined ones alone decide.
    weight = usual[kind] / (FREEDOM * usual[kind] + felt)
    squares, numbers = _sums(kind, felt * weight), _sums(kind, determined * weight)
    found = np.empty_like(usual)
    # A stroke's are distributed about those of all strokes as a step's are about the stroke's. Of
    # few turns, whose counts fit any weaker noise as well, the likeliest usual ones would be none.
    all_strokes = usual[-1]
    weight = all_strokes / (FREEDOM * all_strokes + squares[1:])
    found[-1] = np.sum(squares[1:] * weight, axis=0) + ROUNDING * all_strokes
    found[-1] /= np.sum(numbers[1:] * weight, axis=0) + ROUNDING
    squares[0] += FREEDOM * IN_TURNS
    squares[1:] += FREEDOM * all_strokes
    found[:-1] = squares / (numbers + FREEDOM)
    return np.maximum(found, NEVER)


def _sums(kind: _Index, values: _Floats) -> _Floats:
    """Return sums over the steps of each kind; shape (kinds, 2)."""
    return np.stack([np.bincount(kind, column) for column in values.T], axis=1)


def _pooled(values: _Floats) -> _Floats:
    """Return sums over neighbouring steps; shape (m - 1, 2)."""
    return np.asarray(convolve1d(values, np.ones(2 * POOLED + 1), axis=0, mode="constant"))


@compiled
def _match_boxes(
    middle: _Floats,
    usual_noise: float,
    noise: float,
    position: _Floats,
    variance: _Floats,
    precision: _Floats,
    pull: _Floats,
) -> float:
    """One round of expectation propagation: the Gaussian that stands for each node's box.

    Returns the noise that blurs the boxes' edges, from what the nodes determine of it; the usual
    noise counts as one node more.
    """
    felt, determined = usual_noise * usual_noise, 1.0
    for k in range(middle.size):
        free = max(1.0 / variance[k] - precision[k], 1e-9)
        mean, spread = (position[k] / variance[k] - pull[k]) / free, 1.0 / free
        width = math.sqrt(spread + noise * noise)
        low, high = (middle[k] - 0.5 - mean) / width, (middle[k] + 0.5 - mean) / width
        if low > 0.0:  # the tail that keeps its digits
            mass = 0.5 * (math.erfc(low / _SQRT_2) - math.erfc(high / _SQRT_2))
        else:
            mass = 0.5 * (math.erfc(-high / _SQRT_2) - math.erfc(-low / _SQRT_2))
        if mass < 1e-12:  # far outside: towards the middle
            wanted, towards = 12.0, 12.0 * middle[k]
        else:
            at_low = math.exp(-0.5 * low * low) / _SQRT_2_PI / mass
            at_high = math.exp(-0.5 * high * high) / _SQRT_2_PI / mass
            shift = at_low - at_high
            shrink = shift * shift - (low * at_low - high * at_high)
            felt += (noise * noise * shift / width) ** 2
            determined += (noise / width) ** 2 * shrink
            inside = max(spread - (spread / width) ** 2 * shrink, 1e-9 * spread)
            wanted = max(1.0 / inside - free, 0.0)
            towards = (mean + spread / width * shift) / inside - mean * free
            if wanted == 0.0:
                towards = 0.0
        precision[k] += DAMPING * (wanted - precision[k])
        pull[k] += DAMPING * (towards - pull[k])
    return math.sqrt(felt / determined)
