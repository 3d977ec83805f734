"""The pair as a co-simulation unit: two inputs held over a step, the pair's answer at its end.

`slave` wraps it for FMI; it works as well from any Python program that steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bowden.model import Mode, Model, ModelError
from bowden.model.mesh.solver import FREE_PULLEY
from bowden.model.stepper import PairStepper

TENSIONS = ("motor_tension_a_n", "load_tension_a_n", "motor_tension_b_n", "load_tension_b_n")
SLACK = "slack"


@dataclass(frozen=True)
class Variable:
    """An input or output: name and unit as in recordings (`N m`, `rad`, `N`)."""

    name: str
    unit: str
    description: str


_UNITS = {"_nm": "N m", "_rad": "rad", "_n": "N"}


def inputs_of(mode: Mode) -> list[Variable]:
    """Return the two inputs of a mode, the motor's first."""
    return [_variable(name) for name in mode.columns]


def outputs_of(mode: Mode) -> list[Variable]:
    """Return the outputs of a mode: the two predicted series, the four end tensions, slack."""
    slack = Variable(SLACK, "", "bits: 1 cable a is slack, 2 cable b, 4 no taut cable can carry")
    return [*(_variable(name) for name in (*mode.predicted, *TENSIONS)), slack]


class CoSimulation:
    """The pair between two communication points.

    Parameters
    ----------
    model : Model
        Solved on its mesh; what `PairStepper` refuses is refused.
    mode : Mode
    """

    def __init__(self, model: Model, mode: Mode) -> None:
        pair = model.transmission
        if pair.motor_inertia_kg_m2 > 0.0:
            raise ModelError(
                f"motor_inertia_kg_m2: found {pair.motor_inertia_kg_m2:g}, accepted in an FMU: 0 "
                "(put the inertia into the model that the FMU is coupled with)"
            )
        self._mode, self._free = mode, FREE_PULLEY[mode]
        self._radii = pair.motor_pulley_radius_m, pair.load_pulley_radius_m
        self._stepper = PairStepper(model, mode, "an FMU")
        self._row = np.zeros(6)
        self._given: tuple[float, float] | None = None
        self._angles = [0.0, 0.0]
        self.outputs: dict[str, float] = {one.name: 0.0 for one in outputs_of(mode)}

    def begin(self, inputs: Mapping[str, float], step_s: float) -> None:
        """Start from virgin cables where the inputs are now.

        A first torque is applied at once; two angles are taken to agree.
        """
        motor, load = (inputs[name] for name in self._mode.columns)
        ratio = self._radii[1] / self._radii[0]
        if self._free == 0:
            motor_angle, load_angle = ratio * load, load
        elif self._free == 1:
            motor_angle, load_angle = motor, motor / ratio
        else:
            motor_angle, load_angle = motor, load
        self._angles = [motor_angle, load_angle]
        self._given = (motor, load)
        self.advance(inputs, step_s)

    def advance(self, inputs: Mapping[str, float], step_s: float) -> None:
        """Let a step pass with the inputs held.

        Parameters
        ----------
        inputs : mapping of str to float
        step_s : float, s
            > 0.

        Raises
        ------
        ModelError
            No equilibrium, or inputs that are not finite.
        """
        motor, load = (inputs[name] for name in self._mode.columns)
        if not (np.isfinite(motor) and np.isfinite(load) and step_s > 0.0):
            found = f"{motor:g}, {load:g} over {step_s:g} s"
            raise ModelError(f"inputs: found {found}, accepted: finite ones and a step above 0")
        if self._given is None:
            self.begin(inputs, step_s)
            return
        r_motor, r_load = self._radii
        by_motor, by_load = motor - self._given[0], load - self._given[1]
        self._given = (motor, load)
        force = motor / r_motor if self._free == 0 else load / r_load if self._free == 1 else 0.0
        moved = self._stepper.step(
            force, 0.0, by_motor * r_motor, -by_load * r_load, step_s, self._row
        )
        self._angles[0] = self._angles[0] + moved / r_motor if self._free == 0 else motor
        self._angles[1] = self._angles[1] - moved / r_load if self._free == 1 else load
        self._answer()

    def _answer(self) -> None:
        a_1, a_l, b_1, b_l = self._row[1:5].tolist()
        everything = {
            "motor_angle_rad": self._angles[0],
            "load_angle_rad": self._angles[1],
            "motor_torque_nm": self._radii[0] * (a_1 - b_1),
            "load_torque_nm": self._radii[1] * (a_l - b_l),
            SLACK: float(self._row[5]),
            **dict(zip(TENSIONS, (a_1, a_l, b_1, b_l), strict=True)),
        }
        self.outputs = {name: everything[name] for name in self.outputs}


def _variable(name: str) -> Variable:
    unit = next(unit for ending, unit in _UNITS.items() if name.endswith(ending))
    words = name.removesuffix(next(e for e in _UNITS if name.endswith(e))).replace("_", " ")
    return Variable(name, unit, words)
