"""One drive in one situation: brought there once, then run with each fault and without any.

The native drive and its rig are copied at the onset, so that every fault starts from the same bits.
Output: `Trace`, the truth at the load tick by tick, for `outcome`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from bowden.drive.command_guard import GUARD
from bowden.drive.dictionary import RPDOS
from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.native import NativeTarget
from bowden_rig.rig import state as at
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.target import Target, fitted
from bowden_rig.virtual_bus import VirtualBus
from numpy.typing import NDArray

from hil_tests.fault_campaign.broken import BrokenTarget
from hil_tests.fault_campaign.faults import Fault, Line
from hil_tests.fault_campaign.master import Master
from hil_tests.fault_campaign.situations import (
    QUICK_STOP,
    STOP,
    TORQUE_NM,
    Situation,
    raw_entries,
)
from hil_tests.lockstep_host import LockstepHost

HORIZON_S: Final = 0.6  # the command deadline of 0.5 s is within it
STEP_S: Final = 0.02  # of the controlwords
CONFIGURED_S: Final = 0.06  # a configuration is taken 50 ms after its last entry
DEAD_SUPPLY_MV: Final = 5000
RPDO_COMMUNICATION: Final = 0x1400
RPDO_MAPPING: Final = 0x1600
PDO_DOES_NOT_EXIST: Final = 1 << 31


@dataclass(frozen=True)
class Trace:
    """What happened from the onset on; arrays of shape (ticks,).

    `emergencies`: seconds after the onset, EMCY code.
    """

    load_torque_nm: NDArray[np.float64]
    load_speed_rad_per_s: NDArray[np.float64]
    bridge_on: NDArray[np.bool_]
    emergencies: tuple[tuple[float, int], ...]


def map_guard(host: LockstepHost[VirtualBus]) -> None:
    """Map the guard behind the other entries of RPDO 1, by the procedure of CiA 301."""
    cob_id = RPDOS[0].cob_id + host.node_id
    place = len(RPDOS[0].entries) + 1
    word = GUARD.index << 16 | GUARD.sub << 8 | GUARD.bits
    host.write(RPDO_COMMUNICATION, 1, cob_id | PDO_DOES_NOT_EXIST, 4)
    host.write(RPDO_MAPPING, 0, 0, 1)
    host.write(RPDO_MAPPING, place, word, 4)
    host.write(RPDO_MAPPING, 0, place, 1)
    host.write(RPDO_COMMUNICATION, 1, cob_id, 4)


class Approach:
    """A drive that has come into a situation.

    Parameters
    ----------
    where : Situation
    target : Target
        Without a fault.
    """

    def __init__(self, where: Situation, target: Target) -> None:
        self.where = where
        self.target = BrokenTarget(target)
        rig = fitted(where.rig, target.capabilities)
        self.bench = Bench(SimulatedRig(rig, seed=1), self.target)
        self.master = Master(guarded=where.guarded)
        self._configure()
        self._enter()

    def _configure(self) -> None:
        with VirtualBus(self.bench) as bus:
            host = LockstepHost(bus)
            host.await_boot()
            for index, sub, raw, size in raw_entries(self.where.entries()):
                host.write(index, sub, raw, size)
            host.listen(CONFIGURED_S)
            if self.where.guarded:
                map_guard(host)
            if self.where.operational:
                bus.send(self.master.nmt_start())

    def _enter(self) -> None:
        where, master = self.where, self.master
        master.mode, master.torque_nm = int(where.mode), TORQUE_NM
        for controlword in where.controlwords:
            master.controlword = controlword
            self._pass(STEP_S)
        if where.faulted:
            self.target.supply_mv = DEAD_SUPPLY_MV
            self._pass(STEP_S)
            self.target.supply_mv = None
        self._pass(where.onset_s - STEP_S * (len(where.controlwords) + int(where.faulted)))
        if self.target.decided.bridge_enabled != where.bridge_on:
            raise RuntimeError(f"{where.name}: the drive has not come there")

    def _pass(self, duration_s: float) -> None:
        for _ in range(round(duration_s * TICKS_PER_S)):
            self._tick()

    def _tick(self) -> None:
        self.bench.to_drive.extend(self.master.frames())
        self.bench.step()
        self.bench.from_drive.clear()

    def run(self, fault: Fault | None = None, stop: bool = False, cut: bool = False) -> Trace:
        """Let the horizon pass with the fault, with a host that stops, or with the bridge cut."""
        bench, scalars = self.bench, self.bench.rig.plant.scalars
        if stop:
            self.master.controlword = STOP
        elif self.where.stops:
            self.master.controlword = QUICK_STOP
        self.target.cut = cut
        if fault is not None:
            self.target.break_line(fault)
            if fault.line in (Line.COMMANDS, Line.TARGET, Line.HEARTBEAT):
                self.master.fault = fault
        told, start_s = len(bench.emergencies), bench.time_s
        ticks = round(HORIZON_S * TICKS_PER_S)
        torque, speed = np.empty(ticks), np.empty(ticks)
        on = np.empty(ticks, dtype=np.bool_)
        for tick in range(ticks):
            self._tick()
            torque[tick], speed[tick] = scalars[at.LOAD_TORQUE], scalars[at.LOAD_SPEED]
            on[tick] = bench.actuators.bridge_enabled
        emergencies = tuple(
            (m.timestamp - start_s, int.from_bytes(m.data[:2], "little"))
            for m in bench.emergencies[told:]
        )
        return Trace(torque, speed, on, emergencies)


class NativeFork:
    """An approach of the native drive, and its state at the onset to go back to."""

    def __init__(self, where: Situation) -> None:
        self._native = NativeTarget()
        self.approach = Approach(where, self._native)
        inside, rig = self._native.inside(), self.approach.bench.rig
        self._arrays: list[NDArray[Any]] = [
            *(inside.drive, inside.sensors, inside.actuators),
            *(rig.plant.masses, rig.plant.springs, rig.plant.scalars),
            *(rig.board.clocks, rig.board.lines, rig.board.noise, rig.board.sample),
        ]
        self._kept = [array.copy() for array in self._arrays]
        self._sensors = rig.sensors
        self._ticks = self.approach.bench.ticks
        self._actuators = self.approach.bench.actuators
        self._decided = self.approach.target.decided
        self._random = rig.board.random_state()
        self._master = self.approach.master

    def run(self, fault: Fault | None = None, stop: bool = False, cut: bool = False) -> Trace:
        """Go back to the onset and run from there."""
        for array, kept in zip(self._arrays, self._kept, strict=True):
            array[...] = kept
        approach = self.approach
        approach.bench.rig.board.set_random_state(self._random)
        approach.bench.rig.sensors = self._sensors
        approach.bench.ticks, approach.bench.actuators = self._ticks, self._actuators
        approach.bench.to_drive.clear()
        approach.target.break_line(None)
        approach.target.decided = self._decided
        approach.master = self._master.copy()
        return approach.run(fault, stop, cut)


Runner = Callable[[Fault | None, bool, bool], Trace]


def runner(where: Situation, make: Callable[[], Target]) -> Runner:
    """Return what runs a drive of `make` in that situation, each time from the same onset."""
    if make is NativeTarget:
        return NativeFork(where).run
    return lambda fault, stop, cut: Approach(where, make()).run(fault, stop, cut)
