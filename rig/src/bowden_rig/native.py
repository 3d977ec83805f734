"""The drive compiled for this machine: a shared library, from the wheel or from the repository.

In a checkout it is what `make native` builds in build/native; a wheel carries it as package data.
The C declarations come with it (native.cdef, preprocessed from the firmware's headers), so nothing
is declared twice. Each NativeTarget is a drive in its own memory: many can live at once.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, Final, NamedTuple

import can
import cffi
import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig.parameters import Motor, Rig, Sensing
from bowden_rig.rig.rig import Actuators
from bowden_rig.rig.sensors import Sensors
from bowden_rig.target import (
    DEFAULT_NODE_ID,
    MOTION,
    NODE_ID,
    SEVERAL,
    SIMULATED_RIG,
    VIRTUAL_TIME,
    Converters,
)

REPOSITORY: Final = Path(__file__).resolve().parents[3]
IN_REPOSITORY: Final = (REPOSITORY / "firmware" / "Makefile").is_file()
BUILD: Final = (
    REPOSITORY / "build" / "native" if IN_REPOSITORY else Path(__file__).parent / "firmware"
)
LIBRARY: Final = BUILD / "libbowden_native.so"
DECLARATIONS: Final = BUILD / "native.cdef"
STORE_WORDS: Final = 2045  # BOARD_STORE_WORDS
DRIVE_ALIGNMENT: Final = 16  # malloc's, which is any C type's


@functools.cache
def _library() -> tuple[cffi.FFI, Any]:
    """Load the library once; FileNotFoundError says how to build it."""
    if missing := NativeTarget.missing_firmware():
        raise FileNotFoundError(missing)
    ffi = cffi.FFI()
    ffi.cdef(DECLARATIONS.read_text(encoding="ascii"))
    return ffi, ffi.dlopen(str(LIBRARY))


class Inside(NamedTuple):
    """A drive's memory, as views on it, and the addresses of its entry points."""

    tick: int
    transmit: int
    drive: NDArray[np.uint8]
    sensors: NDArray[np.uint8]
    actuators: NDArray[np.uint8]
    frame: NDArray[np.uint8]


class Entry(NamedTuple):
    """Where an entry of the dictionary is in the drive's memory; bytes."""

    offset: int
    size: int
    signed: bool


def _pass_index(index: Any, before: int, now: int, counts_per_turn: int) -> None:  # noqa: ANN401
    """Note the index pulse that an encoder has passed in positive direction: a board_index_t."""
    turn = now // counts_per_turn
    index.passed = turn > before // counts_per_turn
    index.counts = turn * counts_per_turn


class NativeTarget:
    """A drive on this machine; a `Target`.

    Parameters
    ----------
    node_id : int
        1 .. 127.
    serial_number : int
        What the board reports in 0x1018 sub 4.
    current_max_a : float, A
        The most that its bridge drives.
    motor_counts_per_turn, load_counts_per_turn : int
        Of the encoders: an index pulse comes at each multiple.
    """

    name = "native"
    capabilities = frozenset({VIRTUAL_TIME, SIMULATED_RIG, SEVERAL, NODE_ID, MOTION})
    converters = Converters()

    @staticmethod
    def missing_firmware() -> str:
        """Return in one line what has to be built first; empty where nothing is missing."""
        for path in (LIBRARY, DECLARATIONS):
            if not path.is_file():
                return f"{path} is missing; run 'make native'"
        return ""

    @staticmethod
    def for_rig(node_id: int, rig: Rig) -> NativeTarget:
        """Build a drive with that node id, on a board that drives the rig's current."""
        return NativeTarget(
            node_id,
            current_max_a=rig.motor.current_limit_a,
            motor_counts_per_turn=rig.sensing.motor_counts_per_turn,
            load_counts_per_turn=rig.sensing.load_counts_per_turn,
        )

    def __init__(
        self,
        node_id: int = DEFAULT_NODE_ID,
        serial_number: int = 1,
        current_max_a: float = Motor.current_limit_a,
        motor_counts_per_turn: int = Sensing.motor_counts_per_turn,
        load_counts_per_turn: int = Sensing.load_counts_per_turn,
    ) -> None:
        self._ffi, self._lib = _library()
        new = self._ffi.new
        self._memory = new("char[]", int(self._lib.native_drive_size()) + DRIVE_ALIGNMENT)
        at = int(self._ffi.cast("uintptr_t", self._memory))
        self._drive = self._ffi.cast("drive_t *", at + -at % DRIVE_ALIGNMENT)
        self._saved: Any = new("uint32_t[]", STORE_WORDS)
        self._identity: Any = new(
            "board_identity_t *",
            {
                "node_id": node_id,
                "serial_number": serial_number,
                "current_max_ua": round(1e6 * current_max_a),
                "reset": self._lib.RESET_CAUSE_POWER_ON,
                "saved": self._saved,
            },
        )
        self._sensors: Any = new("board_sensors_t *")
        self._actuators: Any = new("board_actuators_t *")
        self._frame: Any = new("can_frame_t *")
        self._turns = motor_counts_per_turn, load_counts_per_turn
        self.reset()

    def reset(self) -> None:
        """Power the drive off and on."""
        self._lib.drive_init(self._drive, self._identity)

    def tick(self, sensors: Sensors) -> Actuators:
        """Run one control tick of 250 us on this sample."""
        raw = self._sensors
        motor_turn, load_turn = self._turns
        _pass_index(
            raw.motor_index, raw.motor_encoder_counts, sensors.motor_encoder_counts, motor_turn
        )
        _pass_index(raw.load_index, raw.load_encoder_counts, sensors.load_encoder_counts, load_turn)
        (
            raw.time_us,
            raw.motor_encoder_counts,
            raw.load_encoder_counts,
            raw.motor_current_ua,
            raw.load_cell_counts,
            raw.bus_voltage_mv,
            raw.conduit_temperature_mdegc,
            raw.faults,
        ) = sensors
        actuators = self._actuators
        self._lib.drive_tick(self._drive, raw, actuators)
        raw.motor_index.passed = raw.load_index.passed = False
        raw.store = self._lib.BOARD_STORE_IDLE
        if actuators.store:
            self._keep(actuators.store, actuators.store_words)
            raw.store = self._lib.BOARD_STORE_DONE
        return Actuators(
            actuators.motor_current_ua, actuators.bridge_enabled, actuators.reset_requested
        )

    def _keep(self, words: Any, count: int) -> None:  # noqa: ANN401
        """Keep the drive's image over `reset`; a chip takes a tick a word for it."""
        self._ffi.memmove(self._saved, words, 4 * count)
        self._identity.saved_words = count

    def send(self, message: can.Message) -> None:
        """Deliver a frame to the drive; what its acceptance filter refuses is ignored."""
        if message.is_extended_id or message.is_remote_frame or message.is_error_frame:
            return
        if message.is_fd or message.dlc > 8:
            return
        frame = self._frame
        frame.cob_id = message.arbitration_id
        frame.length = message.dlc
        self._ffi.memmove(frame.data, bytes(message.data).ljust(8, b"\0"), 8)
        self._lib.drive_receive(self._drive, frame)

    def receive(self) -> can.Message | None:
        """Next frame that the drive wants on the bus, or None."""
        frame = self._frame
        if not self._lib.drive_transmit(self._drive, frame):
            return None
        return can.Message(
            arbitration_id=frame.cob_id,
            is_extended_id=False,
            data=bytes(self._ffi.buffer(frame.data, frame.length)),
        )

    def inside(self) -> Inside:
        """Show this drive's memory and entry points, for `native_loop`."""
        ffi, lib = self._ffi, self._lib

        def view(pointer: Any, size: int) -> NDArray[np.uint8]:  # noqa: ANN401
            memory: Any = ffi.buffer(pointer, size)
            return np.frombuffer(memory, dtype=np.uint8)

        return Inside(
            tick=int(ffi.cast("uintptr_t", ffi.addressof(lib, "drive_tick"))),
            transmit=int(ffi.cast("uintptr_t", ffi.addressof(lib, "drive_transmit"))),
            drive=view(self._drive, int(lib.native_drive_size())),
            sensors=view(self._sensors, ffi.sizeof("board_sensors_t")),
            actuators=view(self._actuators, ffi.sizeof("board_actuators_t")),
            frame=view(self._frame, ffi.sizeof("can_frame_t")),
        )

    def entry(self, name: str) -> Entry:
        """Return where in the drive's memory an entry of the dictionary is.

        Parameters
        ----------
        name : str
            Of the field of dictionary_t, with its unit: ``"load_torque_unm"``. KeyError where there
            is none.
        """
        ffi = self._ffi
        fields = dict(ffi.typeof("dictionary_t").fields)
        kind = fields[name].type
        offset = ffi.offsetof("drive_t", "dictionary") + fields[name].offset
        return Entry(offset, ffi.sizeof(kind), int(ffi.cast(kind, -1)) < 0)

    def complaints(self) -> list[str]:
        """Nothing: this drive has no chip that could be misused."""
        return []
