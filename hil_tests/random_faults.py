"""A random mix of faults, commands and power-downs on the native drive, with invariants every tick.

    python -m hil_tests.random_faults --minutes 60 --seed 1

Virtual time; the same seed makes the same run. What happens is drawn here, what must always hold is
`Invariants`; a breach ends the run with the tick, the rule and the last events. Exit status 1 then.
"""

from __future__ import annotations

import argparse
import sys
from collections import deque
from dataclasses import dataclass, field
from typing import Final

import can
import numpy as np
from bowden.drive.connection import HOST_NODE_ID
from bowden.drive.dictionary import TABLE
from bowden.drive.meanings import CompensationLaw, ModeOfOperation, Statusword
from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.native import NativeTarget
from bowden_rig.rig import state as at
from bowden_rig.rig.rig import Actuators, SimulatedRig
from bowden_rig.rig.sensors import Sensors
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.fault_campaign.broken import BrokenTarget
from hil_tests.fault_campaign.faults import FAULTS, Fault, Line
from hil_tests.fault_campaign.master import Master
from hil_tests.fault_campaign.situations import SITUATIONS, raw_entries
from hil_tests.lockstep_host import LockstepHost, SdoAbort

BOARD_FAULTS: Final = (1 << 0, 1 << 1, 1 << 3, 1 << 4, 1 << 7)  # board.h: each opens the bridge
MOST_ASKED_NM: Final = 2.5  # beyond any limit; three times that still fits the frame
HOST_LOST_TICKS: Final = round(0.3 * TICKS_PER_S)
DEAD_SUPPLY_MV: Final = 5000
NMT: Final = (0x01, 0x01, 0x01, 0x02, 0x80, 0x81)  # start most often
OPERATIONAL: Final = 0x01
CONTROLWORDS: Final = (0x06, 0x07, 0x0F, 0x0F, 0x0F, 0x02, 0x00, 0x80, 0x8F)
ENABLED: Final = 0x27
QUICK_STOP_ACTIVE: Final = 0x07
STATE_BITS: Final = 0x6F
STEPS_UP: Final = 8  # from Stopped and Fault to Operation enabled
EVENTS: Final = {
    "fault": 0.15,
    "mend": 0.20,
    "controlword": 0.08,
    "up": 0.30,
    "nmt": 0.05,
    "target": 0.08,
    "mode": 0.06,
    "board": 0.04,
    "supply": 0.04,
}
ENTRIES: Final = (
    *("statusword", "motor_torque_command_unm", "motor_torque_limit_unm"),
    *("motor_torque_slew_unm_per_s", "error_code"),
)


class BrokenInvariant(AssertionError):  # noqa: N818  (the invariant is the subject)
    """An invariant does not hold; the text says which, when, and what led there."""


class FaultyBoard(BrokenTarget):
    """A broken target that also reports faults of the board itself.

    Attributes
    ----------
    board_faults : int
        BOARD_FAULT_* bits to report.
    """

    def __init__(self, target: NativeTarget) -> None:
        super().__init__(target)
        self.board_faults = 0

    def tick(self, sensors: Sensors) -> Actuators:
        """Run one control tick."""
        return super().tick(sensors._replace(faults=sensors.faults | self.board_faults))


@dataclass
class Invariants:
    """What holds in every tick, whatever has happened; `check` raises what does not.

    Attributes
    ----------
    checked : int
        Ticks.
    enabled : int
        Of them with the bridge on.
    """

    target: NativeTarget
    checked: int = 0
    enabled: int = 0
    events: deque[str] = field(default_factory=lambda: deque(maxlen=12))
    _state: int = 0
    _command_unm: int = 0
    _on: bool = False
    _work_j: float = 0.0

    def __post_init__(self) -> None:
        self._memory = self.target.inside().drive
        self._places = {name: self.target.entry(name) for name in ENTRIES}

    def value(self, name: str) -> int:
        """Return a raw entry of the drive's memory."""
        place = self._places[name]
        data = self._memory[place.offset : place.offset + place.size].tobytes()
        return int.from_bytes(data, "little", signed=place.signed)

    def check(self, mix: Mix) -> None:
        """Check the tick that has just passed."""
        decided, status = mix.board.decided, self.value("statusword")
        state, command_unm = status & STATE_BITS, self.value("motor_torque_command_unm")
        on = decided.bridge_enabled
        limit_unm = self.value("motor_torque_limit_unm")
        self.checked += 1
        self.enabled += on
        if on:
            self._that(state in (ENABLED, QUICK_STOP_ACTIVE), "bridge on, state off", mix)
            self._that(not status & Statusword.FAULT, "bridge on in Fault", mix)
            self._that(mix.operational, "bridge on outside NMT operational", mix)
            self._that(mix.board.board_faults == 0, "bridge on with a fault of the board", mix)
            supplied = mix.board.seen.bus_voltage_mv > DEAD_SUPPLY_MV
            self._that(supplied, "bridge on without supply", mix)
            silent = mix.silent_ticks <= HOST_LOST_TICKS + 2 or not mix.watched
            self._that(silent, "bridge on without the host", mix)
            self._that(abs(command_unm) <= limit_unm, "torque beyond the limit", mix)
        else:
            self._that(decided.motor_current_ua == 0, "current with the bridge off", mix)
        if on and self._on and state == self._state == ENABLED:
            slew_unm = self.value("motor_torque_slew_unm_per_s") // TICKS_PER_S + 1
            change_unm = abs(command_unm - self._command_unm)
            self._that(change_unm <= slew_unm, f"slew: {change_unm} uN m in a tick", mix)
        if on and not self._on:
            self._that(mix.master.controlword & 0x0F == 0x0F, "went on uncommanded", mix)
        work_j = float(mix.bench.rig.plant.scalars[at.MOTOR_WORK])
        if not on and not self._on and not mix.bridge_broken:
            self._that(work_j <= self._work_j + 1e-9, "the motor works with the bridge off", mix)
        self._state, self._command_unm, self._on, self._work_j = state, command_unm, on, work_j

    def _that(self, holds: bool, rule: str, mix: Mix) -> None:
        if not holds:
            events = "\n  ".join(self.events)
            raise BrokenInvariant(f"{rule} at {mix.bench.time_s:.5f} s, after\n  {events}")


class Mix:
    """The run: draws an event every 20 to 400 ms.

    Parameters
    ----------
    seed : int
    """

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        native = NativeTarget()
        self.board = FaultyBoard(native)
        strokes = next(s for s in SITUATIONS if s.mode is ModeOfOperation.TUNNEL)
        self.bench = Bench(SimulatedRig(strokes.rig, seed), self.board)
        self.master = Master()
        self.master.mode = int(ModeOfOperation.TUNNEL)
        self.invariants = Invariants(native)
        self.operational = False
        self.watched = False
        self.silent_ticks = 0
        self.bridge_broken = False
        self._next = 0
        self._steps_up = 0
        self._configure(strokes.entries())

    def run(self, duration_s: float) -> None:
        """Advance virtual time; `BrokenInvariant` where one does not hold."""
        for _ in range(round(duration_s * TICKS_PER_S)):
            if self.bench.ticks >= self._next:
                self._next = self.bench.ticks + int(self._random.integers(80, 1600))
                self._happen()
            frames = self.master.frames()
            heard = any(f.arbitration_id == 0x700 + HOST_NODE_ID for f in frames)
            self.silent_ticks = 0 if heard else self.silent_ticks + 1
            self.bench.to_drive.extend(frames)
            self.bench.step()
            self.bench.from_drive.clear()
            self.invariants.check(self)

    def _configure(self, wanted: dict[str, float]) -> None:
        heartbeat = HOST_NODE_ID << 16 | 1000 * HOST_LOST_TICKS // TICKS_PER_S
        raw = [*raw_entries(wanted), (0x1016, 1, heartbeat, 4)]
        with VirtualBus(self.bench) as bus:
            host = LockstepHost(bus)
            for index, sub, value, size in raw:
                try:
                    host.write(index, sub, value, size)
                except (SdoAbort, TimeoutError):
                    self.invariants.events.append(f"{index:04X}h refused")
        self.silent_ticks = HOST_LOST_TICKS  # nothing was sent meanwhile
        self.watched = True

    def _happen(self) -> None:
        """Draw one event, or take the next step on the way up."""
        draw = self._random
        what = "up"
        if self._steps_up == 0:
            what = draw.choice(list(EVENTS), p=list(EVENTS.values()))
        text = str(getattr(self, f"_{what}")(draw) or "")
        self.invariants.events.append(f"{self.bench.time_s:.4f} s {what} {text}")

    def _fault(self, draw: np.random.Generator) -> str:
        fault: Fault = FAULTS[int(draw.integers(len(FAULTS)))]
        if fault.line in (Line.COMMANDS, Line.TARGET, Line.HEARTBEAT):
            self.master.fault = fault
        else:
            self.board.break_line(fault)
            self.bridge_broken = fault.line in (Line.BRIDGE_LINE, Line.MOTOR_LINE)
        return fault.name

    def _mend(self, _: np.random.Generator) -> None:
        self.board.break_line(None)
        self.master.fault = None
        self.board.board_faults, self.board.supply_mv = 0, None
        self.bridge_broken = False

    def _controlword(self, draw: np.random.Generator) -> str:
        self.master.controlword = int(draw.choice(CONTROLWORDS))
        return f"{self.master.controlword:02X}h"

    def _up(self, draw: np.random.Generator) -> str:
        """One step of the way to Operation enabled, fault reset first; 20 ms later the next."""
        status = self.invariants.value("statusword")
        if self._steps_up == 0:
            self._steps_up = STEPS_UP
        self._steps_up -= 1
        self._next = self.bench.ticks + 80
        if status & STATE_BITS == ENABLED:
            self._steps_up = 0
        if not self.operational:
            return self._nmt(draw, OPERATIONAL)
        if status & Statusword.FAULT:
            self.master.controlword = 0x00 if self.master.controlword & 0x80 else 0x80
        else:
            step = {0x40: 0x06, 0x21: 0x07, 0x23: 0x0F}
            self.master.controlword = step.get(status & STATE_BITS, 0x0F)
        return f"{self.master.controlword:02X}h"

    def _nmt(self, draw: np.random.Generator, command: int | None = None) -> str:
        command = int(draw.choice(NMT)) if command is None else command
        data = bytes([command, 0])  # to all nodes
        self.bench.to_drive.append(
            can.Message(arbitration_id=0x000, is_extended_id=False, data=data)
        )
        self.operational = command == OPERATIONAL
        if command == 0x81:  # a reset forgets what was configured
            self.watched = False
        return f"{command:02X}h"

    def _target(self, draw: np.random.Generator) -> str:
        self.master.torque_nm = float(draw.uniform(-MOST_ASKED_NM, MOST_ASKED_NM))
        return f"{self.master.torque_nm:.3f} N m"

    def _mode(self, draw: np.random.Generator) -> str:
        self.master.mode = int(draw.choice([int(mode) for mode in ModeOfOperation]))
        return str(self.master.mode)

    def _board(self, draw: np.random.Generator) -> str:
        self.board.board_faults = int(draw.choice(BOARD_FAULTS))
        return f"fault {self.board.board_faults:#x}"

    def _supply(self, _: np.random.Generator) -> str:
        self.board.supply_mv = DEAD_SUPPLY_MV
        return "gone"


def main(arguments: list[str] | None = None) -> int:
    """Run laws in turn, a minute each; show the progress on stderr."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.random_faults",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--minutes", type=float, default=60.0, metavar="T", help="virtual time")
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    options = parser.parse_args(arguments)
    left_s, part = 60.0 * options.minutes, 0
    while left_s > 0.0:
        try:
            mix = run_part(options.seed + part, min(left_s, 60.0))
        except BrokenInvariant as breach:
            sys.stderr.write(f"seed {options.seed + part}: {breach}\n")
            return 1
        seen = mix.invariants
        sys.stderr.write(
            f"seed {options.seed + part}: {seen.checked} ticks, bridge on in {seen.enabled}\n"
        )
        left_s, part = left_s - 60.0, part + 1
    return 0


def run_part(seed: int, duration_s: float) -> Mix:
    """Run one part; the law is that of the seed."""
    mix = Mix(seed)
    laws = tuple(CompensationLaw)
    entry = TABLE.lookup("compensation_law")
    with VirtualBus(mix.bench) as bus:
        LockstepHost(bus).write(entry.index, entry.sub, laws[seed % len(laws)], entry.bits // 8)
    mix.run(duration_s)
    return mix


if __name__ == "__main__":
    sys.exit(main())
