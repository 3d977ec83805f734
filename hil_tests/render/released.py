"""What full information reaches after a release: the motor torque is searched for on the plant.

Input: a rig. Output: the least RMS error that the search has found, over the whole trial, on the
simulated rig. Until the release the law with the load cell drives the motor; from then on its
torque is any that keeps the motor's limit and slew, linear between knots of 2 ms. A window of 40 ms
moves on by 6 ms; in each a Gauss-Newton search on the plant itself, whose whole state is known,
minimises the error. What is found can be reached: the least error is at most that.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from bowden_rig.bench import TICKS_PER_S
from bowden_rig.rig import mechanics
from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled
from numpy.typing import NDArray

from hil_tests.render.disturbed import DISTURBED, RELEASE_S
from hil_tests.render.laws import FULL_TORQUE_S, OURS, law_named
from hil_tests.render.measures import rms
from hil_tests.render.rigs import RenderRig
from hil_tests.render.tasks import Task, task_named
from hil_tests.render.trial import IMPOSED_TICKS, Trial, on_the_rig, prepared, run

KNOT_TICKS: Final = 8
KNOTS: Final = 20
WINDOW_TICKS: Final = KNOTS * KNOT_TICKS
KEPT_KNOTS: Final = 3  # of each window
LEADS_TICKS: Final = (0, 20, 40, 60)  # by which a first guess turns the friction over before a turn
STEPS: Final = 5  # of Gauss-Newton, at most
TRIALS: Final = 4  # of a step's damping
LEAST_GAIN: Final = 0.01  # of the squared error: a step that gains less is the last one
DIFFERENCE: Final = 0.02  # of the motor's limit, for the derivatives
Array = NDArray[np.float64]


class State(NamedTuple):
    """What the plant's kernel moves: see `mechanics.advance`."""

    masses: Array
    springs: Array
    scalars: Array


@compiled
def _advance(  # noqa: PLR0917
    constants: Any,  # noqa: ANN401
    wrap_rad: Array,
    masses: Array,
    springs: Array,
    scalars: Array,
    current_a: Array,
    operator: Array,
    intended_rad: float,
    torque_nm: Array,
    angle_rad: Array,
) -> None:
    for k in range(len(current_a)):
        constants[0]["operator_stiffness_nm"] = operator[k, 0]
        constants[0]["operator_damping_nm_s"] = operator[k, 1]
        mechanics.advance(
            constants, wrap_rad, masses, springs, scalars, current_a[k], True, intended_rad, 0.0
        )
        torque_nm[k] = scalars[at.LOAD_TORQUE]
        angle_rad[k] = scalars[at.LOAD_ANGLE]


class Released:
    """The plant at the release, and what happens to it with a motor torque.

    Parameters
    ----------
    rig, task
    by_law_nm : ndarray
        Motor torque of the law with the load cell in this trial, one a tick.
    """

    def __init__(self, rig: RenderRig, task: Task, by_law_nm: Array) -> None:
        host, _ = prepared(rig, law_named(OURS), task)
        bench, course = host.bus.bench, task.course(rig)
        self.first = round(RELEASE_S * TICKS_PER_S)
        on_the_rig(bench, course[: self.first], None)
        host.bus.shutdown()
        self.motor_nm, self.by_law_nm = float(by_law_nm[self.first - 1]), by_law_nm[self.first :]
        self.rig, self.task, plant = rig, task, bench.rig.plant
        self.start = State(plant.masses.copy(), plant.springs.copy(), plant.scalars.copy())
        self._constants, self._wrap_rad = plant.packed_constants.copy(), plant.wrap_rad.copy()
        self._intended_rad = float(course[self.first, 0])
        operator = rig.rig.operator
        blocks = np.arange(len(course)) // IMPOSED_TICKS * IMPOSED_TICKS + IMPOSED_TICKS - 1
        hold = np.append(course[np.minimum(blocks, len(course) - 1), 2], np.zeros(WINDOW_TICKS))
        self._operator = np.column_stack(
            [hold * operator.stiffness_nm_per_rad, hold * operator.damping_nm_s_per_rad]
        )

    def advance(self, state: State, tick: int, motor_nm: Array) -> tuple[State, Array, Array]:
        """Return the state after some ticks from `tick` on, the error and the load's angle."""
        after = State(*(x.copy() for x in state))
        torque_nm, angle_rad = np.empty(len(motor_nm)), np.empty(len(motor_nm))
        current_a = motor_nm / self.rig.rig.motor.torque_constant_nm_per_a
        operator = self._operator[tick : tick + len(motor_nm)]
        _advance(
            self._constants,
            self._wrap_rad,
            *after,
            current_a,
            operator,
            self._intended_rad,
            torque_nm,
            angle_rad,
        )
        return after, torque_nm - self.task.wanted_nm(self.rig, angle_rad), angle_rad


class Window:
    """The search of one window; `motor_nm` is the torque before it."""

    def __init__(self, plant: Released, state: State, tick: int, motor_nm: float) -> None:
        self.plant, self.state, self.tick, self.motor_nm = plant, state, tick, motor_nm
        self.limit_nm = plant.rig.motor_limit_nm
        self.most_nm = self.limit_nm / FULL_TORQUE_S * KNOT_TICKS / TICKS_PER_S  # from knot to knot

    def torque_nm(self, knots_nm: Array) -> Array:
        """Return the torque of each tick."""
        at_ticks = np.arange(KNOTS + 1) * KNOT_TICKS
        here = np.append(self.motor_nm, knots_nm)
        found: Array = np.interp(np.arange(1, WINDOW_TICKS + 1), at_ticks, here)
        return found

    def feasible(self, knots_nm: Array) -> Array:
        """Return the knots within the motor's limit and slew."""
        last, found = self.motor_nm, np.empty(KNOTS)
        for i, knot in enumerate(np.clip(knots_nm, -self.limit_nm, self.limit_nm).tolist()):
            last = found[i] = min(max(knot, last - self.most_nm), last + self.most_nm)
        return found

    def error_nm(self, knots_nm: Array) -> Array:
        """Return the error of each tick."""
        return self.plant.advance(self.state, self.tick, self.torque_nm(knots_nm))[1]

    def guesses(self, planned_nm: Array) -> list[Array]:
        """Return first guesses: as planned, by the law, and slides one way, or to and fro."""
        _, _, angle = self.plant.advance(self.state, self.tick, self.torque_nm(planned_nm))
        rig, task = self.plant.rig, self.plant.task
        plain_nm = task.wanted_nm(rig, angle) / rig.ratio
        sign = np.sign(np.gradient(angle))
        later = [
            sign[np.minimum(np.arange(WINDOW_TICKS) + lead, WINDOW_TICKS - 1)]
            for lead in LEADS_TICKS
        ]
        slides = [*later, np.ones(WINDOW_TICKS), -np.ones(WINDOW_TICKS)]
        at_ticks = slice(KNOT_TICKS - 1, None, KNOT_TICKS)
        found = [(plain_nm + rig.friction_nm * x)[at_ticks] for x in slides]
        by_law = self.plant.by_law_nm[self.tick - self.plant.first :][:WINDOW_TICKS]
        by_law = np.append(by_law, np.zeros(WINDOW_TICKS - len(by_law)))[at_ticks]
        return [self.feasible(x) for x in (planned_nm, by_law, *found)]

    def search(self, planned_nm: Array) -> Array:
        """Return the best knots."""
        tried = [(self.error_nm(x), x) for x in self.guesses(planned_nm)]
        error, knots = min(tried, key=lambda pair: float(pair[0] @ pair[0]))
        damping, fruitless = 1e-2, 0
        for k in range(STEPS):
            h = DIFFERENCE * self.limit_nm * (-1.0) ** k  # friction: either way may change nothing
            moved = [self.error_nm(knots + h * one) for one in np.eye(KNOTS)]
            slope = np.column_stack([(one - error) / h for one in moved])
            square, before = slope.T @ slope, float(error @ error)
            for _ in range(TRIALS):
                ridge = damping * np.trace(square) / KNOTS + 1e-9
                step = np.linalg.solve(square + ridge * np.eye(KNOTS), slope.T @ error)
                other = self.feasible(knots - step)
                found = self.error_nm(other)
                if found @ found < before:
                    error, knots, damping = found, other, max(damping / 5.0, 1e-4)
                    break
                damping *= 5.0
            fruitless = fruitless + 1 if before - error @ error <= LEAST_GAIN * before else 0
            if fruitless == 2:
                break
        return knots


def commanded_nm(trial: Trial) -> Array:
    """Return the motor torque that the drive has commanded in each tick."""
    return np.asarray(1e-6 * trial.drive["motor_torque_command_unm"], dtype=np.float64)


def reached_nm(rig: RenderRig) -> tuple[float, float]:
    """Return the RMS error that the law with the load cell has, and the least that was found.

    Where the search finds nothing better than the law's own motor torque, that is the least.
    """
    task = task_named("release", DISTURBED)
    trial = run(rig, law_named(OURS), task)
    scored_from = round(task.scored_from_s * TICKS_PER_S)
    law_nm = rms(trial.error_nm[scored_from:])
    plant = Released(rig, task, commanded_nm(trial))
    before = trial.error_nm[scored_from : plant.first]
    state, motor_nm, tick, parts = plant.start, plant.motor_nm, plant.first, [before]
    planned = np.full(KNOTS, motor_nm)
    while tick < task.ticks:
        window = Window(plant, state, tick, motor_nm)
        knots = window.search(planned)
        kept = window.torque_nm(knots)[: min(KEPT_KNOTS * KNOT_TICKS, task.ticks - tick)]
        state, error, _ = plant.advance(state, tick, kept)
        parts.append(error)
        motor_nm, tick = float(kept[-1]), tick + len(kept)
        planned = np.append(knots[KEPT_KNOTS:], np.full(KEPT_KNOTS, knots[-1]))
    return law_nm, min(law_nm, rms(np.concatenate(parts)))
