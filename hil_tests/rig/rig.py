"""The simulated rig in one piece: actuators in, one control period passes, sensors out.

Puts `plant`, `human` and `sensors` together. `bench` steps it in lock-step with a target.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from hil_tests.rig import parameters
from hil_tests.rig.human import Human
from hil_tests.rig.plant import CONTROL_PERIOD_S, Plant
from hil_tests.rig.sensors import SensorBoard, Sensors

CONTROL_PERIOD_US: Final = 250


class Actuators(NamedTuple):
    """What the board does until the next tick: the twin of board.h's board_actuators_t."""

    motor_current_ua: int = 0
    bridge_enabled: bool = False
    reset_requested: bool = False


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
    """

    def __init__(
        self, description: parameters.Rig | None = None, seed: int = 0, start_time_us: int = 0
    ) -> None:
        self.description = description or parameters.Rig()
        self.plant = Plant(self.description)
        self._human = Human(self.description.hand)
        self._waits = self.description.hand.starts == "on-enable"
        self._board = SensorBoard(self.description.sensing, seed, start_time_us)
        self._time_us = start_time_us
        self.sensors: Sensors = self._board.read(self.plant.scalars, start_time_us)

    def step(self, actuators: Actuators) -> Sensors:
        """Let one control period pass with these actuators; what the board then reads."""
        go = actuators.bridge_enabled or not self._waits
        angle, speed = self._human.wanted(go, CONTROL_PERIOD_S)
        self.plant.advance(
            1e-6 * actuators.motor_current_ua, actuators.bridge_enabled, angle, speed
        )
        self._time_us += CONTROL_PERIOD_US
        self.sensors = self._board.read(self.plant.scalars, self._time_us)
        return self.sensors
