"""The offline model of a cable-conduit pair: what the transmission does, computed on the host.

Imports nothing of the rest of `bowden` and no bus. A model file becomes a `Model`, two given series
become `Inputs`, and `simulate` returns the `Trajectory` that `diagnosis` and `cli` compare and write.
"""

from bowden.model.errors import ModelError
from bowden.model.trajectory import Inputs, Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission

__all__ = ["FrictionLaw", "Inputs", "Mode", "ModelError", "Trajectory", "Transmission"]
