"""What one segment of the mesh bears: the laws of friction as a slider, and their linearisation.

Compiled helpers over the tables and the state of both chains; `mesh.chain` solves the rows.

A slider bears the log-ratio of tensions E_j = ln(T_{j+1}/T_j), and gives way by w_j in a sample:

    w_j > 0: E_j = upper bound     w_j < 0: E_j = lower bound     w_j = 0: E_j between the two

With Coulomb friction, eq. (1), the bounds are +-A_j, A_j = mu ds/R. They depend on

    speed, tension      mu = f (mu_d (1 + b exp(-(v/v_s)^2)) + mu_v |v|) (T/T0)^-p
    age                 mu_d grows with the logarithm of the contacts' age
    the last sample     with frictional lag E comes nearer to +-A by a share dt/(lag + dt) a step
    rest                a segment at standstill holds (mu_s - mu_d) l_s/R more: at the start,
                        where it turns round, and after the rest time

f is the friction factor of the sample, v_s's speed the segment's own behind a low-pass filter as it
was at the last sample: with a slope below zero the present speed would have no unique answer. With
presliding a slider is in series with an elastic bristle: within the bounds E_j follows w_j with the
slope A_j over the presliding length x.

Newton's method works on T_{j+1} - T_j = tanh(E_j/2) (T_{j+1} + T_j), the same law without
exponentials that grow. Rounded presliding is Dahl's law for that force F = T_{j+1} - T_j, which
nears its limits +-L = tanh(+-A/2) (T_{j+1} + T_j) and exceeds neither, dF/dw = (+-L - F)/x; over a
sample

    F_j = +-L_j + (F_j before -+ L_j) exp(-|w_j|/x)

or for its share of T_{j+1} + T_j, which then stays as it was where only the tensions change.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place, inlined
from bowden.model.friction.ageing import ageing_term
from bowden.model.friction.stribeck import risen
from bowden.model.friction.tension_dependent import tension_factor
from bowden.model.trajectory import FloatArray

MOST_WRAP = 50.0  # mu ds/R of one segment: beyond any cable, but exp of it is still a number
HELD = 2e-9  # share of the tensions by which a segment at standstill may seem overloaded
FAINT = 1e-4  # of the reference tension: less is known to the rounding of what carries more


class ChainTables(NamedTuple):
    """Constants; axes: cable, direction (0 towards the motor, 1 towards the load), place."""

    wrap: FloatArray  # ds/R, times (1 +- direction asymmetry)
    mu_d: float
    mu_v_s_per_m: float
    excess: FloatArray  # (mu_s - mu_d) l_s/R of a segment
    still_m_per_s: float  # slower is at standstill
    rest_s: float  # how long a segment is at standstill until it holds this
    stiffness: FloatArray  # of the spring at each node, N/m, before it stiffens or creeps
    share: FloatArray  # of each node's spring in the length of the cable
    stribeck_gain: float
    stribeck_speed_m_per_s: float
    tension_exponent: float
    reference_n: float
    memory_s: float
    recalls_friction: bool
    ageing_gain: float
    ageing_s: float
    ageing_m: float
    presliding_m: float
    rounded: bool
    keeps_share: bool
    lag_s: float
    lag_slow_m_per_s: float
    linear: float  # T = linear tau + quadratic tau^2, tau = stiffness * elastic stretch
    quadratic: float
    creep_share: float
    creep_time_s: float
    tiny_m: float  # a slip that is none


class ChainState(NamedTuple):
    """State of the cables, then room to work in; axes: cable, place.

    A slack cable keeps its total stretch, a negative one for a gap, in the spring of node 0.
    """

    stretch: FloatArray  # e
    tension: FloatArray
    creep_n: FloatArray  # tau that the slow part of the stretch has followed so far
    recalled: FloatArray  # filtered: speed, m/s, or by how much Stribeck's term has faded
    age_s: FloatArray  # of the contacts
    went_m: FloatArray  # slip of the last sample
    slides: NDArray[np.int64]  # -1 towards the motor, 0 at standstill, +1 towards the load
    slid: NDArray[np.int64]  # which way a segment slid last; 0 not yet, or since it was slack
    rested_s: FloatArray  # how long it has been at standstill; infinite from the start
    held: FloatArray  # E, where the law asks for it
    bristle_n: FloatArray  # F, where the law asks for it
    reserve_m: FloatArray  # stretch that shows when a segment first slides, see `mesh`
    gap_m: FloatArray  # of a slack cable; -1 while taut
    factor: FloatArray  # (cable, direction): f
    limit: FloatArray  # (cable, direction, N): A without its viscous and tension terms
    grip: FloatArray  # tanh(limit/2)
    slip: FloatArray  # w
    now: FloatArray  # tensions of the trial
    tangent: FloatArray  # and what they gain per stretch, N/m
    row: FloatArray  # (cable, 4, N): below, diagonal, above, right hand side
    change: FloatArray  # (cable, 3, N): of w; per motor displacement; per load displacement
    ahead: FloatArray  # (cable, N): of the elimination
    saved: FloatArray  # (cable, 12, N + 1): the state at the last sample


BELOW, DIAGONAL, ABOVE, RIGHT = 0, 1, 2, 3


@inlined
def half_tanh(x: float) -> float:
    """Return tanh(x/2); by its continued fraction where that is good to rounding."""
    h = 0.5 * x
    s = h * h
    if s > 0.1:
        return float(math.tanh(h))
    return float(h * (945.0 + s * (105.0 + s)) / (945.0 + s * (420.0 + 15.0 * s)))


@inlined
def constant_bounds(t: ChainTables) -> bool:
    """Return whether the bounds stay the same through a sample, +-A."""
    return bool(
        t.mu_v_s_per_m == 0 and t.tension_exponent == 0 and t.lag_s == 0 and t.presliding_m == 0
    )


@inlined
def has_friction(t: ChainTables, cable: int, j: int) -> bool:
    """Return whether anything holds a segment at standstill; without, it slides either way."""
    return bool(t.mu_d > 0 and t.wrap[cable, 0, j] > 0)


@inlined
def prepare(t: ChainTables, s: ChainState, cable: int, factor: tuple[float, float]) -> None:
    """Set the limits of friction for a sample, and start from the slips of the last one.

    `factor` on it: of segments that slide as for positive angles of the pair, and back.
    """
    n = t.wrap.shape[2]
    s.factor[cable, cable], s.factor[cable, 1 - cable] = factor
    for j in range(n):
        rise = 1.0 + risen(
            t.stribeck_gain, t.stribeck_speed_m_per_s, t.recalls_friction, s.recalled[cable, j]
        )
        age = 1.0 + ageing_term(t.ageing_gain, t.ageing_s, s.age_s[cable, j])
        for d in range(2):
            mu = t.mu_d * s.factor[cable, d] * rise * age
            limit = min(t.wrap[cable, d, j] * mu, MOST_WRAP)
            if limit != s.limit[cable, d, j]:
                s.limit[cable, d, j] = limit
                s.grip[cable, d, j] = half_tanh(limit)
        moves = t.rounded or s.slides[cable, j] != 0
        s.slip[cable, j] = s.went_m[cable, j] if moves else 0.0


@inlined
def bound(
    t: ChainTables, s: ChainState, cable: int, j: int, towards: int, dt: float
) -> tuple[float, float, float]:
    """Return E of a segment that slides, its derivative by the slip (1/m) and by ln T."""
    d = (towards + 1) // 2
    slip = s.slip[cable, j]
    a, slope, by_tension = s.limit[cable, d, j], 0.0, 0.0
    if t.mu_v_s_per_m > 0:
        drag = t.wrap[cable, d, j] * s.factor[cable, d] * t.mu_v_s_per_m / dt
        a += drag * abs(slip)
        slope = drag * towards if slip * towards >= 0 else -drag * towards
    if t.tension_exponent != 0:
        mean = 0.5 * (s.now[cable, j] + s.now[cable, j + 1])
        factor, by_log = tension_factor(mean, t.reference_n, t.tension_exponent)
        a *= factor
        slope *= factor
        by_tension = by_log * a
    a = min(a, MOST_WRAP)
    if t.lag_s > 0:
        # dE/dt = (A - E) / (lag (1 + v_slow / |v|)), backward Euler; `late` = |v| dt times that.
        way, slow = abs(slip), t.lag_slow_m_per_s * dt
        late = t.lag_s * (way + slow) + dt * way
        new = dt * way / late if slow > 0 else dt / (t.lag_s + dt)
        held = max(towards * s.held[cable, j], 0.0)
        e = towards * ((1.0 - new) * held + new * a)
        by_way = (a - held) * dt * t.lag_s * slow / (late * late) if slow > 0 else 0.0
        turned = 1.0 if slip * towards >= 0 else -1.0
        return e, towards * new * slope + turned * by_way, new * towards * by_tension
    return towards * a, towards * slope, towards * by_tension


@inlined
def sticks(t: ChainTables, s: ChainState, cable: int, j: int) -> bool:
    """Return whether a segment has been at standstill for so long that it holds more."""
    return bool(t.excess[j] > 0 and s.rested_s[cable, j] > t.rest_s)


@inlined
def rest(t: ChainTables, s: ChainState, cable: int, j: int, dt: float) -> None:
    """Keep which way a segment slid last, and how long it has been at standstill."""
    still = s.slides[cable, j] == 0
    if not still:
        s.slid[cable, j] = s.slides[cable, j]
        still = abs(s.slip[cable, j]) <= t.still_m_per_s * dt
    s.rested_s[cable, j] = s.rested_s[cable, j] + dt if still else 0.0
    if sticks(t, s, cable, j):
        s.slides[cable, j] = 0


@inlined
def gives_way(
    t: ChainTables, s: ChainState, cable: int, j: int, here: float, there: float, dt: float
) -> int:
    """Direction in which a segment at standstill has to slide between two tensions; 0: it holds."""
    trial = 1 if there > here else -1
    d = (trial + 1) // 2
    if constant_bounds(t):
        grip = trial * s.grip[cable, d, j]
    else:
        e, _, _ = bound(t, s, cable, j, trial, dt)
        grip = half_tanh(e)
    if t.excess[j] > 0 and (s.slid[cable, j] == -trial or sticks(t, s, cable, j)):
        grip = half_tanh(2.0 * math.atanh(grip) + trial * t.excess[j])
    sure = HELD * (abs(there) + abs(here) + FAINT * t.reference_n)
    if trial * (there - here - grip * (there + here)) > sure:
        return trial
    return 0


@inlined
def bent(t: ChainTables, s: ChainState, cable: int, j: int, slip: float) -> tuple[float, float]:
    """Return E of a bristle that has not given way, and its derivative by the slip, 1/m."""
    side = 1 if s.held[cable, j] + slip >= 0 else 0
    slope = s.limit[cable, side, j] / t.presliding_m
    return s.held[cable, j] + slope * slip, slope


@compiled_in_place
def nearing(
    t: ChainTables, s: ChainState, cable: int, j: int, both: float, dt: float
) -> tuple[float, float, float]:
    """Return F of a bristle that nears its limit, its derivative by the slip and by the tensions.

    In N, N/m, and 1; `both` is the sum of the tensions at its ends, N.
    """
    slip = s.slip[cable, j]
    towards = 1 if slip >= 0 else -1
    limit, steeper, _ = bound(t, s, cable, j, towards, dt)
    other, _, _ = bound(t, s, cable, j, -towards, dt)
    ahead, behind = half_tanh(limit), half_tanh(other)
    before, grip = s.bristle_n[cable, j], 0.0
    if t.keeps_share:
        grip = half_tanh(s.held[cable, j])
        before = grip * both
    if towards * before > towards * ahead * both:
        before, grip = ahead * both, ahead
    elif towards * before < towards * behind * both:
        before, grip = behind * both, behind
    left = math.exp(-abs(slip) / t.presliding_m)
    short = (ahead * both - before) * left
    by_slip = towards * short / t.presliding_m
    by_slip += (1.0 - left) * both * 0.5 * (1.0 - ahead * ahead) * steeper
    return ahead * both - short, by_slip, ahead * (1.0 - left) + grip * left


@inlined
def slides_over(t: ChainTables, s: ChainState, cable: int, j: int, slip: float, dt: float) -> int:
    """Direction in which a slip bends a bristle until it gives way; 0: it does not.

    One that slides already does so until it is clearly unbent.
    """
    if t.rounded:
        return 0
    e, _ = bent(t, s, cable, j, slip)
    high, _, _ = bound(t, s, cable, j, 1, dt)
    low, _, _ = bound(t, s, cable, j, -1, dt)
    towards = s.slides[cable, j]
    return (
        1
        if e > high + HELD * (1 - 2 * towards)
        else -1
        if e < low - HELD * (1 + 2 * towards)
        else 0
    )


@inlined
def set_row(t: ChainTables, s: ChainState, cable: int, j: int, dt: float) -> float:
    """Linearise the law of a moving segment; return its error over the tensions."""
    slip = s.slip[cable, j]
    towards = s.slides[cable, j]
    here, there = s.now[cable, j], s.now[cable, j + 1]
    both = max(here + there, 0.0)
    by_slip, lean = 0.0, 0.0
    if not has_friction(t, cable, j):
        towards = 1 if slip >= 0 else -1
    if constant_bounds(t):
        g = towards * s.grip[cable, (towards + 1) // 2, j]
        force = g * (there + here)
    elif t.rounded and has_friction(t, cable, j):
        force, by_slip, g = nearing(t, s, cable, j, both, dt)
    else:
        by_tension = 0.0
        if t.presliding_m > 0 and s.slides[cable, j] == 0 and has_friction(t, cable, j):
            e, slope = bent(t, s, cable, j, slip)
        else:
            e, slope, by_tension = bound(t, s, cable, j, towards, dt)
        g = half_tanh(e)
        force = g * (there + here)
        steep = 0.5 * (1.0 - g * g)
        by_slip, lean = steep * slope * both, steep * by_tension
    error = there - here - force
    below = (1.0 + g + lean) * s.tangent[cable, j]
    above = (1.0 - g - lean) * s.tangent[cable, j + 1]
    s.row[cable, BELOW, j] = below
    s.row[cable, ABOVE, j] = above
    s.row[cable, DIAGONAL, j] = -below - above - max(by_slip, 0.0)
    s.row[cable, RIGHT, j] = -error
    return float(abs(error) / (both + FAINT * t.reference_n))
