"""One cable in its conduit, one step: springs, rubbing, moving. Compiled; knows numbers alone.

A cable is a row of equal masses joined by springs that carry no compression. A mass rubs on its
stretch of conduit through an elasto-plastic bristle: stuck, the liner shears elastically; sliding,
friction is mu times the normal force, which is the LOCAL tension times the wrap angle of that
stretch (a capstan, element by element) plus the cable's own weight. Half springs at the ends meet
the pulleys.

Every loop here runs over independent elements, so that the processor takes several at a time; what
is rare (mu that depends on tension, a cable that stiffens) has a loop of its own. `mechanics` calls
`move`.

Arrays: `masses` (3, 2, elements), positions, speeds and bristles of both cables; `springs`
(3, 2, elements + 1), tension, creep and, in the last one's place i, friction that mass i can meet.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig.compiled import compiled
from bowden_rig.rig.constants import Constants

POSITION = 0
SPEED = 1
BRISTLE = 2

TENSION = 0
CREEP = 1
LIMIT = 2


@compiled
def rub(  # noqa: PLR0917  (compiled code takes no keywords)
    speed: float, windup: float, stiffness: float, limit: float, dt: float, inertia: float
) -> tuple[float, float]:
    """Rub for one step against friction of at most `limit`; the new speed and bristle.

    Solves speed' = speed - (dt / inertia) clip(stiffness (windup + dt speed'), +-limit), which is
    monotone and so has one solution; friction can only take energy out.
    """
    new = (speed - dt / inertia * stiffness * windup) / (1.0 + dt * dt * stiffness / inertia)
    bent = windup + dt * new
    most = limit / stiffness
    if bent > most:
        return speed - dt / inertia * limit, most
    if bent < -most:
        return speed + dt / inertia * limit, -most
    return new, bent


@compiled
def tension_of(c: Constants, elastic_n: float) -> float:
    """Tension of a cable that stiffens, from `elastic_n`, what it would be if it did not.

    Its tangent stiffness grows with tension, k (1 + beta T) / (1 + beta T0), and is k at T0.
    """
    beta = c.stiffening_per_n
    at_rest = 1.0 + beta * c.pretension_n
    return float((at_rest * math.exp(beta * (elastic_n - c.pretension_n) / at_rest) - 1.0) / beta)


@compiled
def mu_of(c: Constants, speed: float, tension_n: float) -> float:
    """Mu of a mass at its speed and tension: Stribeck, viscous, (T / T0)^-p."""
    ratio = speed / c.stribeck_speed_m_per_s
    mu = c.mu + c.viscous_s_per_m * abs(speed)
    mu += c.mu_static_excess * math.exp(-ratio * ratio)
    if c.tension_exponent != 0.0:
        least = 1e-3 * c.pretension_n  # a slack cable has no normal force, whatever its mu
        mu *= (max(tension_n, least) / c.pretension_n) ** -c.tension_exponent
    return float(mu)


@compiled
def spring(  # noqa: PLR0917
    c: Constants, creep_m: float, stretch_m: float, rate: float, stiffer: float, pretension_n: float
) -> float:
    """Tension of one spring, `stiffer` times an element's; 0 where it would have to push."""
    elastic = pretension_n + stiffer * c.spring_n_per_m * (stretch_m - creep_m)
    if c.stiffening_per_n != 0.0:
        elastic = tension_of(c, elastic)
    if elastic <= 0.0:
        return 0.0
    return max(elastic + stiffer * c.damper_n_s_per_m * rate, 0.0)


@compiled
def pull(  # noqa: PLR0917
    c: Constants,
    masses: NDArray[np.float64],
    springs: NDArray[np.float64],
    cable: int,
    pretension_n: float,
    near: tuple[float, float],
    far: tuple[float, float],
) -> None:
    """Tension of every spring; 0 where it would have to push. `near`, `far`: (u, speed) of ends."""
    n = masses.shape[2]
    k, d, end = c.spring_n_per_m, c.damper_n_s_per_m, c.end_spring
    first, last = masses[POSITION, cable, 0], masses[POSITION, cable, n - 1]
    stretch, rate = first - near[0], masses[SPEED, cable, 0] - near[1]
    springs[TENSION, cable, 0] = spring(
        c, springs[CREEP, cable, 0], stretch, rate, end, pretension_n
    )
    stretch, rate = far[0] - last, far[1] - masses[SPEED, cable, n - 1]
    springs[TENSION, cable, n] = spring(
        c, springs[CREEP, cable, n], stretch, rate, end, pretension_n
    )
    if c.stiffening_per_n == 0.0:
        for i in range(1, n):
            stretch = masses[POSITION, cable, i] - masses[POSITION, cable, i - 1]
            elastic = pretension_n + k * (stretch - springs[CREEP, cable, i])
            damped = max(elastic + d * (masses[SPEED, cable, i] - masses[SPEED, cable, i - 1]), 0.0)
            springs[TENSION, cable, i] = damped if elastic > 0.0 else 0.0
    else:
        for i in range(1, n):
            stretch = masses[POSITION, cable, i] - masses[POSITION, cable, i - 1]
            rate = masses[SPEED, cable, i] - masses[SPEED, cable, i - 1]
            springs[TENSION, cable, i] = spring(
                c, springs[CREEP, cable, i], stretch, rate, 1.0, pretension_n
            )
    if c.creep > 0.0:  # a Kelvin-Voigt element in series with each spring
        for i in range(n + 1):
            stiffer = end if i % n == 0 else 1.0
            settled = c.creep * (springs[TENSION, cable, i] - pretension_n) / (stiffer * k)
            springs[CREEP, cable, i] += c.creep_share * (settled - springs[CREEP, cable, i])


@compiled
def find_friction(  # noqa: PLR0917
    c: Constants,
    wrap_rad: NDArray[np.float64],
    masses: NDArray[np.float64],
    springs: NDArray[np.float64],
    cable: int,
    asymmetry: float,
    factor: float,
) -> None:
    """Most friction that each mass can meet; `asymmetry`: share more of it towards the load.

    The side is the bristle's, not the speed's: at standstill friction bears what it bore sliding.
    """
    n = masses.shape[2]
    weight, mu, viscous = c.weight_n, c.mu, c.viscous_s_per_m
    if c.mu_static_excess == 0.0 and c.tension_exponent == 0.0:
        for i in range(n):
            pair = springs[TENSION, cable, i] + springs[TENSION, cable, i + 1]
            normal = 0.5 * pair * wrap_rad[i] + weight
            v = masses[SPEED, cable, i]
            side = asymmetry if masses[BRISTLE, cable, i] > 0.0 else -asymmetry
            springs[LIMIT, cable, i] = (mu + viscous * abs(v)) * (1.0 + side) * normal * factor
    else:
        for i in range(n):
            mean = 0.5 * (springs[TENSION, cable, i] + springs[TENSION, cable, i + 1])
            v = masses[SPEED, cable, i]
            side = asymmetry if masses[BRISTLE, cable, i] > 0.0 else -asymmetry
            normal = mean * wrap_rad[i] + weight
            springs[LIMIT, cable, i] = mu_of(c, v, mean) * (1.0 + side) * normal * factor


@compiled
def slide(
    c: Constants, masses: NDArray[np.float64], springs: NDArray[np.float64], cable: int
) -> None:
    """Speeds, bristles and positions from tensions and friction: `rub` for each mass.

    With a frictional lag a bristle that is being bent comes nearer to its limit by no more than a
    share of what is missing in a step; it unbends at once, so that friction still only takes.
    """
    stiffness, dt = c.bristle_n_per_m, c.dt_s
    push = dt / c.mass_kg
    yielding = 1.0 + dt * dt * stiffness / c.mass_kg
    share = c.lag_share
    for i in range(masses.shape[2]):
        force, z = springs[LIMIT, cable, i], masses[BRISTLE, cable, i]
        drive = springs[TENSION, cable, i + 1] - springs[TENSION, cable, i]
        speed = masses[SPEED, cable, i] + push * drive
        new = (speed - push * stiffness * z) / yielding
        bent = z + dt * new
        most = force / stiffness
        if share < 1.0:
            most = abs(z) + share * (most - abs(z))
            force = most * stiffness
        over, under = bent > most, bent < -most
        new = speed - push * force if over else (speed + push * force if under else new)
        masses[BRISTLE, cable, i] = most if over else (-most if under else bent)
        masses[SPEED, cable, i] = new
        masses[POSITION, cable, i] += dt * new


@compiled
def move(  # noqa: PLR0917
    c: Constants,
    wrap_rad: NDArray[np.float64],
    masses: NDArray[np.float64],
    springs: NDArray[np.float64],
    cable: int,
    asymmetry: float,
    pretension_n: float,
    factor: float,
    near: tuple[float, float],
    far: tuple[float, float],
) -> None:
    """Let one cable pass a step; afterwards `springs` holds the tensions before it."""
    pull(c, masses, springs, cable, pretension_n, near, far)
    find_friction(c, wrap_rad, masses, springs, cable, asymmetry, factor)
    slide(c, masses, springs, cable)
