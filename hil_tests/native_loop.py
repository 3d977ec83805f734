"""Rig and natively built drive in one compiled loop: no Python, no interpreter lock in a tick.

For benches that need thousands of seconds of virtual time. The drive is started, configured and
enabled through its bus as ever (`bench`); then `run` lets many ticks pass at once, and afterwards
bench and bus go on from there. Frames that the drive sends meanwhile are thrown away. A tick does
what `Bench.step` does, bit for bit (test_native_loop).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from bowden_rig.bench import Bench
from bowden_rig.native import Entry, NativeTarget
from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled
from bowden_rig.rig.rig import Actuators, Parts, pass_period
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

HOST_SENDS: Final = "target_torque_unm"


class Record(NamedTuple):
    """What happened, one row a tick.

    Parameters
    ----------
    rig : ndarray, shape (ticks, state.SCALARS)
        The rig's scalars after the tick.
    drive : ndarray of int64, shape (ticks, entries)
        The watched entries of the dictionary after the tick.
    bridge_enabled : ndarray of bool, shape (ticks,)
    """

    rig: NDArray[np.float64]
    drive: NDArray[np.int64]
    bridge_enabled: NDArray[np.bool_]


def _generate_call(_context: Any, _address: Any, _a: Any, _b: Any, _c: Any) -> Any:  # noqa: ANN401
    """Call the C function at an address with three pointers; its result's lowest byte."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        byte, pointer = ir.IntType(8), cgutils.voidptr_t
        kind = ir.FunctionType(byte, [pointer, pointer, pointer])
        function = builder.inttoptr(arguments[0], ir.PointerType(kind))
        given = [builder.inttoptr(x, pointer) for x in arguments[1:]]
        return builder.call(function, given)

    return types.uint8(types.uintp, types.uintp, types.uintp, types.uintp), generate


call: Any = intrinsic(_generate_call)


@compiled
def entry_of(memory: NDArray[np.uint8], where: NDArray[np.int64]) -> int:
    """Read a little-endian number: (offset, size, signed)."""
    value: Any = 0
    for i in range(where[1]):
        value |= np.int64(memory[where[0] + i]) << (8 * i)
    if where[2] and value >> (8 * where[1] - 1):
        value -= 1 << (8 * where[1])
    return int(value)


@compiled
def _run(  # noqa: PLR0917
    parts: Parts,
    calls: NDArray[np.uint64],  # tick, transmit, drive, sensors, actuators, frame
    sensors: NDArray[np.int32],
    current_ua: NDArray[np.int32],
    bridge_on: NDArray[np.uint8],
    drive: NDArray[np.uint8],
    given: bool,
    operator: NDArray[np.float64],
    commands: NDArray[np.int32],
    command: NDArray[np.int32],
    watched: NDArray[np.int64],
    rig_rows: NDArray[np.float64],
    drive_rows: NDArray[np.int64],
    enabled: NDArray[np.bool_],
) -> None:
    for k in range(len(enabled)):
        for i in range(8):
            sensors[i] = parts.sample[i]
        if len(commands) > 0:
            command[0] = commands[k]
        call(calls[0], calls[2], calls[3], calls[4])
        while call(calls[1], calls[2], calls[5], 0) & 1:
            pass
        bridge = bridge_on[0] != 0
        angle = operator[k, 0] if given else 0.0
        speed = operator[k, 1] if given else 0.0
        pass_period(parts, current_ua[0], bridge, given, angle, speed)
        enabled[k] = bridge
        for i in range(rig_rows.shape[1]):
            rig_rows[k, i] = parts.scalars[i]
        for i in range(watched.shape[0]):
            drive_rows[k, i] = entry_of(drive, watched[i])


def run(
    bench: Bench,
    ticks: int,
    operator: NDArray[np.float64] | None = None,
    target_torque_nm: NDArray[np.float64] | None = None,
    watch: Sequence[str] = (),
) -> Record:
    """Advance many control periods.

    Parameters
    ----------
    bench : Bench
        With the native target.
    ticks : int
        Of 250 us.
    operator : ndarray, shape (ticks, 2), optional
        Intended angle (rad) and speed (rad/s); else those of the rig's `Operator`.
    target_torque_nm : ndarray, shape (ticks,), optional
        What the host writes into the drive's target torque before each tick.
    watch : sequence of str
        Fields of dictionary_t to record.
    """
    target, rig = bench.target, bench.rig
    if not isinstance(target, NativeTarget):
        raise TypeError(f"target: found {target.name}; accepted: native")
    inside = target.inside()
    entries: list[Entry] = [target.entry(name) for name in watch]
    watched = np.array(entries, dtype=np.int64).reshape(-1, 3)
    record = Record(
        np.empty((ticks, at.SCALARS)),
        np.empty((ticks, len(watch)), dtype=np.int64),
        np.empty(ticks, dtype=np.bool_),
    )
    host = target.entry(HOST_SENDS)
    command = inside.drive[host.offset : host.offset + 4].view(np.int32)
    asked = np.empty(0, dtype=np.int32)
    if target_torque_nm is not None:
        asked = np.round(1e6 * target_torque_nm).astype(np.int32)
    memories = (inside.drive, inside.sensors, inside.actuators, inside.frame)
    calls = np.array(
        [inside.tick, inside.transmit, *(x.ctypes.data for x in memories)], dtype=np.uint64
    )
    current_ua, bridge_on = inside.actuators[:4].view(np.int32), inside.actuators[4:5]
    done = 0
    while done < ticks:
        some = slice(done, min(done + rig.board.stock_up(), ticks))
        _run(
            rig.parts,
            calls,
            inside.sensors.view(np.int32),
            current_ua,
            bridge_on,
            inside.drive,
            operator is not None,
            np.zeros((0, 2)) if operator is None else operator[some],
            asked[some],
            command,
            watched,
            record.rig[some],
            record.drive[some],
            record.bridge_enabled[some],
        )
        done = some.stop
    bench.ticks += ticks
    rig.sensors = rig.board.last()
    bench.actuators = Actuators(int(current_ua[0]), bool(bridge_on[0]))
    return record
