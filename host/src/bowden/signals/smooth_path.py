"""The path behind a coarse or noisy sensor: a smoothing spline that knows what each sample allows.

`dequantise` uses it; the kernels touch arrays only. The path is an integrated Wiener process, whose
posterior mean is a cubic spline (Wahba 1978): position x, velocity v, and between two nodes an
acceleration of white noise with its own intensity. A node says where x is through a Gaussian of
precision `precision` and mean `pull / precision`. A count says only "x is in this box"; expectation
propagation (Minka 2001) finds the Gaussians that stand for all boxes together. Intensities are
found by expectation maximisation with heavy tails, so that corners stay corners.

Lengths in counts (or in standard deviations), time in usual sample steps.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled

_Floats = NDArray[np.float64]

ROUNDS = 300  # of boxes and intensities at most: expectation maximisation is slow, but sure
SETTLED = 1e-4  # counts: a round that moves no node further is the last
DAMPING = 0.7
POOLED = 1  # neighbours on either side whose accelerations are taken together
HEAVINESS = 0.5  # how many typical accelerations each local estimate is mixed with
_WIDE = 1e8
_SQRT_2 = math.sqrt(2.0)
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


@dataclass(frozen=True)
class SmoothPath:
    """The posterior of a path at its nodes.

    Parameters
    ----------
    step : ndarray of shape (m - 1,)
        Time between nodes.
    intensity : ndarray of shape (m - 1,)
        Of the acceleration between nodes.
    precision, pull : ndarray of shape (m,)
        What each node's sample says: a Gaussian of that precision, mean pull / precision.
    position, velocity, variance : ndarray of shape (m,)
        Posterior mean of both, and variance of the position.
    """

    step: _Floats
    intensity: _Floats
    precision: _Floats
    pull: _Floats
    position: _Floats
    velocity: _Floats
    variance: _Floats

    def at(self, node: NDArray[np.intp], share: _Floats) -> tuple[_Floats, _Floats]:
        """Return mean and variance between nodes.

        Parameters
        ----------
        node : ndarray of int, shape (n,)
            The node before each instant, 0..m-2.
        share : ndarray of shape (n,)
            Part of the way to the next node, 0..1.
        """
        h, u = self.step[node], share
        mean = (
            (2 * u**3 - 3 * u**2 + 1) * self.position[node]
            + (u**3 - 2 * u**2 + u) * h * self.velocity[node]
            + (3 * u**2 - 2 * u**3) * self.position[node + 1]
            + (u**3 - u**2) * h * self.velocity[node + 1]
        )
        bridge = self.intensity[node] * (h * u * (1 - u)) ** 3 / 3
        return mean, (1 - u) * self.variance[node] + u * self.variance[node + 1] + bridge

    def draw(self, generator: np.random.Generator) -> SmoothPath:
        """Return a path drawn from the posterior, in place of its mean."""
        size = self.precision.size
        position, velocity = np.empty(size), np.empty(size)
        _draw(
            self.step,
            self.intensity,
            self.precision,
            self.pull,
            generator.standard_normal((size, 2)),
            position,
            velocity,
        )
        return replace(self, position=position, velocity=velocity)


def path_through_boxes(
    step: _Floats, middle: _Floats, noise: float, liveliness: _Floats
) -> SmoothPath:
    """Find the path whose nodes lie in boxes of width 1.

    Parameters
    ----------
    step : ndarray of shape (m - 1,)
    middle : ndarray of shape (m,)
        Of each node's box.
    noise : float
        Standard deviation of what blurs the boxes' edges, > 0.
    liveliness : ndarray of shape (m - 1,)
        Relative intensity to begin with and to be drawn to; 1 where nothing is known.

    Returns
    -------
    SmoothPath
    """
    precision = np.full(middle.size, 12.0)  # of a uniform error of one count
    return _fitted(step, precision, precision * middle, liveliness, boxes=(middle, noise))


def path_through_noise(step: _Floats, values: _Floats) -> SmoothPath:
    """Find the path behind values with white noise of standard deviation 1."""
    return _fitted(step, np.ones(values.size), values.copy(), np.ones(step.size), boxes=None)


def _fitted(
    step: _Floats,
    precision: _Floats,
    pull: _Floats,
    liveliness: _Floats,
    boxes: tuple[_Floats, float] | None,
) -> SmoothPath:
    size = precision.size
    position, velocity, variance = np.empty(size), np.empty(size), np.empty(size)
    liveness = np.empty(size - 1)
    kernel = np.ones(2 * POOLED + 1)
    members = np.convolve(np.ones(size - 1), kernel, "same")
    # An acceleration that is worth a tenth of a count over a usual step between nodes.
    intensity = 1e-2 * liveliness / float(np.mean(step)) ** 2
    before = np.full(size, np.inf)
    for _ in range(ROUNDS):
        _smooth(step, intensity, precision, pull, position, velocity, variance, liveness)
        if float(np.max(np.abs(position - before))) < SETTLED:
            break
        before = position.copy()
        if boxes:
            _match_boxes(*boxes, position, variance, precision, pull)
        pooled = np.convolve(np.maximum(liveness, 0.0) / liveliness, kernel, "same")
        usual = math.exp(float(np.mean(np.log(np.maximum(pooled / members, 1e-14)))))
        intensity = liveliness * (HEAVINESS * usual + pooled) / (HEAVINESS + members)
        intensity = np.maximum(intensity, 1e-16)
    _smooth(step, intensity, precision, pull, position, velocity, variance, liveness)
    return SmoothPath(step, intensity, precision, pull, position, velocity, variance)


@compiled
def _filter(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    states: _Floats,
) -> None:
    """Kalman filter: states[k] = x, v and their covariance xx, xv, vv, given the nodes up to k."""
    x, v, xx, xv, vv = pull[0] / precision[0], 0.0, _WIDE, 0.0, _WIDE
    for k in range(precision.size):
        if k > 0:
            h, q = step[k - 1], intensity[k - 1]
            x += h * v
            xx += 2.0 * h * xv + h * h * vv + q * h * h * h / 3.0
            xv += h * vv + q * h * h / 2.0
            vv += q * h
        gain = 1.0 + precision[k] * xx
        miss = (pull[k] - precision[k] * x) / gain
        x += xx * miss
        v += xv * miss
        vv -= precision[k] * xv * xv / gain
        xv /= gain
        xx /= gain
        states[k, 0], states[k, 1] = x, v
        states[k, 2], states[k, 3], states[k, 4] = xx, xv, vv


@compiled
def _smooth(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    position: _Floats,
    velocity: _Floats,
    variance: _Floats,
    liveness: _Floats,
) -> None:
    """Rauch-Tung-Striebel smoother; liveness: expected intensity of each step, for the next round.

    With d = s[k+1] - F s[k], liveness = E[d' Q1^-1 d] / 2, Q1 the covariance for intensity 1.
    """
    size = precision.size
    states = np.empty((size, 5))
    _filter(step, intensity, precision, pull, states)
    x, v, xx, xv, vv = states[-1, 0], states[-1, 1], states[-1, 2], states[-1, 3], states[-1, 4]
    position[-1], velocity[-1], variance[-1] = x, v, xx
    for k in range(size - 2, -1, -1):
        h, q = step[k], intensity[k]
        fx, fv, fxx, fxv, fvv = (
            states[k, 0],
            states[k, 1],
            states[k, 2],
            states[k, 3],
            states[k, 4],
        )
        # Predicted covariance of the next state, and the smoother's gain.
        pxx = fxx + 2.0 * h * fxv + h * h * fvv + q * h * h * h / 3.0
        pxv = fxv + h * fvv + q * h * h / 2.0
        pvv = fvv + q * h
        scale = 1.0 / (pxx * pvv - pxv * pxv)
        cxx, cvx = fxx + h * fxv, fxv + h * fvv
        gxx, gxv = (cxx * pvv - fxv * pxv) * scale, (fxv * pxx - cxx * pxv) * scale
        gvx, gvv = (cvx * pvv - fvv * pxv) * scale, (fvv * pxx - cvx * pxv) * scale
        dx, dv = x - fx - h * fv, v - fv
        dxx, dxv, dvv = xx - pxx, xv - pxv, vv - pvv
        # Covariance between the next state and this one.
        lxx, lxv = xx * gxx + xv * gxv, xx * gvx + xv * gvv
        lvx, lvv = xv * gxx + vv * gxv, xv * gvx + vv * gvv
        nxx = fxx + gxx * (gxx * dxx + gxv * dxv) + gxv * (gxx * dxv + gxv * dvv)
        nxv = fxv + gvx * (gxx * dxx + gxv * dxv) + gvv * (gxx * dxv + gxv * dvv)
        nvv = fvv + gvx * (gvx * dxx + gvv * dxv) + gvv * (gvx * dxv + gvv * dvv)
        nx, nv = fx + gxx * dx + gxv * dv, fv + gvx * dx + gvv * dv
        ex, ev = x - nx - h * nv, v - nv
        sxx = ex * ex + xx + nxx + 2.0 * h * nxv + h * h * nvv - 2.0 * (lxx + h * lxv)
        sxv = ex * ev + xv + nxv + h * nvv - (lvx + h * lvv) - lxv
        svv = ev * ev + vv + nvv - 2.0 * lvv
        liveness[k] = 6.0 * sxx / (h * h * h) - 6.0 * sxv / (h * h) + 2.0 * svv / h
        x, v, xx, xv, vv = nx, nv, nxx, nxv, nvv
        position[k], velocity[k], variance[k] = x, v, xx


@compiled
def _match_boxes(
    middle: _Floats,
    noise: float,
    position: _Floats,
    variance: _Floats,
    precision: _Floats,
    pull: _Floats,
) -> None:
    """One round of expectation propagation: the Gaussian that stands for each node's box."""
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
            inside = max(spread - (spread / width) ** 2 * shrink, 1e-9 * spread)
            wanted = max(1.0 / inside - free, 0.0)
            towards = (mean + spread / width * shift) / inside - mean * free
            if wanted == 0.0:
                towards = 0.0
        precision[k] += DAMPING * (wanted - precision[k])
        pull[k] += DAMPING * (towards - pull[k])


@compiled
def _draw(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    normal: _Floats,
    position: _Floats,
    velocity: _Floats,
) -> None:
    """Draw a path from the posterior: filter forwards, sample backwards."""
    size = precision.size
    states = np.empty((size, 5))
    _filter(step, intensity, precision, pull, states)
    for k in range(size - 1, -1, -1):
        x, v, xx, xv, vv = (
            states[k, 0],
            states[k, 1],
            states[k, 2],
            states[k, 3],
            states[k, 4],
        )
        if k < size - 1:
            h, q = step[k], intensity[k]
            pxx = xx + 2.0 * h * xv + h * h * vv + q * h * h * h / 3.0
            pxv = xv + h * vv + q * h * h / 2.0
            pvv = vv + q * h
            scale = 1.0 / (pxx * pvv - pxv * pxv)
            cxx, cvx = xx + h * xv, xv + h * vv
            gxx, gxv = (cxx * pvv - xv * pxv) * scale, (xv * pxx - cxx * pxv) * scale
            gvx, gvv = (cvx * pvv - vv * pxv) * scale, (vv * pxx - cvx * pxv) * scale
            dx, dv = position[k + 1] - x - h * v, velocity[k + 1] - v
            x, v = x + gxx * dx + gxv * dv, v + gvx * dx + gvv * dv
            xx, xv, vv = (
                xx - gxx * cxx - gxv * xv,
                xv - gvx * cxx - gvv * xv,
                vv - gvx * cvx - gvv * vv,
            )
        first = math.sqrt(max(xx, 0.0))
        slope = xv / first if first > 0.0 else 0.0
        position[k] = x + first * normal[k, 0]
        velocity[k] = v + slope * normal[k, 0]
        velocity[k] += math.sqrt(max(vv - slope * slope, 0.0)) * normal[k, 1]
