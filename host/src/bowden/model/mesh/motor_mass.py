"""The motor's mass on its cables, in time: Newmark's method, in steps short enough for its ringing.

The strands' tension is early by `damping_s` for their damping; a mass whose acceleration is late by
it is damped alike, whatever the cables' stiffness is just now. That is what Newmark's method does
with gamma = 1/2 + damping_s / dt; with beta = (gamma + 1/2)^2 / 4 it is stable at any stiffness
(Hughes, The Finite Element Method, 2000, section 9.1). Steps shorter than `damping_s` are no use.

`mesh.events` and `mesh.implicit` choose their steps by what each may be off by.
"""

from __future__ import annotations

import math

from bowden.model.compiled import inlined
from bowden.model.mesh.state import segments_of
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

STEPS_A_PERIOD = 128  # of ringing on both cables, end to end, at most
DOUBLED = 8.0  # times less than that, and steps may be twice as long
ROUNDING = 1e-6  # of a step: so much more is no reason for another one
STEPS_AND_ATTEMPTS = 8  # a shortest step: two accepted ones, each after a few that were not


def shortest_step_s(transmission: Transmission) -> float:
    """Return the shortest step that is of use; infinite without a mass."""
    return max(_period_s(transmission) / STEPS_A_PERIOD, transmission.damping_s)


def close_m_per_s(transmission: Transmission) -> float:
    """Return what steps may be off by, m/s.

    Those of a period together: the stretch of the pretension over segments^2, less than the mesh is
    off by, whose error falls about as fast.
    """
    segments = segments_of(transmission)
    stretch_m = transmission.pretension_n / _stiffness_n_per_m(transmission)
    return stretch_m / segments**2 / _period_s(transmission)


def _period_s(transmission: Transmission) -> float:
    mass_kg = transmission.motor_inertia_kg_m2 / transmission.motor_pulley_radius_m**2
    if mass_kg == 0.0:
        return math.inf
    return 2.0 * math.pi * math.sqrt(mass_kg / _stiffness_n_per_m(transmission))


def _stiffness_n_per_m(transmission: Transmission) -> float:
    return 2.0 * transmission.axial_stiffness_n / transmission.length_m


@inlined
def steps_left(left_s: float, longest_s: float) -> int:
    """Return how many equal steps are left of a sample."""
    return max(math.ceil(left_s / longest_s - ROUNDING), 1)


@inlined
def most_steps(whole_s: float, shortest_s: float) -> int:
    """Return how many steps and attempts a sample may take: a guard."""
    return STEPS_AND_ATTEMPTS * (1 + int(whole_s / shortest_s))


@inlined
def judged(
    off_m_per_s: float, close_m_per_s: float, dt: float, longest_s: float, shortest_s: float
) -> tuple[bool, float]:
    """Return whether a step is close enough, and how long those after it may be."""
    if off_m_per_s > close_m_per_s and dt > (1.0 + ROUNDING) * shortest_s:
        return False, max(0.5 * dt, shortest_s)
    if DOUBLED * off_m_per_s < close_m_per_s:
        return True, max(longest_s, 2.0 * dt)
    return True, longest_s


@inlined
def between(values: FloatArray, i: int, done: float) -> float:
    """Return a series on its way to sample i; of its first, or only, sample: that."""
    if values.size == 1 or i == 0:
        return float(values[0])
    if done == 1.0:
        return float(values[i])
    return float(values[i - 1] + done * (values[i] - values[i - 1]))


@inlined
def pull_of_mass(
    mass_kg: float, damping_s: float, dt: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """Return the pull of the motor's mass on the cables and its fall with the motor's motion.

    Mass times acceleration for a displacement x in this step is fall x - pull, in N and N/m.
    `speed` and `acceleration` are those before it.
    """
    beta = 0.25 * (1.0 + damping_s / dt) ** 2
    fall = mass_kg / (beta * dt * dt)
    return fall * dt * (speed + (0.5 - beta) * dt * acceleration), fall


@inlined
def moved_on(
    damping_s: float, dt: float, moved: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """Return speed and acceleration at the end of a step."""
    late = damping_s / dt
    beta = 0.25 * (1.0 + late) ** 2
    at_end = (moved - dt * (speed + (0.5 - beta) * dt * acceleration)) / (beta * dt * dt)
    return speed + dt * ((0.5 - late) * acceleration + (0.5 + late) * at_end), at_end


@inlined
def off_by(dt: float, acceleration: float, before: float) -> float:
    """Return about what a step is off by, m/s, for its acceleration changes within it, too."""
    return dt * abs(acceleration - before) / 12.0
