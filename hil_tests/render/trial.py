"""One task on one rig with one law: configured over the bus, run, measured.

Input: `rigs`, `laws`, `tasks`. Output: `Trial` with its series for plots and `Outcome` with its
figures for `table`. On the native target whole tasks run compiled; on the emulated one each tick
goes through Python. The plant is the simulated rig, or the second one of the same description.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, Literal

import numpy as np
from bowden.drive.dictionary import TABLE
from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.rig import state as at
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.target import Target, fitted
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus
from numpy.typing import NDArray

from hil_tests import native_loop
from hil_tests.lockstep_host import LockstepHost
from hil_tests.native_loop import Record
from hil_tests.render import measures
from hil_tests.render.course import imposer
from hil_tests.render.laws import Law, entries
from hil_tests.render.rigs import RenderRig
from hil_tests.render.tasks import Task
from hil_tests.second_plant.plant import ImplicitPlant

Plant = Literal["rig", "implicit"]
PLANTS: Final[tuple[Plant, ...]] = ("rig", "implicit")
TARGET_TORQUE: Final = 0x2040
SETTLE_S: Final = 0.06  # the drive takes a configuration 50 ms after its last entry
LEAST_BAND_NM: Final = 0.02  # a swing at the load below this is not felt
HUNTING_COUNTS: Final = 3.0  # of the motor's encoder, back and forth
MOTOR_COUNTS_PER_TURN: Final = 2000
TURN_BAND_RAD: Final = 2e-3  # a load that comes back by less has not turned around: 3 counts
IMPOSED_TICKS: Final = 20  # conditions of a course change in steps of 5 ms on the simulated rig
RELAXED_S: Final = 0.15  # after a release, when what the cables had stored has gone
TENSIONS: Final = (
    at.MOTOR_TENSION_A,
    at.LOAD_TENSION_A,
    at.MOTOR_TENSION_B,
    at.LOAD_TENSION_B,
)
WATCHED: Final = (
    "motor_torque_command_unm",
    "estimated_load_torque_unm",
    "estimate_confidence",
    "slip_state",
    "compensation_active_law",
    "compensation_flags",
    "motor_innovation_nm",
    "motor_angle_urad",
    "load_angle_urad",
    "motor_torque_unm",
)
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """Series of one trial, one row a tick.

    Parameters
    ----------
    rig : ndarray, shape (ticks, state.SCALARS)
    drive : mapping of str to ndarray
        Entries of the dictionary, raw; empty on the emulated target.
    wanted_nm : ndarray
        At the load.
    bridge_off : bool
        The drive stopped in mid-task.
    """

    render_rig: RenderRig
    law: Law
    task: Task
    rig: Array
    drive: dict[str, NDArray[np.int64]]
    wanted_nm: Array
    bridge_off: bool

    @property
    def time_s(self) -> Array:
        """Time since the task began."""
        return self.task.time_s()

    @property
    def error_nm(self) -> Array:
        """Torque by the cables on the load, less what was wanted."""
        error: Array = self.rig[:, at.LOAD_TORQUE] - self.wanted_nm
        return error


@dataclass(frozen=True)
class Outcome:
    """Figures of one trial; nan where the task does not show it.

    `net_energy` is of what is exchanged on a closed path; `net_energy_to_friction` of what at least
    the friction of the pair would take on it. `turn_energy` is of every path from one turn of the
    load to the next but one, over at least what the friction would take; `redriven` is what a
    handle that was let go has gained from one turn to a later one, over what it had.
    """

    seed: int
    apart: bool
    law: str
    task: str
    rms_nm: float
    peak_nm: float
    felt_friction_nm: float
    stiffness: float
    limit_cycle: bool
    net_energy: float
    net_energy_to_friction: float
    slack: float
    bridge_off: bool
    fallback: float
    turn_energy: float = 0.0
    redriven: float = float("nan")


def run(  # noqa: PLR0917  (the last three are for benches)
    rig: RenderRig,
    law: Law,
    task: Task,
    target: Target | None = None,
    begins: Callable[[], None] | None = None,
    plant: Plant = "rig",
) -> Trial:
    """Do the task.

    Parameters
    ----------
    rig, law, task
    target : Target, optional
        A fresh one; without it the native drive.
    begins : callable, optional
        Called when the drive is configured and enabled.
    plant : str
        One of `PLANTS`; the implicit one with a native drive only.
    """
    host, second = prepared(rig, law, task, target, plant)
    bench = host.bus.bench
    if begins is not None:
        begins()
    if second is not None or bench.target.name == "native":
        course, asked = task.course(rig), task.target_nm(rig)
        if second is not None:
            record = second.run(bench, course, asked, WATCHED)
        else:
            record = on_the_rig(bench, course, asked)
        rows, enabled = record.rig, bool(record.bridge_enabled.all())
        drive = {name: record.drive[:, i] for i, name in enumerate(WATCHED)}
    else:
        rows, enabled = _tick_by_tick(host, rig, task)
        drive = {}
    host.bus.shutdown()
    wanted = task.wanted_nm(rig, rows[:, at.LOAD_ANGLE])
    return Trial(rig, law, task, rows, drive, wanted, not enabled)


def prepared(
    rig: RenderRig, law: Law, task: Task, target: Target | None = None, plant: Plant = "rig"
) -> tuple[LockstepHost[VirtualBus], ImplicitPlant | None]:
    """Configure and enable a drive on a fresh rig; the host, and the second plant if it is that.

    Parameters as of `run`.
    """
    target = target or make_target("native", rig=rig.rig)
    second = ImplicitPlant(rig.rig, rig.seed) if plant == "implicit" else None
    # the second plant is no SimulatedRig; a bench asks it for no more than sensors and a step
    body: Any = second or SimulatedRig(fitted(rig.rig, target.capabilities), rig.seed)
    bench = Bench(body, target)
    host = LockstepHost(VirtualBus(bench))
    host.await_boot()
    for name, value in entries(rig, law, task).items():
        entry = TABLE.lookup(name)
        host.write(entry.index, entry.sub, entry.to_raw(value), entry.bits // 8)
    host.listen(SETTLE_S)
    host.enable(task.mode)
    return host, second


def on_the_rig(bench: Bench, course: Array, asked: Array | None) -> Record:
    """Run in pieces between which the conditions of the course change."""
    impose = imposer(bench.rig)
    ticks = np.arange(1, len(course))
    changes = np.any(np.diff(course[:, 2:], axis=0) != 0.0, axis=1)
    blocks = np.unique(ticks[changes] // IMPOSED_TICKS * IMPOSED_TICKS)
    edges = [0, *blocks[blocks > 0].tolist(), len(course)]
    parts = []
    for start, stop in pairwise(edges):
        impose(course[min(start + IMPOSED_TICKS, stop) - 1])
        some = slice(start, stop)
        told = None if asked is None else asked[some]
        parts.append(native_loop.run(bench, stop - start, course[some, :2].copy(), told, WATCHED))
    rig, drive, enabled = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Record(rig, drive, enabled)


def _tick_by_tick(host: LockstepHost[VirtualBus], rig: RenderRig, task: Task) -> tuple[Array, bool]:
    bench = host.bus.bench
    rows = np.empty((task.ticks, at.SCALARS))
    target, last, enabled = task.target_nm(rig), 0.0, True
    impose = imposer(bench.rig)
    for k, row in enumerate(task.course(rig)):
        impose(row)
        if target is not None and target[k] != last:
            last = float(target[k])
            host.write(TARGET_TORQUE, 0, round(1e6 * last), 3)
        bench.step((float(row[0]), float(row[1])))
        bench.from_drive.clear()
        rows[k] = bench.rig.plant.scalars
        enabled &= bench.actuators.bridge_enabled
    return rows, enabled


def judge(trial: Trial) -> Outcome:
    """Measure a trial from `scored_from_s` on."""
    task, rig = trial.task, trial.render_rig
    scored = slice(round(task.scored_from_s * TICKS_PER_S), None)
    rows, wanted, error = trial.rig[scored], trial.wanted_nm[scored], trial.error_nm[scored]
    torque, angle = rows[:, at.LOAD_TORQUE], rows[:, at.LOAD_ANGLE]
    nan = float("nan")
    felt = stiffness = nan
    if task.kind == "free":
        felt = measures.felt_friction_nm(torque, angle)
    if task.kind == "strokes":
        reach = np.abs(angle) - rig.tunnel.half_width_rad
        slope = (reach > 0.0) & (rig.tunnel.stiffness_nm_per_rad * reach < rig.tunnel.limit_nm)
        stiffness = measures.rendered_stiffness(angle[slope], torque[slope], wanted[slope])
    cycles = False
    if task.kind == "rest":
        band = max(LEAST_BAND_NM, 0.05 * rig.ratio * rig.friction_nm)
        cycles = measures.limit_cycle(torque, band) or measures.limit_cycle(
            rows[:, at.MOTOR_ANGLE], HUNTING_COUNTS * 2.0 * math.pi / MOTOR_COUNTS_PER_TURN
        )
    friction_nm = rig.ratio * rig.friction_nm
    # while the wanted torque steps it does work of its own: no path is closed
    turn_energy = 0.0
    if task.kind != "steps":
        turn_energy = measures.turn_energy(torque, wanted, angle, TURN_BAND_RAD, friction_nm)
    redriven = nan
    if task.free_from_s < task.duration_s:
        released = round(task.free_from_s * TICKS_PER_S)
        free = slice(released + round(RELAXED_S * TICKS_PER_S), None)
        redriven = measures.redriven(
            trial.error_nm[free],
            trial.rig[free, at.LOAD_ANGLE],
            TURN_BAND_RAD,
            _mechanical_j(trial, trial.rig[released]),
        )
    energy = to_friction = nan
    if task.period_s > 0.0:
        period = round(task.period_s * TICKS_PER_S)
        to_friction = measures.net_energy(torque, wanted, angle, period, friction_nm)
        energy = to_friction  # in free strokes nothing is to be exchanged
        if task.kind != "free":
            energy = measures.net_energy(torque, wanted, angle, period)
    fallback = nan
    if trial.drive:
        fallback = float(np.mean(trial.drive["compensation_active_law"] != trial.law.number))
    return Outcome(
        seed=rig.seed,
        apart=rig.apart,
        law=trial.law.name,
        task=task.name,
        rms_nm=measures.rms(error),
        peak_nm=float(np.max(np.abs(error))),
        felt_friction_nm=felt,
        stiffness=stiffness,
        limit_cycle=cycles,
        net_energy=energy,
        net_energy_to_friction=to_friction,
        slack=measures.slack_share(rows[:, list(TENSIONS)]),
        bridge_off=trial.bridge_off,
        fallback=fallback,
        turn_energy=turn_energy,
        redriven=redriven,
    )


def _mechanical_j(trial: Trial, row: Array) -> float:
    """Return the energy of a handle in the wanted tunnel: of its motion, and in the wall."""
    rig = trial.render_rig
    tunnel = trial.task.tunnel(rig)
    beyond = max(abs(float(row[at.LOAD_ANGLE])) - tunnel.half_width_rad, 0.0)
    on_slope = min(beyond, tunnel.limit_nm / tunnel.stiffness_nm_per_rad)
    stored = 0.5 * tunnel.stiffness_nm_per_rad * on_slope**2 + tunnel.limit_nm * (beyond - on_slope)
    moving = 0.5 * rig.rig.load.inertia_kg_m2 * float(row[at.LOAD_SPEED]) ** 2
    return moving + rig.ratio * stored
