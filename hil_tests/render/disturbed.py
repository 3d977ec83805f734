"""Tasks in which operator or cables change: trembling, letting go, grasping, bending, slipping.

As `tasks`, whose tunnel they go through. What differs from rig to rig (how fast and how far an
operator trembles, which way the conduit is bent) follows from the rig's seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil_tests.render.course import Conditions
from hil_tests.render.rigs import RenderRig
from hil_tests.render.tasks import SWELL_S, TASKS, Task, sine, stay

TREMOR_HZ: Final = (8.0, 12.0)
TREMOR_RAD: Final = (0.005, 0.03)  # in the operator's mind; physiological to essential
BEND_RAD: Final = 0.5
BEND_FROM_S: Final = 1.0
BEND_TAKES_S: Final = 2.0
DROP_S: Final = 1.6  # a clamp slips in mid stroke
DROP_TAKES_S: Final = 0.02
DROPPED: Final = 0.7
RELEASE_S: Final = 1.0
RELEASE_TAKES_S: Final = 0.01
GRASP_S: Final = 1.0
GRASP_TAKES_S: Final = 0.02
TENSING_S: Final = 0.7  # relaxed and tense in turn
TENSING_TAKES_S: Final = 0.1
TENSE: Final = 5.0  # co-contracted over relaxed is the square of it
Array = NDArray[np.float64]


def _random(rig: RenderRig) -> np.random.Generator:
    return np.random.default_rng([23, rig.seed])


def _tremor(time_s: Array, rig: RenderRig) -> Array:
    random = _random(rig)
    frequency_hz = random.uniform(*TREMOR_HZ)
    low, high = np.log(TREMOR_RAD)
    amplitude_rad = math.exp(random.uniform(low, high))
    shaking = sine(amplitude_rad, frequency_hz)(time_s, rig)
    return sine(0.3, 0.5)(time_s, rig) + shaking


def _ramp(time_s: Array, from_s: float, takes_s: float) -> Array:
    return np.clip((time_s - from_s) / takes_s, 0.0, 1.0)


def _let_go(time_s: Array, _rig: RenderRig) -> Conditions:
    return {"hold": 1.0 - _ramp(time_s, RELEASE_S, RELEASE_TAKES_S)}


def _grasp(time_s: Array, _rig: RenderRig) -> Conditions:
    return {"hold": _ramp(time_s, GRASP_S, GRASP_TAKES_S)}


def _reach_through(time_s: Array, _rig: RenderRig) -> Array:
    """Move an operator who is on the way at the grasp."""
    return 0.4 * np.sin(2.0 * math.pi * np.maximum(time_s - GRASP_S, 0.0))


def _bend(time_s: Array, rig: RenderRig) -> Conditions:
    towards = 1.0 if _random(rig).random() < 0.5 else -1.0
    return {"extra_wrap_rad": towards * BEND_RAD * _ramp(time_s, BEND_FROM_S, BEND_TAKES_S)}


def _slip(time_s: Array, _rig: RenderRig) -> Conditions:
    return {"pretension": 1.0 - (1.0 - DROPPED) * _ramp(time_s, DROP_S, DROP_TAKES_S)}


def _tense(time_s: Array, _rig: RenderRig) -> Conditions:
    """Relaxed and tense in turn; usual to begin with."""
    phase = np.maximum(time_s - SWELL_S, 0.0) % (2.0 * TENSING_S)
    tense = _ramp(phase, 0.0, TENSING_TAKES_S) - _ramp(phase, TENSING_S, TENSING_TAKES_S)
    level = np.where(time_s < SWELL_S, 0.0, 2.0 * tense - 1.0)
    return {"tense": TENSE**level}


def _strokes(name: str, conditions: Callable[[Array, RenderRig], Conditions]) -> Task:
    return Task(
        name,
        "disturbed",
        SWELL_S + 4.0 + 1e-3,  # a sample more closes the last path
        sine(0.4, 0.5),
        period_s=2.0,
        conditions=conditions,
        aims_past=True,
    )


DISTURBED: Final = (
    Task("tremor", "disturbed", 2.5, _tremor),
    Task(
        "release",
        "disturbed",
        2.5,
        stay(0.25),
        scored_from_s=0.9,
        conditions=_let_go,
        free_from_s=RELEASE_S + RELEASE_TAKES_S,
        aims_past=True,
    ),
    Task(
        "grasp",
        "disturbed",
        2.6,
        _reach_through,
        scored_from_s=0.9,
        conditions=_grasp,
        aims_past=True,
    ),
    _strokes("bend", _bend),
    _strokes("pretension-drop", _slip),
    _strokes("tensing", _tense),
)
ALL_TASKS: Final = (*TASKS, *DISTURBED)
