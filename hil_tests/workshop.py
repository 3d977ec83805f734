"""A rig on a workbench in virtual time: swapped wires, and an operator who follows instructions.

`Miswired` stands between board and firmware, as swapped wires, wrong decoders and wrong sensor
scales do; `Fitter` is the operator who does what `bowden commission` asks for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import cast

from bowden.commission.state import StepFinding
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Cable, Operator, Rig, Sensing
from bowden_rig.rig.rig import Actuators, SimulatedRig
from bowden_rig.rig.sensors import Sensors
from bowden_rig.target import Target
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

TICK_S = 250e-6


@dataclass
class Wiring:
    """Signs and scales by which the board's readings differ from the rig's."""

    motor_encoder: float = 1.0
    load_encoder: float = 1.0
    motor_leads: int = 1
    current_gain: float = 1.0
    cell_gain: float = 1.0
    cell_zero_counts: int = 0
    hung_nm: float | None = None  # on the cell, in place of the cables


class Miswired:
    """A target behind that wiring; everything else is the target's own."""

    def __init__(self, target: Target, wiring: Wiring, cell_nm_per_count: float) -> None:
        self._target, self._wiring, self._per_count = target, wiring, cell_nm_per_count

    def __getattr__(self, name: str) -> object:
        return getattr(self._target, name)

    def tick(self, sensors: Sensors) -> Actuators:
        """Run the target's tick on what the wiring makes of the sample."""
        w = self._wiring
        cell = sensors.load_cell_counts
        if w.hung_nm is not None:  # the noise of the cell stays: its last bits
            cell = round(w.hung_nm / self._per_count) + (sensors.time_us // 250) % 3 - 1
        read = sensors._replace(
            motor_encoder_counts=math.floor(w.motor_encoder * sensors.motor_encoder_counts),
            load_encoder_counts=math.floor(w.load_encoder * sensors.load_encoder_counts),
            motor_current_ua=round(w.motor_leads * w.current_gain * sensors.motor_current_ua),
            load_cell_counts=round(w.cell_gain * cell) + w.cell_zero_counts,
        )
        wanted = self._target.tick(read)
        current = round(w.motor_leads * wanted.motor_current_ua / w.current_gain)
        return wanted._replace(motor_current_ua=current)


class HeldBench(Bench):
    """A bench whose operator follows a given path: a sine that grows and decays smoothly."""

    amplitude_rad = 0.7
    period_s = 2.0
    swell_s = 0.5

    def __init__(self, rig: SimulatedRig, target: Target) -> None:
        super().__init__(rig, target)
        self.moving = False
        self._swell = 0.0
        self._angle = 0.0

    def step(self, told: tuple[float, float] | None = None) -> None:  # noqa: ARG002
        """Let a control period pass with the operator on the way."""
        step = TICK_S / self.swell_s
        self._swell = min(max(self._swell + (step if self.moving else -step), 0.0), 1.0)
        size = self._swell**2 * (3.0 - 2.0 * self._swell)
        sine = math.sin(2.0 * math.pi * self.time_s / self.period_s)
        angle = self.amplitude_rad * size * sine
        speed, self._angle = (angle - self._angle) / TICK_S, angle
        super().step((angle, speed))

    def tension_anew(self) -> None:
        """Bolt the load at zero, let the pretension off and set it again: virgin cables."""
        bolted = replace(self.rig.description, operator=Operator(motion="locked"))
        self.rig = SimulatedRig(bolted, 1, start_time_us=round(1e6 * self.time_s))


@dataclass
class Fitter:
    """Does what is asked, and keeps what was said."""

    bus: VirtualBus
    bench: HeldBench
    wiring: Wiring
    lever_m: float = 0.1
    asked: list[tuple[str, str, str]] = field(default_factory=list)
    mended: list[str] = field(default_factory=list)
    findings: dict[str, StepFinding] = field(default_factory=dict)

    def ask(self, title: str, moves: str, todo: str) -> None:
        """Do what the step asks for."""
        self.asked.append((title, moves, todo))
        self.bench.moving = False
        self.bus.advance(1.0)
        if "pretension" in todo:
            self.bench.tension_anew()
        if "to and fro" in todo or "back again" in todo:
            self._start_in_phase()
        if todo.startswith("take the cables off"):
            self.wiring.hung_nm = 0.0
        elif todo.startswith("hang"):
            self.wiring.hung_nm = 9.80665 * self.lever_m * float(todo.split()[1])
        else:
            self.wiring.hung_nm = None

    def _start_in_phase(self) -> None:
        """Begin with a positive half turn."""
        period = self.bench.period_s
        self.bus.advance(period - self.bench.time_s % period)
        self.bench.moving = True

    def mend(self, fault: str, todo: str) -> None:
        """Swap the wires."""
        self.mended.append(fault)
        if "load encoder" in todo:
            self.wiring.load_encoder *= -1.0
        elif "motor encoder" in todo:
            self.wiring.motor_encoder *= -1.0
        elif "leads" in todo:
            self.wiring.motor_leads *= -1

    def tell(self, finding: StepFinding) -> None:
        """Keep what was found."""
        self.findings[finding.what] = finding


def open_workshop(wiring: Wiring, cable: Cable) -> tuple[Drive, VirtualBus, Fitter]:
    """Make a drive on a rig with that wiring, and who stands at it."""
    rig = Rig(
        cable=cable,
        operator=Operator(motion="sine", stiffness_nm_per_rad=2000.0, damping_nm_s_per_rad=6.0),
        # Two parts in 10 000 of the cell's full scale, as a good cell and its amplifier have.
        sensing=Sensing(load_cell_noise_nm=5e-3),
    )
    target = Miswired(make_target("native"), wiring, rig.sensing.load_cell_nm_per_count)
    bench = HeldBench(SimulatedRig(rig), cast(Target, target))
    bus = VirtualBus(bench)
    connection = Connection(
        bus, adapter={"interface": "virtual"}, clock=lambda: bus.time_s, threaded=False
    )
    return Drive(connection), bus, Fitter(bus, bench, wiring)
