"""Places in the rig's vector of scalar states: what `mechanics` moves and `sensors` and tests read.

The *_MEAN ones are averages over the last control period, which is what a sigma-delta converter
delivers; the works are sums since the start, in joules. Units: rad, rad/s, A, N, N m, m, s, K.
"""

from __future__ import annotations

from typing import Final

MOTOR_ANGLE: Final = 0
MOTOR_SPEED: Final = 1
LOAD_ANGLE: Final = 2  # of the handle
LOAD_SPEED: Final = 3
CURRENT: Final = 4
MOTOR_BRISTLE: Final = 5
LOAD_BRISTLE: Final = 6
MOTOR_TENSION_A: Final = 7
LOAD_TENSION_A: Final = 8
MOTOR_TENSION_B: Final = 9
LOAD_TENSION_B: Final = 10
MOTOR_TORQUE: Final = 11  # applied by the motor on its pulley, all that it does to it
LOAD_TORQUE: Final = 12  # applied by the cables on the load pulley
CURRENT_MEAN: Final = 13
CELL_TORQUE_MEAN: Final = 14
MOTOR_WORK: Final = 15
OPERATOR_WORK: Final = 16
PULLEY_ANGLE: Final = 17  # of the load pulley, where it has play to the handle
PULLEY_SPEED: Final = 18
TIME: Final = 19
WARMING: Final = 20  # of the conduit since the start
TRAVEL: Final = 21  # of the cable at the load, there and back
REST: Final = 22  # 0 rubbed fresh .. 1 rested long
FRICTION_FACTOR: Final = 23
PRETENSION: Final = 24  # of a cable whose ends are where they started
OPERATOR_PHASE: Final = 25
OPERATOR_SWELL: Final = 26  # 0 at standstill, 1 at full amplitude
INTENDED_ANGLE: Final = 27  # intended by the operator, over the last control period
CELL_PLAY: Final = 28  # what the load cell's hysteresis lets through
ASYMMETRY: Final = 29  # of friction, more towards positive angles
SCALARS: Final = 30
