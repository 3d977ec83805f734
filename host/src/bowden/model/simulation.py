"""`simulate`: a model and two given series in, the pair's trajectory out.

Chooses the solver that the model asks for; the equations are theirs.
"""

from __future__ import annotations

from bowden.model.description import Model
from bowden.model.mesh_solver import simulate_mesh
from bowden.model.trajectory import Inputs, Mode, Trajectory


def simulate(model: Model, mode: Mode, inputs: Inputs) -> Trajectory:
    """Simulate a virgin rig: at the first sample both cables have their initial tension.

    Parameters
    ----------
    model : Model
    mode : Mode
        Which two series are given.
    inputs : Inputs
        Holds at least those two.

    Returns
    -------
    Trajectory
        With all four series, four end tensions and slack flags.

    Raises
    ------
    ModelError
        Inputs that the mode cannot use, or an effect that the model cannot compute.
    """
    time_s, motor, load = inputs.for_mode(mode)
    return simulate_mesh(model.transmission, mode, time_s, motor, load)
