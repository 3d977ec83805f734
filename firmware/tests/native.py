"""The natively built firmware, loaded once: `ffi`, `lib`, and a drive to talk to.

Reads build/native (made by ``make -C firmware native``); the C declarations come from there too.
Tests import from here; nothing else does.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import cffi
import numpy as np
from numpy.typing import NDArray

REPOSITORY: Final = Path(__file__).resolve().parents[2]
BUILD: Final = REPOSITORY / "build" / "native"
NODE_ID: Final = 16
TICK_US: Final = 250
NMT_START, NMT_STOP, NMT_PRE_OPERATIONAL = 0x01, 0x02, 0x80

ffi: Final = cffi.FFI()
ffi.cdef((BUILD / "native.cdef").read_text(encoding="utf-8"))
lib: Final[Any] = ffi.dlopen(str(BUILD / "libbowden_native.so"))


class Frame(NamedTuple):
    """A CAN frame."""

    cob_id: int
    data: bytes


class Actuators(NamedTuple):
    """board_actuators_t."""

    motor_current_ua: int
    bridge_enabled: bool
    reset_requested: bool


class Drive:
    """One drive in its own memory, with a board whose sensors a test sets by name.

    No host and no rig: while current flows it is what was commanded, encoders stay where a test
    puts them. `guarded`: the drive's supervision is as it comes; else the checks that need a host
    or a rig are opened wide.
    """

    def __init__(
        self, node_id: int = NODE_ID, start_us: int = 0, guarded: bool = False, **board: Any
    ) -> None:
        self.raw = ffi.new("drive_t *")
        self.sensors = ffi.new("board_sensors_t *", {"bus_voltage_mv": 24000, "time_us": start_us})
        self._actuators = ffi.new("board_actuators_t *")
        self.node_id = node_id
        self.values = self.raw.dictionary
        self._sent: list[Frame] = []
        identity = {"node_id": node_id, "reset": lib.RESET_CAUSE_POWER_ON, **board}
        lib.drive_init(self.raw, ffi.new("board_identity_t *", identity))
        if not guarded:
            self.values.command_deadline_ms = 0
            self.values.stretch_tolerance_nm = 2**31 - 1
            self.values.motor_speed_limit_mrad_per_s = 2**31 - 1
            self.values.load_speed_limit_mrad_per_s = 2**31 - 1

    def send(self, cob_id: int, data: bytes) -> None:
        """Deliver a frame to the drive."""
        frame = ffi.new("can_frame_t *", {"cob_id": cob_id, "length": len(data)})
        ffi.memmove(frame.data, data, len(data))
        lib.drive_receive(self.raw, frame)

    def frames(self) -> list[Frame]:
        """Every frame that the drive has sent since the last call."""
        self._sent += self._pop()
        found, self._sent = self._sent, []
        return found

    def _pop(self) -> Iterator[Frame]:
        frame = ffi.new("can_frame_t *")
        while lib.drive_transmit(self.raw, frame):
            yield Frame(frame.cob_id, bytes(frame.data)[: frame.length])

    def tick(self, ticks: int = 1) -> Actuators:
        """Run control ticks; the last one's actuators. Time advances after each tick."""
        for _ in range(ticks):
            lib.drive_tick(self.raw, self.sensors, self._actuators)
            self.sensors.time_us = (self.sensors.time_us + TICK_US) & 0xFFFFFFFF
            if self._actuators.bridge_enabled:
                self.sensors.motor_current_ua = self._actuators.motor_current_ua
            self._sent += self._pop()
        found = self._actuators
        return Actuators(
            found.motor_current_ua, bool(found.bridge_enabled), bool(found.reset_requested)
        )

    def nmt(self, command: int) -> None:
        """Send an NMT command to this node."""
        self.send(0, bytes([command, self.node_id]))

    def write(self, index: int, sub: int, value: int, size: int) -> bytes:
        """Expedited SDO download; the answer's eight bytes."""
        command = 0x23 | (4 - size) << 2
        data = value.to_bytes(4, "little", signed=value < 0)[:size].ljust(4, b"\0")
        self.send(0x600 + self.node_id, struct.pack("<BHB", command, index, sub) + data)
        return next(f.data for f in self._pop() if f.cob_id == 0x580 + self.node_id)

    def write_segments(self, index: int, sub: int, data: bytes) -> Iterator[bytes]:
        """Segmented SDO download, a frame at a time; each answer's eight bytes, none before a tick.

        The last answer needs a tick where the drive, not the node, takes the value.
        """
        begin = struct.pack("<BHBI", 0x21, index, sub, len(data))
        yield self.ask(begin)
        for number, start in enumerate(range(0, len(data), 7)):
            part = data[start : start + 7]
            last = start + 7 >= len(data)
            command = (number % 2) << 4 | (7 - len(part)) << 1 | last
            yield self.ask(bytes([command]) + part.ljust(7, b"\0"))

    def ask(self, request: bytes) -> bytes:
        """Send an SDO frame; the answer, at the latest that of the next tick; empty: none."""
        self.frames()
        self.send(0x600 + self.node_id, request)
        answers = [f.data for f in self._pop() if f.cob_id == 0x580 + self.node_id]
        if not answers:
            self.tick()
            answers = [f.data for f in self.frames() if f.cob_id == 0x580 + self.node_id]
        return answers[0] if answers else b""

    def write_table(self, number: int, data: bytes) -> int:
        """Write table `number`, 1 .. 8; the abort code, or 0."""
        for answer in self.write_segments(0x2162, number, data):
            if answer[0] == 0x80:
                return int.from_bytes(answer[4:], "little")
        return 0

    def control(self, controlword: int, ticks: int = 1) -> Actuators:
        """Set the controlword and run ticks."""
        self.values.controlword = controlword
        return self.tick(ticks)

    def enable(self) -> Actuators:
        """NMT start and up to Operation enabled."""
        self.tick()
        self.nmt(NMT_START)
        for controlword in (0x06, 0x07, 0x0F):
            found = self.control(controlword)
        return found

    @property
    def state(self) -> int:
        """drive_state_t."""
        return int(self.raw.state)


class Trajectory(NamedTuple):
    """What native_run_* notes, one row a step, in SI units."""

    first: NDArray[np.float64]  # motor angle (torque-position) or motor torque
    load_torque_nm: NDArray[np.float64]
    motor_tension_a_n: NDArray[np.float64]
    load_tension_a_n: NDArray[np.float64]
    motor_tension_b_n: NDArray[np.float64]
    load_tension_b_n: NDArray[np.float64]
    flags: NDArray[np.int32]


def settings(
    segments: int = 20,
    *,
    mu_d: float = 0.21,
    mu_s: float | None = None,
    pretension_n: float = 10.0,
    axial_stiffness_n: float = 4000.0,
    length_m: float = 2.0,
    radius_m: float | list[float] = 0.28,
    stiction_length_m: float = 0.1,
    **dead_bands: int,
) -> Any:
    """transmission_settings_t of Table I; mu_s = mu_d unless given; dead bands in raw units."""
    radii = [radius_m] * segments if isinstance(radius_m, float) else radius_m
    found = ffi.new("transmission_settings_t *", dead_bands)
    found.motor_pulley_radius_nm = 20_000_000
    found.load_pulley_radius_nm = 104_000_000
    cable = found.cable
    cable.axial_stiffness_mn = round(axial_stiffness_n * 1e3)
    cable.pretension_un = round(pretension_n * 1e6)
    cable.segments = segments
    cable.friction_dynamic_ppm = round(mu_d * 1e6)
    cable.friction_static_ppm = round((mu_d if mu_s is None else mu_s) * 1e6)
    cable.stiction_length_um = round(stiction_length_m * 1e6)
    for i in range(segments):
        cable.segment_length_um[i] = round(length_m / segments * 1e6)
        cable.segment_curvature_per_1000km[i] = round(1e6 / radii[i])
    return found


class Pair:
    """A transmission on its own."""

    def __init__(self, found: Any) -> None:
        self.raw = ffi.new("transmission_t *")
        if not lib.transmission_configure(self.raw, found):
            raise ValueError("transmission_configure refused the settings")

    def run_torque(
        self, motor_torque_nm: NDArray[np.float64], load_angle_rad: NDArray[np.float64]
    ) -> Trajectory:
        """Torque-position mode over a trajectory."""
        return self._run(lib.native_run_torque, motor_torque_nm * 1e6, load_angle_rad * 0.104 * 1e9)

    def run_position(
        self, motor_angle_rad: NDArray[np.float64], load_angle_rad: NDArray[np.float64]
    ) -> Trajectory:
        """Position-position mode over a trajectory."""
        return self._run(
            lib.native_run_position, motor_angle_rad * 0.020 * 1e9, load_angle_rad * 0.104 * 1e9
        )

    def _run(
        self, function: Any, first: NDArray[np.float64], second: NDArray[np.float64]
    ) -> Trajectory:
        inputs = [np.ascontiguousarray(np.rint(series), np.int32) for series in (first, second)]
        results = np.zeros((len(first), 7), np.int32)
        function(
            self.raw,
            *(ffi.cast("int32_t *", series.ctypes.data) for series in inputs),
            ffi.cast("int32_t *", results.ctypes.data),
            len(results),
        )
        columns = [results[:, i] * 1e-6 for i in range(6)]
        return Trajectory(*columns, results[:, 6])
