"""The bench: the simulated rig and a target in lock-step, in virtual time.

Each `step` is one control period: the drive reads the sensors, ticks, and its actuators move the
rig. Frames for the drive wait in `to_drive`, frames from it in `from_drive`; `virtual_bus` or
`process` carry them on. The same rig, target and frames give the same bits.
"""

from __future__ import annotations

from collections import deque
from copy import copy
from dataclasses import dataclass
from typing import Final

import can
import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import state as at
from bowden_rig.rig.rig import CONTROL_PERIOD_US, Actuators, SimulatedRig
from bowden_rig.target import Target

TICKS_PER_S: Final = 1_000_000 // CONTROL_PERIOD_US
EMCY: Final = 0x80
FRAMES_KEPT: Final = 100_000  # half a minute of process data


@dataclass(frozen=True)
class Truth:
    """The true state, one row a tick, without sensors: arrays of shape (ticks,), SI units.

    `load_torque_nm` is by the cables on the load. `motor_work_j` and `operator_work_j` are what
    motor and operator have put into the rig since the start.
    """

    time_s: NDArray[np.float64]
    motor_angle_rad: NDArray[np.float64]
    load_angle_rad: NDArray[np.float64]
    motor_torque_nm: NDArray[np.float64]
    load_torque_nm: NDArray[np.float64]
    motor_tension_a_n: NDArray[np.float64]
    load_tension_a_n: NDArray[np.float64]
    motor_tension_b_n: NDArray[np.float64]
    load_tension_b_n: NDArray[np.float64]
    motor_work_j: NDArray[np.float64]
    operator_work_j: NDArray[np.float64]
    bridge_enabled: NDArray[np.bool_]


class Bench:
    """Rig and drive in lock-step.

    Parameters
    ----------
    rig : SimulatedRig
    target : Target
        Reset when the bench starts.
    trace : bool
        Keep the truth of every tick, for `truth`, and the last frames both ways, in `traffic`.
    """

    def __init__(self, rig: SimulatedRig, target: Target, trace: bool = False) -> None:
        self.rig = rig
        self.target = target
        self.ticks = 0
        self.actuators = Actuators()
        self.to_drive: deque[can.Message] = deque()
        self.from_drive: deque[can.Message] = deque()
        self.emergencies: list[can.Message] = []
        self.traffic: deque[can.Message] = deque(maxlen=FRAMES_KEPT if trace else 0)
        self._rows: list[NDArray[np.float64]] | None = [] if trace else None
        self._enabled: list[bool] = []
        target.reset()

    @property
    def time_s(self) -> float:
        """Virtual time since the start."""
        return self.ticks / TICKS_PER_S

    def step(self, operator: tuple[float, float] | None = None) -> None:
        """Advance one control period; `operator` as in `SimulatedRig.step`."""
        target = self.target
        while self.to_drive:
            sent = self.to_drive.popleft()
            target.send(sent)
            if self._rows is not None:
                self._note_sent(sent)
        actuators = target.tick(self.rig.sensors)
        self.ticks += 1
        while (message := target.receive()) is not None:
            message.timestamp = self.time_s
            self._note_emergency(message)
            self.from_drive.append(message)
            self.traffic.append(message)
        if actuators.reset_requested:
            target.reset()
            actuators = Actuators()
        self.actuators = actuators
        self.rig.step(actuators, operator)
        if self._rows is not None:
            self._rows.append(self.rig.plant.scalars.copy())
            self._enabled.append(actuators.bridge_enabled)

    def truth(self) -> Truth:
        """Return what really happened; RuntimeError unless the bench was built with `trace`."""
        if self._rows is None:
            raise RuntimeError("the bench keeps no truth: build it with trace=True")
        rows = np.array(self._rows).reshape(-1, at.SCALARS)
        return Truth(
            time_s=np.arange(1, len(rows) + 1) / TICKS_PER_S,
            motor_angle_rad=rows[:, at.MOTOR_ANGLE],
            load_angle_rad=rows[:, at.LOAD_ANGLE],
            motor_torque_nm=rows[:, at.MOTOR_TORQUE],
            load_torque_nm=rows[:, at.LOAD_TORQUE],
            motor_tension_a_n=rows[:, at.MOTOR_TENSION_A],
            load_tension_a_n=rows[:, at.LOAD_TENSION_A],
            motor_tension_b_n=rows[:, at.MOTOR_TENSION_B],
            load_tension_b_n=rows[:, at.LOAD_TENSION_B],
            motor_work_j=rows[:, at.MOTOR_WORK],
            operator_work_j=rows[:, at.OPERATOR_WORK],
            bridge_enabled=np.array(self._enabled, dtype=np.bool_),
        )

    def _note_sent(self, message: can.Message) -> None:
        """Keep a frame for the drive, as of now: its owner may send the same object again."""
        noted = copy(message)
        noted.timestamp, noted.is_rx = self.time_s, False
        self.traffic.append(noted)

    def _note_emergency(self, message: can.Message) -> None:
        """Keep error messages (EMCY with a code other than 0, "error reset") for the verdict."""
        cob_id = message.arbitration_id
        if EMCY < cob_id < EMCY + 0x80 and any(message.data[:2]):
            self.emergencies.append(message)
