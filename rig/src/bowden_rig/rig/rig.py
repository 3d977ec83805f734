"""The simulated rig in one piece: actuators in, one control period passes, sensors out.

Puts `plant`, `operator` and `sensors` together. `bench` steps it in lock-step with a target;
`native_loop` runs it with the natively built drive without coming back to Python.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import mechanics, parameters
from bowden_rig.rig import operator as person
from bowden_rig.rig import sensors as board
from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled, packed
from bowden_rig.rig.constants import CONTROL_PERIOD_S
from bowden_rig.rig.plant import Plant
from bowden_rig.rig.sensors import SensorBoard, Sensors

CONTROL_PERIOD_US: Final = 250


class Actuators(NamedTuple):
    """What the board does until the next tick: the twin of board.h's board_actuators_t."""

    motor_current_ua: int = 0
    bridge_enabled: bool = False
    reset_requested: bool = False


class Parts(NamedTuple):
    """All that a control period works on: constants as records, state as arrays."""

    constants: NDArray[np.void]
    intended: NDArray[np.void]
    reading: NDArray[np.void]
    wrap_rad: NDArray[np.float64]
    masses: NDArray[np.float64]
    springs: NDArray[np.float64]
    scalars: NDArray[np.float64]
    clocks: NDArray[np.int64]
    lines: NDArray[np.int64]
    noise: NDArray[np.float64]
    sample: NDArray[np.int32]


@compiled
def pass_period(  # noqa: PLR0917  (compiled code takes no keywords)
    p: Parts, current_ua: int, bridge_enabled: bool, given: bool, angle: float, speed: float
) -> None:
    """Advance one control period and sample the rig.

    `given`: the operator intends `angle` and `speed`; else what `parameters.Operator` describes.
    """
    if not given:
        go = bridge_enabled or not p.intended[0]["waits"]
        angle, speed = person.intended(p.intended, p.scalars, go, CONTROL_PERIOD_S)
    p.scalars[at.INTENDED_ANGLE] = angle
    mechanics.advance(
        p.constants,
        p.wrap_rad,
        p.masses,
        p.springs,
        p.scalars,
        1e-6 * current_ua,
        bridge_enabled,
        angle,
        speed,
    )
    p.clocks[board.TIME_US] += CONTROL_PERIOD_US
    board.read(p.reading, p.scalars, p.clocks, p.lines, p.noise, p.sample)


class SimulatedRig:
    """The rig, virgin at uniform pretension, handle and motor at zero.

    Parameters
    ----------
    description : parameters.Rig
        ValueError where it cannot be simulated stably.
    seed : int
        Of the sensors' noise; nothing else is random.
    start_time_us : int
        Of the board's clock.

    Attributes
    ----------
    parts : Parts
        What `pass_period` takes.
    """

    def __init__(
        self, description: parameters.Rig | None = None, seed: int = 0, start_time_us: int = 0
    ) -> None:
        self.description = description or parameters.Rig()
        self.plant = Plant(self.description)
        self.board = SensorBoard(self.description.sensing, seed, start_time_us)
        self.sensors: Sensors = self.board.read(self.plant.scalars, start_time_us)
        self.parts = Parts(
            self.plant.packed_constants,
            packed(person.reduced(self.description.operator)),
            self.board.reading,
            self.plant.wrap_rad,
            self.plant.masses,
            self.plant.springs,
            self.plant.scalars,
            self.board.clocks,
            self.board.lines,
            self.board.noise,
            self.board.sample,
        )

    def step(self, actuators: Actuators, operator: tuple[float, float] | None = None) -> Sensors:
        """Advance one control period with these actuators; what the board then reads.

        `operator`: intended angle (rad) and speed (rad/s), in place of those of the description.
        """
        self.board.stock_up()
        angle, speed = operator or (0.0, 0.0)
        pass_period(
            self.parts,
            actuators.motor_current_ua,
            actuators.bridge_enabled,
            operator is not None,
            angle,
            speed,
        )
        self.sensors = self.board.last()
        return self.sensors
