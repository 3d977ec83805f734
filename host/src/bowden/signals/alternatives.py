"""What a recording and a model leave open: other readings of them that may be as right.

`estimation.covariance` simulates them; their distance from the best estimate is part of the noise.
"""

from __future__ import annotations

import math

import numpy as np

from bowden.model import Mode, Model
from bowden.model.experiments.variants import (
    with_damping,
    with_effects,
    with_memory,
    with_viscous_term,
)
from bowden.model.mesh.solver import needs_implicit_steps
from bowden.recording.recording import Recording

MESH_FACTOR = 1.6  # error of N segments over its distance from 2 N: it falls 2.5-fold a doubling
OTHERWISE = 3.0  # times a memory, or as much less: none is known better
UNDAMPED_OR_MORE = (0.0, 3.0)  # times the damping of an underdamped rotor
UNSEEN_S_PER_M = 1e-9  # a viscous term of 1e-9 at 1 m/s beside a mu of 0.1 and more
HELD_OR_NOT = math.sqrt(2 / 3)  # half a sample late, early or neither, each as likely


def held_torque(recording: Recording) -> Recording:
    """Return a recording whose motor torque is half a sample late, as if it was held.

    What a torque does between two samples is not recorded: a straight line and a step differ by
    half a sample.
    """
    time_s, torque = recording.time_s, recording.motor_torque_nm
    late = time_s - 0.5 * np.diff(time_s, prepend=time_s[0])
    return recording.with_channels(motor_torque_nm=np.interp(late, time_s, torque))


def open_numbers(model: Model) -> list[tuple[Model, float]]:
    """Return models with other numbers that might be as right, and the share of each.

    How soon a motor's ringing ends, where its inertia is from a data sheet, no file tells.
    """
    pair = model.transmission
    told = any("damping" in one for one in model.document.effects)
    rings = pair.motor_inertia_kg_m2 > 0.0 and pair.damping_s > 0.0 and model.solver == "mesh"
    if told or not rings:
        return []
    alike = math.sqrt(1 / len(UNDAMPED_OR_MORE))
    return [(with_damping(model, k * pair.damping_s), alike) for k in UNDAMPED_OR_MORE]


def other_memories(model: Model, count: int) -> list[tuple[Model, float]]:
    """Return so many models with other memories of the sliding speed, and the share of each.

    Where friction falls with speed a cable goes by single slips, and when each comes is the
    memory's, which no recording of a rig has told before. No two memories slip alike: what they do
    in the mean is known, and by as much as they differ no single slip is.
    """
    law = model.transmission.friction
    if law.stribeck_gain == 0.0 or law.memory_s == 0.0 or law.memory_is_of_friction:
        return []
    memories = law.memory_s * np.geomspace(1 / OTHERWISE, OTHERWISE, count)
    return [(with_memory(model, float(one)), math.sqrt(1 / count)) for one in memories]


def solved_two_ways(model: Model, mode: Mode) -> tuple[Model, Model] | None:
    """Return a rig with stiction for either way to solve its mesh; None for other rigs.

    Where a segment gives way its neighbours may follow, and eqs. (1) and (6) don't say how many:
    exact steps let one go after the other, implicit ones all that are overloaded at the end of a
    step. Without those effects of the model that need implicit steps.
    """
    if model.solver != "mesh" or not model.transmission.friction.has_stiction:
        return None
    places = range(len(model.effects))
    plain = with_effects(model, [k for k in places if not is_dear(with_effects(model, [k]), mode)])
    if is_dear(plain, mode):
        return None
    return plain, with_viscous_term(plain, UNSEEN_S_PER_M)


def solved_like(model: Model, other: Model, mode: Mode) -> Model:
    """Return a model as it is solved like another: implicitly, where that one is.

    Of a rig with stiction both ways answer otherwise (`solved_two_ways`).
    """
    pair = model.transmission
    if not pair.friction.has_stiction or needs_implicit_steps(pair, mode):
        return model
    return with_viscous_term(model, UNSEEN_S_PER_M) if is_dear(other, mode) else model


def is_dear(model: Model, mode: Mode) -> bool:
    """Return whether a simulation takes several times as long as that of a plain pair."""
    changing = any(one.variant.histories is not None for one in model.effects)
    return model.solver == "lumped" or changing or needs_implicit_steps(model.transmission, mode)
