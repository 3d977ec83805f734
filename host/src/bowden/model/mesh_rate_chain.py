"""One cable of the mesh with friction that depends on speed or tension: linearise, solve, revise.

Compiled helpers; `mesh_rates` drives them for both cables through time.

Segment j slides by w_j within the sample, T_i = T_i(before) + k_i (w_i - w_{i-1}), the ends' own
displacements standing in for w_{-1} and w_N. It obeys

    w_j > 0: T_{j+1} = T_j exp(+A_j)      w_j < 0: T_{j+1} = T_j exp(-A_j)
    w_j = 0: T_{j+1} between T_j exp(-A_j) and T_j exp(+A_j)

    A_j = mu(v_j, T_j) ds/R,   mu = (mu_d (1 + b exp(-(v/v_s)^2)) + mu_v |v|) (T/T0)^-p

with v_j the segment's own speed behind a low-pass filter. The viscous term takes it as it is at the
end of the sample; the term that falls with speed as it was before, for with a slope below zero the
present speed would have no unique answer. With stiction a segment that is at rest at the end of a
sample holds (mu_s - mu_d) l_s/R more from the next one on.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba knows no keyword-only)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place
from bowden.model.friction.stribeck import filtered, stribeck_term
from bowden.model.friction.tension_dependent import tension_factor
from bowden.model.friction.viscous import viscous_term
from bowden.model.trajectory import FloatArray

MOST_WRAP = 50.0  # mu ds/R of one segment: beyond any cable, but exp of it is still a number
SLIPPED = 1e-9  # of the pulleys' motion: slip that counts as backwards


class RateTables(NamedTuple):
    """Constants; axes: cable, direction (0 towards the motor, 1 towards the load), segment."""

    wrap: FloatArray  # ds/R, times (1 +- direction asymmetry)
    mu_d: float
    mu_v_s_per_m: float
    excess: FloatArray  # (mu_s - mu_d) l_s/R of a segment
    stiffness: FloatArray  # of the spring at each node, N/m
    stribeck_gain: float
    stribeck_speed_m_per_s: float
    tension_exponent: float
    reference_n: float
    memory_s: float


class RateState(NamedTuple):
    """What the cables remember, and room to work in; axes: cable, place.

    A slack cable has no tension but at node 0, where a negative one stands for the gap: so the sum
    of tension over stiffness is the stretch of any cable.
    """

    tension: FloatArray
    speed: FloatArray  # filtered, m/s
    slides: NDArray[np.int64]  # -1 towards the motor, 0 at rest, +1 towards the load
    rested: NDArray[np.int64]  # 1 where a segment was at rest at the last sample
    gap_m: FloatArray  # of a slack cable; -1 while taut
    slip: FloatArray  # w
    slip_per_x: FloatArray
    saved: FloatArray  # (cable, 5, N + 1): the state at the last sample
    room: FloatArray  # (cable, 5, N): the tridiagonal solve, slips of the last round, kept slips


@compiled_in_place
def exponent_at(
    t: RateTables, s: RateState, cable: int, j: int, towards: int, dt: float, kept: bool
) -> tuple[float, float]:
    """Return A_j and its derivative by the slip of this sample, 1/m; 0 with the slip kept."""
    slip = s.slip[cable, j] if s.slides[cable, j] != 0 else 0.0
    if kept:
        slip = s.room[cable, 4, j]
    before = s.speed[cable, j]
    speed = filtered(before, slip / dt, t.memory_s, dt)
    mean = 0.5 * (s.tension[cable, j] + s.tension[cable, j + 1])
    wrap = t.wrap[cable, (towards + 1) // 2, j]
    wrap *= tension_factor(mean, t.reference_n, t.tension_exponent)
    mu = t.mu_d * (1.0 + stribeck_term(t.stribeck_gain, t.stribeck_speed_m_per_s, before))
    sign = 1.0 if speed > 0 else -1.0
    drag = viscous_term(t.mu_v_s_per_m, speed)
    if t.mu_d == 0:
        # Without Coulomb friction nothing holds a segment: the drag has the sign of the speed.
        drag *= sign * towards
        sign = float(towards)
    mu += drag
    slope = 0.0 if kept else wrap * t.mu_v_s_per_m * sign / (t.memory_s + dt)
    return min(wrap * mu, MOST_WRAP), slope


@compiled_in_place
def solve_cable(
    t: RateTables,
    s: RateState,
    cable: int,
    free: int,
    pull_0: float,
    pull_1: float,
    dt: float,
    kept: bool,
) -> None:
    """Linearise about the present slips and solve: slip + slip_per_x * (pull of the free end).

    The free end's own pull is left out of `pull_0` or `pull_1`.
    """
    n = t.wrap.shape[2]
    k, tension, w = t.stiffness, s.tension[cable], s.slip[cable]
    up, rhs, by_x = s.room[cable, 0], s.room[cable, 1], s.room[cable, 2]
    for j in range(n):
        lower, diagonal, upper, right, right_x = 0.0, 1.0, 0.0, 0.0, 0.0
        towards = s.slides[cable, j]
        if towards != 0:
            a, slope = exponent_at(t, s, cable, j, towards, dt, kept)
            fall, rise = math.exp(-0.5 * towards * a), math.exp(0.5 * towards * a)
            # The tensions as they were, the ends' displacements, and the slips times stiffness.
            near, far = tension[j], tension[j + 1]
            lower, upper = k[j] * rise, k[j + 1] * fall
            diagonal = -lower - upper
            if j == 0:
                near += k[0] * pull_0
                right_x = lower if free == 0 else 0.0
                lower = 0.0
            if j == n - 1:
                far += k[n] * pull_1
                right_x -= upper if free == 1 else 0.0
                upper = 0.0
            right = near * rise - far * fall
            load = max(near * rise + far * fall, 0.0)
            turn = min(-0.5 * towards * slope * load, 0.0)
            diagonal += turn
            right += turn * w[j]
        scale = diagonal - (lower * up[j - 1] if j > 0 else 0.0)
        up[j] = upper / scale
        rhs[j] = (right - (lower * rhs[j - 1] if j > 0 else 0.0)) / scale
        by_x[j] = (right_x - (lower * by_x[j - 1] if j > 0 else 0.0)) / scale
    for j in range(n - 1, -1, -1):
        s.room[cable, 3, j] = s.slip[cable, j]
        s.slip[cable, j] = rhs[j] - (up[j] * s.slip[cable, j + 1] if j < n - 1 else 0.0)
        s.slip_per_x[cable, j] = by_x[j] - (up[j] * s.slip_per_x[cable, j + 1] if j < n - 1 else 0)


@compiled_in_place
def end_force(t: RateTables, s: RateState, cable: int, end: int) -> tuple[float, float]:
    """Return the tension at an end that its own pull is yet to be added to, and per pull, N/m."""
    n = t.wrap.shape[2]
    if end == 0:
        k = t.stiffness[0]
        return s.tension[cable, 0] + k * s.slip[cable, 0], k * (1 + s.slip_per_x[cable, 0])
    k = t.stiffness[n]
    return (
        s.tension[cable, n] - k * s.slip[cable, n - 1],
        k * (1 - s.slip_per_x[cable, n - 1]),
    )


@compiled_in_place
def tension_after(
    t: RateTables, s: RateState, cable: int, i: int, pull_0: float, pull_1: float
) -> float:
    """Tension at node i for the slips found."""
    n = t.wrap.shape[2]
    before = -pull_0 if i == 0 else s.slip[cable, i - 1]
    after = pull_1 if i == n else s.slip[cable, i]
    return float(s.tension[cable, i] + t.stiffness[i] * (after - before))


@compiled_in_place
def revise(
    t: RateTables, s: RateState, cable: int, pull_0: float, pull_1: float, dt: float, kept: bool
) -> bool:
    """Let segments that slide backwards stop and those that are held too hard go; True if any.

    All of them at once; with the slips kept, the first only: that rule always comes to an end.
    """
    n = t.wrap.shape[2]
    changed = False
    tiny = SLIPPED * (abs(pull_0) + abs(pull_1))
    here = tension_after(t, s, cable, 0, pull_0, pull_1)
    for j in range(n):
        there = tension_after(t, s, cable, j + 1, pull_0, pull_1)
        towards = s.slides[cable, j]
        if t.wrap[cable, 0, j] == 0 or t.mu_d == 0:
            pass  # without friction it slides either way
        elif towards != 0:
            if s.slip[cable, j] * towards < -tiny:
                s.slides[cable, j] = 0
                changed = True
                if kept:
                    return True
        else:
            trial = 1 if there > here else -1
            a, _ = exponent_at(t, s, cable, j, trial, dt, kept)
            hold = math.exp(a + s.rested[cable, j] * t.excess[j])
            low, high = (here, there) if trial > 0 else (there, here)
            if high > low * hold * (1 + 1e-12):
                s.slides[cable, j] = trial
                changed = True
                if kept:
                    return True
        here = there
    return changed


@compiled_in_place
def finish(
    t: RateTables, s: RateState, cable: int, pull_0: float, pull_1: float, dt: float
) -> None:
    """Make the slips found the new state."""
    n = t.wrap.shape[2]
    if s.gap_m[cable] >= 0:
        s.tension[cable, :] = 0.0
        s.tension[cable, 0] = -s.gap_m[cable] * t.stiffness[0]
        s.speed[cable, :] = 0.0
        s.rested[cable, :] = 0
        return
    before = -pull_0
    for i in range(n + 1):
        after = pull_1 if i == n else s.slip[cable, i]
        s.tension[cable, i] += t.stiffness[i] * (after - before)
        before = after
        if i < n:
            s.speed[cable, i] = filtered(s.speed[cable, i], after / dt, t.memory_s, dt)
            s.rested[cable, i] = 1 if s.slides[cable, i] == 0 else 0


@compiled_in_place
def stretch_of(t: RateTables, s: RateState, cable: int) -> float:
    """Total stretch of a cable, m; minus the gap of a slack one."""
    total = 0.0
    for i in range(t.stiffness.size):
        total += s.tension[cable, i] / t.stiffness[i]
    return total
