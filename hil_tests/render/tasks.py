"""What the operator does with the handle, and what is asked of the drive meanwhile.

Input: a `RenderRig`. Output: for every tick the intended motion of the operator and, in torque
mode, the target torque; and what is wanted at the load for an angle. All tasks begin at standstill
at zero, with virgin cables, and are scored from `scored_from_s`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from bowden_rig.bench import TICKS_PER_S
from numpy.typing import NDArray

from hil_tests.render.course import Conditions
from hil_tests.render.course import course as course_of
from hil_tests.render.rigs import RenderRig, Tunnel

TUNNEL_MODE: Final = -1
TORQUE_MODE: Final = -2
SWELL_S: Final = 0.5
MOST_OVERREACH_RAD: Final = 0.8
Kind = Literal["strokes", "free", "rest", "steps", "disturbed"]
Array = NDArray[np.float64]
Motion = Callable[[Array, RenderRig], Array]


@dataclass(frozen=True)
class Task:
    """One thing to do.

    Parameters
    ----------
    name : str
    kind : str
        ``strokes`` through the tunnel, ``free`` strokes in a dead zone wide enough for them,
        ``rest``: hold still after having moved; ``steps`` of torque at a still operator;
        ``disturbed``: in the tunnel, operator or cables change meanwhile.
    duration_s, scored_from_s : float
    motion : callable
        Intended angle, rad, from time, s, on a rig.
    period_s : float
        Of a closed path; 0 where the path is not closed.
    conditions : callable, optional
        What is not as usual, columns of a `course`, from time and rig.
    free_from_s : float
        When the operator has let go; infinite where never.
    aims_past : bool
        An operator who meets friction aims past the stroke that they want.
    asked_nm : callable, optional
        Torque asked of the motor, from time and rig; without it the tunnel asks.
    """

    name: str
    kind: Kind
    duration_s: float
    motion: Motion
    scored_from_s: float = SWELL_S
    period_s: float = 0.0
    conditions: Callable[[Array, RenderRig], Conditions] | None = None
    free_from_s: float = math.inf
    aims_past: bool = False
    asked_nm: Motion | None = None

    @property
    def mode(self) -> int:
        """Mode of operation of the drive."""
        return TUNNEL_MODE if self.asked_nm is None else TORQUE_MODE

    @property
    def ticks(self) -> int:
        """Control periods that it takes."""
        return round(self.duration_s * TICKS_PER_S)

    def time_s(self) -> Array:
        """Time at the start of each tick."""
        return np.arange(self.ticks) / TICKS_PER_S

    def operator(self, rig: RenderRig) -> Array:
        """Intended angle (rad) and speed (rad/s) of the operator in each tick, shape (ticks, 2)."""
        angle = self.motion(np.arange(self.ticks + 1) / TICKS_PER_S, rig)
        if self.aims_past:
            felt_nm = rig.ratio * rig.friction_nm
            overreach_rad = min(felt_nm / rig.rig.operator.stiffness_nm_per_rad, MOST_OVERREACH_RAD)
            angle *= 1.0 + overreach_rad / np.max(np.abs(angle))
        return np.column_stack([angle[:-1], np.diff(angle) * TICKS_PER_S])

    def course(self, rig: RenderRig) -> Array:
        """Return what happens in each tick, shape (ticks, 6): see `course`."""
        changed = self.conditions(self.time_s(), rig) if self.conditions else {}
        return course_of(self.operator(rig), changed)

    def tunnel(self, rig: RenderRig) -> Tunnel:
        """Tunnel to configure: free in a dead zone that covers the whole motion."""
        return replace(rig.tunnel, half_width_rad=1.5) if self.kind == "free" else rig.tunnel

    def target_nm(self, rig: RenderRig) -> Array | None:
        """Torque asked of the motor in each tick, without friction; None in the tunnel."""
        return None if self.asked_nm is None else self.asked_nm(self.time_s(), rig)

    def wanted_nm(self, rig: RenderRig, load_angle_rad: Array) -> Array:
        """Torque by the cables on the load that is wanted at these angles, one a tick."""
        target = self.target_nm(rig)
        if target is None:
            tunnel = self.tunnel(rig)
            inside = np.clip(load_angle_rad, -tunnel.half_width_rad, tunnel.half_width_rad)
            spring = tunnel.stiffness_nm_per_rad * (load_angle_rad - inside)
            target = -np.clip(spring, -tunnel.limit_nm, tunnel.limit_nm)
        return rig.ratio * target


def swell(time_s: Array) -> Array:
    """Rise from 0 to 1 within `SWELL_S`, without a jump of the speed."""
    e = np.clip(time_s / SWELL_S, 0.0, 1.0)
    return e * e * (3.0 - 2.0 * e)


def sine(amplitude_rad: float, frequency_hz: float, middle_rad: float = 0.0) -> Motion:
    """Return strokes about a middle."""

    def motion(time_s: Array, _rig: RenderRig) -> Array:
        phase = 2.0 * math.pi * frequency_hz * time_s
        angle: Array = swell(time_s) * (middle_rad + amplitude_rad * np.sin(phase))
        return angle

    return motion


def stay(angle_rad: float) -> Motion:
    """Return a move to an angle, and rest there."""

    def motion(time_s: Array, _rig: RenderRig) -> Array:
        angle: Array = angle_rad * swell(time_s)
        return angle

    return motion


def _strokes(
    name: str, amplitude_rad: float, frequency_hz: float, cycles: int, middle_rad: float = 0.0
) -> Task:
    return Task(
        name,
        "free" if name == "free" else "strokes",
        SWELL_S + cycles / frequency_hz + 1e-3,  # a sample more closes the last path
        sine(amplitude_rad, frequency_hz, middle_rad),
        period_s=1.0 / frequency_hz,
        aims_past=True,
    )


def _steps_nm(time_s: Array, rig: RenderRig) -> Array:
    level = np.array([0.0, 1.0, 0.5, -0.5, -1.0, 0.0])
    steps: Array = rig.tunnel.limit_nm * level[(time_s / 0.5).astype(int) % len(level)]
    return steps


TASKS: Final = (
    _strokes("tunnel-slow", 0.4, 0.25, 1),
    _strokes("tunnel", 0.5, 0.5, 2),
    _strokes("tunnel-fast", 0.4, 1.0, 3),
    _strokes("wall-edge", 0.04, 1.0, 3, middle_rad=0.05),
    _strokes("free", 0.4, 0.5, 2),
    Task("steps", "steps", 3.0, stay(0.0), scored_from_s=0.5, asked_nm=_steps_nm),
    Task("rest-in-wall", "rest", 2.5, stay(0.2), scored_from_s=1.0),
    Task("rest-in-middle", "rest", 2.5, stay(0.03), scored_from_s=1.0),
)


def task_named(name: str, among: Sequence[Task] = TASKS) -> Task:
    """Return the task of that name; ValueError says which there are."""
    for task in among:
        if task.name == name:
            return task
    raise ValueError(f"task: found {name!r}; accepted: {', '.join(t.name for t in among)}")
