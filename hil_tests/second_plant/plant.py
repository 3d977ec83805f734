"""The second plant in one piece: for a bench tick by tick, or with the native drive in one loop.

Input: `parameters.Rig`, and for each control period the actuators and a row of `conditions.Course`.
Output: the board's sample, and the truth in the places of the rig's vector of scalars, so that the
same measures judge both plants.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from bowden_rig.bench import Bench
from bowden_rig.native import Entry, NativeTarget
from bowden_rig.rig import state as rig_at
from bowden_rig.rig.parameters import Rig
from bowden_rig.rig.rig import Actuators
from bowden_rig.rig.sensors import Sensors
from numpy.typing import NDArray

from hil_tests.native_loop import HOST_SENDS, Record, call, entry_of
from hil_tests.second_plant import state as at
from hil_tests.second_plant.cables import step
from hil_tests.second_plant.compiled import compiled
from hil_tests.second_plant.numbers import NODES, SUBSTEPS, reduced, wrap_rad
from hil_tests.second_plant.sensing import Board, read

# Where the rig's measures look for what: (rig's place, here).
SAME: Final = (
    (rig_at.MOTOR_ANGLE, at.MOTOR_ANGLE),
    (rig_at.MOTOR_SPEED, at.MOTOR_SPEED),
    (rig_at.LOAD_ANGLE, at.LOAD_ANGLE),
    (rig_at.LOAD_SPEED, at.LOAD_SPEED),
    (rig_at.CURRENT, at.CURRENT),
    (rig_at.MOTOR_TORQUE, at.MOTOR_TORQUE),
    (rig_at.LOAD_TORQUE, at.LOAD_TORQUE),
    (rig_at.MOTOR_WORK, at.MOTOR_WORK),
    (rig_at.OPERATOR_WORK, at.OPERATOR_WORK),
)
_SAME: Final = np.array(SAME, dtype=np.int64)
_TENSIONS: Final = np.array(
    [rig_at.MOTOR_TENSION_A, rig_at.LOAD_TENSION_A, rig_at.MOTOR_TENSION_B, rig_at.LOAD_TENSION_B],
    dtype=np.int64,
)
STILL: Final = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 1.0])  # a row of a course: nothing happens


@compiled
def pass_period(  # noqa: PLR0917
    numbers: NDArray[np.void],
    wrap: NDArray[np.float64],
    cables: tuple[NDArray[np.float64], ...],
    s: NDArray[np.float64],
    current_a: float,
    bridge_on: bool,
    row: NDArray[np.float64],
) -> None:
    """Advance one control period. `row`: of a course; see `conditions`."""
    n: Any = numbers[0]
    nodes, tension, limit, guess, work, bent = cables
    target = min(max(current_a, -n.current_limit_a), n.current_limit_a)
    for i in range(len(wrap)):
        bent[i] = max(wrap[i] + row[4] / len(wrap), 0.0)
    current_sum, cell_sum = 0.0, 0.0
    for k in range(SUBSTEPS):
        s[at.CURRENT] += n.amplifier_share * (target - s[at.CURRENT])
        if not bridge_on:
            s[at.CURRENT] = 0.0
        motor_nm = n.torque_nm_per_a * s[at.CURRENT] + (n.torque_offset_nm if bridge_on else 0.0)
        wanted = (row[0] + (k + 1) * n.dt_s * row[1], row[1])
        step(
            n,
            bent,
            nodes,
            tension,
            limit,
            guess,
            work,
            s,
            motor_nm,
            wanted,
            row[2],
            row[3],
            n.pretension_n * row[5],
        )
        current_sum += s[at.CURRENT]
        cell_sum += s[at.CELL_TORQUE]
    s[at.CURRENT_MEAN] = current_sum / SUBSTEPS
    s[at.CELL_MEAN] = cell_sum / SUBSTEPS


@compiled
def _run(  # noqa: PLR0917
    numbers: NDArray[np.void],
    wrap: NDArray[np.float64],
    cables: tuple[NDArray[np.float64], ...],
    s: NDArray[np.float64],
    converters: NDArray[np.void],
    first_sample: int,
    noise: NDArray[np.float64],
    delays: NDArray[np.int64],
    lines: NDArray[np.int64],
    sample: NDArray[np.int32],
    calls: NDArray[np.uint64],  # as in native_loop
    sensors: NDArray[np.int32],
    current_ua: NDArray[np.int32],
    bridge: NDArray[np.uint8],
    drive: NDArray[np.uint8],
    course: NDArray[np.float64],
    commands: NDArray[np.int32],
    command: NDArray[np.int32],
    watched: NDArray[np.int64],
    same: NDArray[np.int64],
    tensions: NDArray[np.int64],
    rig_rows: NDArray[np.float64],
    drive_rows: NDArray[np.int64],
    enabled: NDArray[np.bool_],
) -> None:
    tension = cables[1]
    last = tension.shape[1] - 1
    for k in range(len(enabled)):
        for i in range(8):
            sensors[i] = sample[i]
        if len(commands) > 0:
            command[0] = commands[k]
        call(calls[0], calls[2], calls[3], calls[4])
        while call(calls[1], calls[2], calls[5], 0) & 1:
            pass
        enabled[k] = bridge[0] != 0
        pass_period(numbers, wrap, cables, s, 1e-6 * current_ua[0], enabled[k], course[k])
        read(converters, s, first_sample + k, noise[k], delays, lines, sample)
        for i in range(same.shape[0]):
            rig_rows[k, same[i, 0]] = s[same[i, 1]]
        for cable in range(2):
            rig_rows[k, tensions[2 * cable]] = tension[cable, 0]
            rig_rows[k, tensions[2 * cable + 1]] = tension[cable, last]
        for i in range(watched.shape[0]):
            drive_rows[k, i] = entry_of(drive, watched[i])


class ImplicitPlant:
    """Motor, cables, load, operator and board; virgin at uniform pretension, all at zero.

    Takes the place of `bowden_rig.rig.rig.SimulatedRig` in a `Bench`.

    Parameters
    ----------
    description : parameters.Rig
    seed : int
        Of the sensors' noise.
    """

    def __init__(self, description: Rig, seed: int = 0) -> None:
        numbers = reduced(description)
        kinds = [(name, "f8") for name in numbers._fields]
        self.numbers = np.array([tuple(numbers)], dtype=kinds)
        self.wrap = wrap_rad(description)
        self.cables = (
            np.zeros((3, 2, NODES)),
            np.full((2, NODES + 1), numbers.pretension_n),
            np.zeros((2, NODES)),
            np.zeros((2, NODES)),
            np.zeros((2, 4, NODES)),
            self.wrap.copy(),
        )
        self.scalars = np.zeros(at.SCALARS)
        self.board = Board(description.sensing, seed)
        self.samples = 0
        self._read(self.board.noise(1)[0])

    def _read(self, noise: NDArray[np.float64]) -> None:
        board = self.board
        read(
            board.converters,
            self.scalars,
            self.samples,
            noise,
            board.delays,
            board.lines,
            board.out,
        )
        self.samples += 1

    @property
    def sensors(self) -> Sensors:
        """The board's last sample."""
        return Sensors(*self.board.out.tolist())

    def step(self, actuators: Actuators, operator: tuple[float, float] | None = None) -> Sensors:
        """Advance one control period with the operator's usual hold; what the board reads."""
        row = STILL.copy()
        row[:2] = operator or (0.0, 0.0)
        current_a = 1e-6 * actuators.motor_current_ua
        on = actuators.bridge_enabled
        pass_period(self.numbers, self.wrap, self.cables, self.scalars, current_a, on, row)
        self._read(self.board.noise(1)[0])
        return self.sensors

    def run(
        self,
        bench: Bench,
        course: NDArray[np.float64],
        target_torque_nm: NDArray[np.float64] | None,
        watch: tuple[str, ...],
    ) -> Record:
        """Let a whole task pass with the bench's native drive; as `native_loop.run`.

        Parameters
        ----------
        bench : Bench
            On this plant, its drive configured and enabled.
        course : ndarray, shape (ticks, 6)
        target_torque_nm : ndarray, shape (ticks,), or None
        watch : tuple of str
        """
        target, board, ticks = bench.target, self.board, len(course)
        if not isinstance(target, NativeTarget):
            raise TypeError(f"target: found {target.name}; accepted: native")
        inside = target.inside()
        entries: list[Entry] = [target.entry(name) for name in watch]
        host = target.entry(HOST_SENDS)
        asked = np.empty(0, dtype=np.int32)
        if target_torque_nm is not None:
            asked = np.round(1e6 * target_torque_nm).astype(np.int32)
        memories = (inside.drive, inside.sensors, inside.actuators, inside.frame)
        record = Record(
            np.zeros((ticks, rig_at.SCALARS)),
            np.empty((ticks, len(watch)), dtype=np.int64),
            np.empty(ticks, dtype=np.bool_),
        )
        _run(
            self.numbers,
            self.wrap,
            self.cables,
            self.scalars,
            board.converters,
            self.samples,
            board.noise(ticks),
            board.delays,
            board.lines,
            board.out,
            np.array(
                [inside.tick, inside.transmit, *(x.ctypes.data for x in memories)], dtype=np.uint64
            ),
            inside.sensors.view(np.int32),
            inside.actuators[:4].view(np.int32),
            inside.actuators[4:5],
            inside.drive,
            course,
            asked,
            inside.drive[host.offset : host.offset + 4].view(np.int32),
            np.array(entries, dtype=np.int64).reshape(-1, 3),
            _SAME,
            _TENSIONS,
            record.rig,
            record.drive,
            record.bridge_enabled,
        )
        self.samples += ticks
        bench.ticks += ticks
        return record
