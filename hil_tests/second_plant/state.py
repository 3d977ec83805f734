"""Places in the implicit plant's arrays."""

from __future__ import annotations

from typing import Final

# of a node: rows of `nodes`
PLACE: Final = 0
SPEED: Final = 1
FRICTION: Final = 2

# of the vector of scalars
MOTOR_ANGLE: Final = 0
MOTOR_SPEED: Final = 1
LOAD_ANGLE: Final = 2
LOAD_SPEED: Final = 3
HAND_ANGLE: Final = 4
HAND_SPEED: Final = 5
CURRENT: Final = 6
MOTOR_TORQUE: Final = 7
LOAD_TORQUE: Final = 8
CELL_TORQUE: Final = 9
CURRENT_MEAN: Final = 10  # over the last control period
CELL_MEAN: Final = 11
OPERATOR_WORK: Final = 12
MOTOR_WORK: Final = 13
SCALARS: Final = 14
