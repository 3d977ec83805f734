"""The chain of masses, springs, dampers and rubbing elements, stepped implicitly.

Compiled arithmetic; no I/O. `lumped` builds the arrays and reads the answer.

Both cables and the free pulley are one chain: from the given end of cable a through its masses to
the pulley, and on through the masses of cable b to its given end. Displacement ``x`` is positive
along the chain, so the cables pull at the pulley from both sides and the matrix is tridiagonal.

    m x'' = T_right - T_left - F,     T = max(0, k (stretch + t_c d stretch/dt))
    F = (T_left + T_right) tanh(w/2) phi

``phi`` is the friction law's answer, +-1 when it slides; then T_right/T_left = exp(+-w), the
capstan over the element's wrap w. Steps are backward Euler, solved by Newton's method: stable at
any step, and free of the chatter that explicit friction has.
"""

# ruff: noqa: PLR0917  (kernels take plain numbers; numba has no keyword-only arguments)
from __future__ import annotations

from typing import NamedTuple

from bowden.model.compiled import compiled_in_place
from bowden.model.friction.bouc_wen import bouc_wen_step
from bowden.model.friction.dahl import dahl_step
from bowden.model.friction.lugre import lugre_step
from bowden.model.transmission import FloatArray

DAHL, LUGRE, BOUC_WEN = 0, 1, 2
_MOST_ROUNDS = 200


class Chain(NamedTuple):
    """Constants, state and scratch; K = 2 elements + 1 nodes, the pulley in the middle.

    Parameters
    ----------
    mass_kg, grip : ndarray of shape (K,)
        Mass, and tanh(w/2) of the wrap; the pulley has its inertia over r^2 and no grip.
    towards_load : ndarray of shape (K,)
        +1 where the chain runs towards the load, -1 where towards the motor.
    stiffness_n_per_m, rest_stretch_m : ndarray of shape (K + 1,)
        Springs: before each node, and one after the last.
    x, v, zeta : ndarray of shape (K,)
        State: displacement (m) and speed (m/s), and that of the friction law.
    tension : ndarray of shape (K + 1,)
    trial, correction, residual, lower, diagonal, upper, slope : ndarray of shape (K + 1,)
        Scratch.
    numbers : ndarray
        Parameters of the friction law.
    """

    mass_kg: FloatArray
    grip: FloatArray
    towards_load: FloatArray
    stiffness_n_per_m: FloatArray
    rest_stretch_m: FloatArray
    x: FloatArray
    v: FloatArray
    zeta: FloatArray
    tension: FloatArray
    trial: FloatArray
    correction: FloatArray
    residual: FloatArray
    lower: FloatArray
    diagonal: FloatArray
    upper: FloatArray
    slope: FloatArray
    numbers: FloatArray


@compiled_in_place
def _law(
    law: int, zeta: float, slip: float, x: float, step_s: float, numbers: FloatArray
) -> tuple[float, float, float]:
    if law == DAHL:
        return dahl_step(zeta, slip, numbers)
    if law == LUGRE:
        return lugre_step(zeta, slip, step_s, numbers)
    return bouc_wen_step(zeta, slip, x, numbers)


@compiled_in_place
def _set_tensions(chain: Chain, end: float, old_end: float, delay_s: float, step_s: float) -> None:
    """Spring tensions of the trial state, and d tension/d stretch in `slope`."""
    n = chain.x.shape[0]
    for j in range(n + 1):
        left = chain.trial[j - 1] if j > 0 else end
        right = chain.trial[j] if j < n else end
        old_left = chain.x[j - 1] if j > 0 else old_end
        old_right = chain.x[j] if j < n else old_end
        stretch = chain.rest_stretch_m[j] + right - left
        rate = ((right - left) - (old_right - old_left)) / step_s
        k = chain.stiffness_n_per_m[j]
        force = k * (stretch + delay_s * rate)
        taut = force > 0.0
        chain.tension[j] = force if taut else 0.0
        chain.slope[j] = k * (1.0 + delay_s / step_s) if taut else 0.0


@compiled_in_place
def _assemble(chain: Chain, law: int, push: float, held: bool, step_s: float) -> float:
    """Residual forces and their tridiagonal derivative; returns the largest residual (N)."""
    n = chain.x.shape[0]
    middle = n // 2
    largest = 0.0
    for k in range(n):
        slip = chain.trial[k] - chain.x[k]
        inertia = chain.mass_kg[k] / (step_s * step_s)
        left, right = chain.tension[k], chain.tension[k + 1]
        d_left, d_right = chain.slope[k], chain.slope[k + 1]
        residual = inertia * (slip - step_s * chain.v[k]) - (right - left)
        phi, gradient = 0.0, 0.0
        if chain.grip[k] > 0.0:
            way = chain.towards_load[k]
            phi, gradient, _ = _law(
                law, way * chain.zeta[k], way * slip, way * chain.trial[k], step_s, chain.numbers
            )
            phi *= way
        grip = chain.grip[k]
        residual += grip * (left + right) * phi
        chain.diagonal[k] = (
            inertia
            + d_left * (1.0 + grip * phi)
            + d_right * (1.0 - grip * phi)
            + grip * (left + right) * gradient
            + 1e-12
        )
        chain.lower[k] = -d_left * (1.0 + grip * phi)
        chain.upper[k] = -d_right * (1.0 - grip * phi)
        if k == middle:
            residual -= push
            if held:
                residual, chain.diagonal[k] = 0.0, 1.0
                chain.lower[k], chain.upper[k] = 0.0, 0.0
        chain.residual[k] = residual
        largest = max(largest, abs(residual))
    return largest


@compiled_in_place
def _solve(chain: Chain) -> None:
    """Newton correction into `residual` (Thomas algorithm)."""
    n = chain.x.shape[0]
    for k in range(1, n):
        factor = chain.lower[k] / chain.diagonal[k - 1]
        chain.diagonal[k] -= factor * chain.upper[k - 1]
        chain.residual[k] -= factor * chain.residual[k - 1]
    chain.residual[n - 1] /= chain.diagonal[n - 1]
    for k in range(n - 2, -1, -1):
        chain.residual[k] -= chain.upper[k] * chain.residual[k + 1]
        chain.residual[k] /= chain.diagonal[k]


@compiled_in_place
def _step(
    chain: Chain,
    law: int,
    end: float,
    old_end: float,
    middle_m: float,
    push: float,
    held: bool,
    delay_s: float,
    step_s: float,
) -> bool:
    """Take one implicit step; False, with the state unchanged, when Newton does not settle."""
    n = chain.x.shape[0]
    for k in range(n):
        chain.trial[k] = chain.x[k]
    if held:
        chain.trial[n // 2] = middle_m
    _set_tensions(chain, end, old_end, delay_s, step_s)
    largest = _assemble(chain, law, push, held, step_s)
    scale = 1.0
    for j in range(n + 1):
        scale = max(scale, chain.tension[j])
    for _ in range(_MOST_ROUNDS):
        if largest <= 1e-10 * scale:
            break
        _solve(chain)
        for k in range(n):
            chain.correction[k] = chain.residual[k]
        share, before = 1.0, largest
        for k in range(n):
            chain.trial[k] -= chain.correction[k]
        _set_tensions(chain, end, old_end, delay_s, step_s)
        largest = _assemble(chain, law, push, held, step_s)
        while largest > (1.0 - 0.1 * share) * before and share > 1e-3:
            share *= 0.5
            for k in range(n):
                chain.trial[k] += share * chain.correction[k]
            _set_tensions(chain, end, old_end, delay_s, step_s)
            largest = _assemble(chain, law, push, held, step_s)
    if not largest <= 1e-7 * scale:
        return False
    for k in range(n):
        slip = chain.trial[k] - chain.x[k]
        if chain.grip[k] > 0.0:
            way = chain.towards_load[k]
            _, _, zeta = _law(
                law, way * chain.zeta[k], way * slip, way * chain.trial[k], step_s, chain.numbers
            )
            chain.zeta[k] = way * zeta
        chain.v[k] = slip / step_s
        chain.x[k] = chain.trial[k]
    return True


@compiled_in_place
def run_chain(
    chain: Chain,
    law: int,
    time_s: FloatArray,
    end_m: FloatArray,
    middle_m: FloatArray,
    push_n: FloatArray,
    held: bool,
    delay_s: float,
    out: FloatArray,
) -> int:
    """Run the chain; returns the number of samples done.

    Parameters
    ----------
    end_m : ndarray of shape (n,), m
        Displacement of both given ends.
    middle_m, push_n : ndarray of shape (n,), m and N
        Displacement of the pulley when it is `held`, else the force on it.
    delay_s : float, s
        Damping of the cable over its stiffness.
    out : ndarray of shape (5, n)
        Pulley displacement (m); tensions (N) at the given end and at the pulley of cable a, at the
        pulley and at the given end of cable b.
    """
    n = chain.x.shape[0]
    middle = n // 2
    old_end, old_middle, old_push = end_m[0], middle_m[0], push_n[0]
    old_push = 0.0  # the first force acts from the first step on
    for i in range(time_s.shape[0]):
        if i > 0:
            whole = time_s[i] - time_s[i - 1]
            done, parts = 0.0, 1.0
            while done < 1.0:
                share = min(1.0 / parts, 1.0 - done)
                target = min(done + share, 1.0)
                if target > 1.0 - 1e-9:
                    target = 1.0
                end = old_end + target * (end_m[i] - old_end)
                held_at = old_middle + target * (middle_m[i] - old_middle)
                push = old_push + target * (push_n[i] - old_push)
                before = old_end + done * (end_m[i] - old_end)
                h = (target - done) * whole
                if _step(chain, law, end, before, held_at, push, held, delay_s, h):
                    done = target
                else:
                    parts *= 4.0
                    if parts > 5000.0:
                        return i
            old_end, old_middle, old_push = end_m[i], middle_m[i], push_n[i]
        out[0, i] = chain.x[middle]
        out[1, i] = chain.tension[0]
        out[2, i] = chain.tension[middle]
        out[3, i] = chain.tension[middle + 1]
        out[4, i] = chain.tension[n]
    return int(time_s.shape[0])
