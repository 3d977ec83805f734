"""The motor's mass on its cables, in time: Newmark's method, in steps short enough for its ringing.

The strands' tension is early by `damping_s` for their damping; a mass whose acceleration is late by
it is damped alike, whatever the cables' stiffness is just now. That is what Newmark's method does
with gamma = 1/2 + damping_s / dt; with beta = (gamma + 1/2)^2 / 4 it is stable at any stiffness
(Hughes, The Finite Element Method, 2000, section 9.1). Steps shorter than `damping_s` are no use.

`mesh.implicit` chooses its steps by what each may be off by; `mesh.events`, whose steps are cheap,
takes them all as short.
"""

from __future__ import annotations

import math

import numpy as np

from bowden.model.compiled import inlined
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

STEPS_A_PERIOD = 128  # of ringing on both cables, end to end, at most
CLOSE = 2e-4  # of the pretension: what the steps of a period may be off by
DOUBLED = 8.0  # times less than that, and steps may be twice as long
ROUNDING = 1e-6  # of a step: so much more is no reason for another one


def shortest_step_s(transmission: Transmission) -> float:
    """Return the shortest step that is of use; infinite without a mass."""
    return max(_period_s(transmission) / STEPS_A_PERIOD, transmission.damping_s)


def close_m_per_s(transmission: Transmission) -> float:
    """Return what steps may be off by, m/s."""
    stretch_m = transmission.pretension_n / _stiffness_n_per_m(transmission)
    return CLOSE * stretch_m / _period_s(transmission)


def _period_s(transmission: Transmission) -> float:
    mass_kg = transmission.motor_inertia_kg_m2 / transmission.motor_pulley_radius_m**2
    if mass_kg == 0.0:
        return math.inf
    return 2.0 * math.pi * math.sqrt(mass_kg / _stiffness_n_per_m(transmission))


def _stiffness_n_per_m(transmission: Transmission) -> float:
    return 2.0 * transmission.axial_stiffness_n / transmission.length_m


def cut(time_s: FloatArray, longest_s: float) -> FloatArray:
    """Return the times with others evenly between those that lie further apart."""
    steps = np.diff(time_s)
    parts = np.maximum(np.ceil(steps / longest_s - ROUNDING), 1).astype(int)
    if not np.any(parts > 1):
        return time_s
    which = np.repeat(np.arange(steps.size), parts)
    share = (np.arange(which.size) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[which]
    fine: FloatArray = np.append(time_s[which] + share * steps[which], time_s[-1])
    return fine


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
