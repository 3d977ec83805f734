"""What runs inside of the FMU; pythonfmu3 copies this file and ``model.yaml`` into it.

The Python that the FMU finds on the machine must have `bowden` installed.
"""

from __future__ import annotations

import json
from pathlib import Path

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability
from pythonfmu3.unit import Unit

from bowden.fmu.co_simulation import SLACK, CoSimulation, Variable, inputs_of, outputs_of
from bowden.model import Mode, parse_model

_BASE_UNITS = {
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "rad": {"rad": 1},
    "s": {"s": 1},
}
START_STEP_S = 1e-3


class BowdenPair(Fmi3Slave):  # type: ignore[misc]
    """A pair of Bowden cables between two pulleys."""

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        resources = Path(str(self.resources))
        about = json.loads((resources / "about.json").read_text(encoding="utf-8"))
        self.description = about["description"]
        self.version = about["version"]
        self._mode = Mode(about["mode"])
        text = (resources / "model.yaml").read_text(encoding="utf-8")
        self._model = parse_model(text, source="model.yaml of the FMU")
        self.register_units([Unit(name, **base) for name, base in _BASE_UNITS.items()])
        independent = {"causality": Fmi3Causality.independent, "unit": "s"}
        self.time = 0.0
        self._register(Variable("time", "s", "time"), **independent)
        for one in inputs_of(self._mode):
            setattr(self, one.name, 0.0)
            self._register(one, causality=Fmi3Causality.input)
        self._pair = CoSimulation(self._model, self._mode)
        for one in outputs_of(self._mode):
            setattr(self, one.name, 0.0)
            self._register(one, causality=Fmi3Causality.output)

    def exit_initialization_mode(self) -> None:
        """Begin where the inputs are."""
        self._pair = CoSimulation(self._model, self._mode)
        self._pair.begin(self._inputs(), START_STEP_S)
        self._publish()

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Let a communication step pass with the inputs held."""
        self._pair.advance(self._inputs(), step_size)
        self.time = current_time + step_size
        self._publish()
        return True

    def _register(self, one: Variable, **further: object) -> None:
        further = {"unit": one.unit or None, **further}
        discrete = one.name == SLACK
        variability = Fmi3Variability.discrete if discrete else Fmi3Variability.continuous
        self.register_variable(
            Float64(one.name, description=one.description, variability=variability, **further)
        )

    def _inputs(self) -> dict[str, float]:
        return {one.name: float(getattr(self, one.name)) for one in inputs_of(self._mode)}

    def _publish(self) -> None:
        for name, value in self._pair.outputs.items():
            setattr(self, name, value)
