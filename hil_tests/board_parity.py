"""The same drive twice: compiled for this machine, and as the ELF on the emulated chip.

The ELF runs on the simulated rig. After each of its control ticks its sensors and the frames that
it took are read from its memory and given to the native build; then the actuators of that tick and
the frames that both have sent must be the same, bit for bit. What differs between a chip and a PC
(sampling, converter, bus times) stays outside: it is in the sensors.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import can
from bowden.drive.meanings import CompensationLaw, ModeOfOperation
from bowden_rig.native import NativeTarget
from bowden_rig.rig.parameters import Operator
from bowden_rig.rig.rig import Actuators
from bowden_rig.rig.sensors import Sensors

from hil_tests.board_bench import TARGET_TORQUE, TORQUE_MODE, Board

COMPENSATION_LAW: Final = 0x2130
SETTLE_S: Final = 0.06  # a configuration is taken 50 ms after its last entry
HOST_PERIOD_S: Final = 0.01  # of the commands

SENSORS: Final = struct.Struct("<IiiiiiiI")  # board_sensors_t, board.h
ACTUATORS: Final = struct.Struct("<i??")  # board_actuators_t
FRAME: Final = struct.Struct("<HB8sx")  # can_frame_t
RING_FRAMES: Final = 32  # can.c


@dataclass(frozen=True)
class Experiment:
    """What the operator does, the torque that the host commands (None: the tunnel), and the law."""

    name: str
    operator: Operator
    torque_nm: Callable[[float, float], float] | None
    law: CompensationLaw = CompensationLaw.NONE


def _locked_sine(time_s: float, load_angle_rad: float) -> float:
    """Motor torque of Experiment 1: a sine of 0.125 N m against the locked load."""
    del load_angle_rad
    return 0.125 * math.sin(math.pi * time_s)


def _follow(time_s: float, load_angle_rad: float) -> float:
    """Motor torque of Experiment 3: a position controller on the handle, at most 0.3 N m."""
    wanted = math.radians(40.0) * math.sin(math.pi * time_s)
    return max(-0.3, min(0.3, 1.5 * (wanted - load_angle_rad)))


EXPERIMENTS: Final = (
    Experiment("1, load locked", Operator(motion="locked"), _locked_sine),
    Experiment("2, passive transmission with the tunnel", Operator(motion="sine"), None),
    Experiment("3, position control of the handle", Operator(motion="free"), _follow),
    Experiment(
        "4, tunnel through model inversion",
        Operator(motion="sine"),
        None,
        CompensationLaw.MODEL_INVERSION,
    ),
)


@dataclass
class Comparison:
    """What has been compared so far.

    Attributes
    ----------
    ticks, frames : int
        Compared and equal.
    difference : str
        The first one; empty while there is none.
    digest : str
        SHA-256 over all actuators and frames, to compare runs.
    largest_torque_nm : float
        Largest measured motor torque, to show that something happened.
    """

    ticks: int = 0
    frames: int = 0
    difference: str = ""
    largest_torque_nm: float = 0.0
    _hash: hashlib._Hash = field(default_factory=hashlib.sha256)

    @property
    def digest(self) -> str:
        """Hash so far."""
        return self._hash.hexdigest()


class Shadow:
    """The native drive, fed with what the ELF has seen.

    Parameters
    ----------
    board : Board
        Just powered on.
    distort : callable
        What the native drive gets instead of the ELF's sensors, to see the comparison fail.
    """

    def __init__(self, board: Board, distort: Callable[[Sensors], Sensors]) -> None:
        chip = board.chip
        words = [chip.read_memory(0x1FFF7A10 + 4 * i, 4) for i in range(3)]
        serial = 0
        for word in words:
            serial ^= int.from_bytes(word, "little")
        self.native = NativeTarget(serial_number=serial)
        self.found = Comparison()
        self._chip = chip
        self._distort = distort
        self._last_time_us = 0
        self._taken = 0
        self._expected: deque[can.Message] = deque()
        symbols = chip.image.symbols
        self._at = {name: symbols[name].address for name in ("sensors", "actuators", "running")}
        self._ring = symbols["ring"].address

    def follow(self) -> None:
        """Compare the tick that has come since the last call, if one has."""
        while self._chip.read_memory(self._at["running"], 1) != b"\0":
            self._chip.run_until(self._chip.time_us + 10.0)
        sensors = Sensors(*SENSORS.unpack(self._chip.read_memory(self._at["sensors"], 32)))
        if sensors.time_us == self._last_time_us or self.found.difference:
            return
        self._last_time_us = sensors.time_us
        self._hand_over_frames()
        actuators = self.native.tick(self._distort(sensors))
        raw = self._chip.read_memory(self._at["actuators"], ACTUATORS.size)
        elf = Actuators(*ACTUATORS.unpack(raw))
        if elf != actuators:
            self._differs(f"actuators: ELF {elf}, native {actuators}")
        self.found.ticks += 1
        self.found._hash.update(raw)
        while (message := self.native.receive()) is not None:
            self._expected.append(message)

    def heard(self, message: can.Message) -> None:
        """Compare a frame that the ELF has put on the bus."""
        expected = self._expected.popleft() if self._expected else None
        key = (message.arbitration_id, bytes(message.data))
        if expected is None or key != (expected.arbitration_id, bytes(expected.data)):
            self._differs(f"frame: ELF {message}, native {expected}")
        self.found.frames += 1
        self.found._hash.update(struct.pack("<H", key[0]) + key[1])

    @property
    def waiting(self) -> int:
        """Frames that the native drive has sent and the ELF not yet."""
        return len(self._expected)

    def _hand_over_frames(self) -> None:
        taken = self._chip.word("ring", 3 * RING_FRAMES + 1)
        while self._taken != taken:
            at = self._ring + FRAME.size * (self._taken % RING_FRAMES)
            cob_id, length, data = FRAME.unpack(self._chip.read_memory(at, FRAME.size))
            self.native.send(
                can.Message(arbitration_id=cob_id, is_extended_id=False, data=data[:length])
            )
            self._taken = (self._taken + 1) & 0xFFFFFFFF

    def _differs(self, text: str) -> None:
        if not self.found.difference:
            self.found.difference = f"at {self._chip.time_us * 1e-6:.6f} s: {text}"


def undistorted(sensors: Sensors) -> Sensors:
    """Return the sensors as they are."""
    return sensors


def compare(
    experiment: Experiment,
    duration_s: float,
    distort: Callable[[Sensors], Sensors] = undistorted,
    babbler: can.Message | None = None,
) -> Comparison:
    """Run an experiment on both and compare, from power-on.

    Parameters
    ----------
    experiment : Experiment
    duration_s : float
        Of the experiment itself, after boot and enabling.
    distort : callable
        See `Shadow`.
    babbler : can.Message
        Sent by another node without a pause, so that frames pile up in the mailboxes.
    """
    board = Board(operator=experiment.operator)
    shadow = Shadow(board, distort)
    _watch(board, shadow)
    board.run(0.05)
    if experiment.law:
        board.host.write(COMPENSATION_LAW, 0, experiment.law, 1)
        board.run(SETTLE_S)
    board.chip.set_babbling(babbler)
    board.host.enable(ModeOfOperation.TUNNEL if experiment.torque_nm is None else TORQUE_MODE)
    for i in range(round(duration_s / HOST_PERIOD_S)):
        if experiment.torque_nm is not None:
            angle = board.bench.rig.sensors.load_encoder_counts * 2 * math.pi / 10_000
            torque = experiment.torque_nm(i * HOST_PERIOD_S, angle)
            board.host.write(TARGET_TORQUE, 0, round(1e6 * torque), 3)
        board.run(HOST_PERIOD_S)
        board.host.frames.clear()
        if shadow.found.difference:
            break
    board.host.disable()
    board.run(0.01)
    shadow.found.largest_torque_nm = float(abs(board.bench.truth().motor_torque_nm).max())
    if shadow.waiting > 3 and not shadow.found.difference:  # the mailboxes hold three
        shadow.found.difference = f"the ELF has not sent {shadow.waiting} frames"
    return shadow.found


def _watch(board: Board, shadow: Shadow) -> None:
    """Let the shadow see every tick and every frame of the board's target."""
    target = board.target
    tick, receive = target.tick, target.receive

    def watched_tick(sensors: Sensors) -> Actuators:
        actuators = tick(sensors)
        shadow.follow()
        return actuators

    def watched_receive() -> can.Message | None:
        message = receive()
        if message is not None:
            shadow.heard(message)
        return message

    target.tick = watched_tick  # type: ignore[method-assign]
    target.receive = watched_receive  # type: ignore[method-assign]
