"""`simulate`: a model and two given series in, the pair's trajectory out; `simulate_batch`: many.

Chooses the solver that the model asks for; the equations are theirs.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from bowden.model.description import Model
from bowden.model.lumped import simulate_lumped
from bowden.model.mesh_free import simulate_mesh_free
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
        With all four series, four end tensions and slack flags. The angle of a pulley whose torque
        is given starts at the other's first sample by the ratio of the pulleys, then its first
        torque is applied.

    Raises
    ------
    ModelError
        Inputs that the mode cannot use, or an effect that the model cannot compute.
    """
    time_s, motor, load = inputs.for_mode(mode)
    if model.solver == "mesh":
        return simulate_mesh(model.transmission, mode, time_s, motor, load)
    if model.solver == "lumped":
        return simulate_lumped(model.transmission, model.lumped, mode, time_s, motor, load)
    return simulate_mesh_free(model.transmission, mode, time_s, motor, load)


def simulate_batch(
    models: Sequence[Model], mode: Mode, inputs: Inputs | Sequence[Inputs]
) -> list[Trajectory]:
    """Simulate many models, or many inputs, or both in pairs, over all cores.

    Parameters
    ----------
    models : sequence of Model
        One, or as many as inputs.
    mode : Mode
    inputs : Inputs or sequence of Inputs
        One, or as many as models.

    Returns
    -------
    list of Trajectory
        In the order given.

    Raises
    ------
    ModelError
        The first that one of them raises.
    ValueError
        Counts that do not match.
    """
    series = [inputs] if isinstance(inputs, Inputs) else list(inputs)
    count = max(len(models), len(series))
    if not models or not series or {len(models), len(series)} - {1, count}:
        raise ValueError(f"found {len(models)} models and {len(series)} inputs, accepted: 1 or n")
    # The kernels release the interpreter, so threads do and nothing has to be copied.
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        jobs = [
            pool.submit(simulate, models[i % len(models)], mode, series[i % len(series)])
            for i in range(count)
        ]
        return [job.result() for job in jobs]
