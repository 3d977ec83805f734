"""The offline model of a cable-conduit pair: what the transmission does, computed on the host.

Imports nothing of the rest of `bowden` and no bus. A model file becomes a `Model`, two given series
become `Inputs`, and `simulate` returns the `Trajectory` that `diagnosis` and `cli` go on with.
"""

from bowden.model.description import Model, format_model, parse_model, table_1
from bowden.model.errors import ModelError
from bowden.model.prepared import Prepared, prepare, simulate_many
from bowden.model.simulation import looks_ahead, simulate, simulate_batch
from bowden.model.trajectory import Inputs, Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission

__all__ = [
    "FrictionLaw",
    "Inputs",
    "Mode",
    "Model",
    "ModelError",
    "Prepared",
    "Trajectory",
    "Transmission",
    "format_model",
    "looks_ahead",
    "parse_model",
    "prepare",
    "simulate",
    "simulate_batch",
    "simulate_many",
    "table_1",
]
