"""`simulate`: a model and two given series in, the pair's trajectory out; `simulate_batch`: many.

Chooses the solver that the model asks for and goes through the effects around it, from what the
recording says to what acts on the cables and back (`bowden.model.effects.effect` has the picture).
The equations are theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.histories import Histories
from bowden.model.layers import Asked, Layers
from bowden.model.lumped import simulate_lumped
from bowden.model.mesh.solver import simulate_mesh
from bowden.model.mesh_free.solver import simulate_mesh_free
from bowden.model.passes import Passes
from bowden.model.trajectory import COLUMNS, FloatArray, Inputs, Mode, Trajectory
from bowden.workers import cores

MOST_PASSES = 16
AGREED = 1e-5  # of a series' largest value: then passes end, a tenth of NEARLY
NEARLY = 1e-4  # at the end of all passes: half of what 100 segments get wrong


def simulate(
    model: Model, mode: Mode, inputs: Inputs, near: Trajectory | None = None
) -> Trajectory:
    """Simulate a virgin rig: at the first sample both cables have their initial tension.

    Parameters
    ----------
    model : Model
    mode : Mode
        Which two series are given.
    inputs : Inputs
        Holds at least those two, as a recording has them.
    near : Trajectory, optional
        Of almost the same model or inputs: with it passes begin, and few are needed.

    Returns
    -------
    Trajectory
        With all four series as a recording would have them, four end tensions and slack flags. The
        angle of a pulley whose torque is given starts at the other's first sample by the ratio of
        the pulleys, then its first torque is applied.

    Raises
    ------
    ModelError
        Inputs that the mode or an effect cannot use, or passes that do not come to agree.

    Notes
    -----
    An effect that depends on a predicted series (a motor's inertia in torque-position needs the
    motor's acceleration) is solved by repeated passes: the first takes the ratio of the pulleys for
    the prediction, the next ones what came out before (`Passes`), until what is asked of the solver
    changes by no more than 1e-5 of its largest value. A torque that depends on the angle of its own
    pulley is asked with its slope, as Newton's method does. The measured series of that name is
    never looked at.
    """
    time_s, motor, load = inputs.for_mode(mode)
    layers = Layers(model.effects, mode, takes_slopes=model.solver == "mesh")
    if layers.is_empty:
        return _solve(model, mode, time_s, Asked(motor, load, Histories()))
    pair = model.transmission
    times = layers.begin(inputs, pair, near)
    asked, passes = layers.felt(pair), Passes()
    for _ in range(MOST_PASSES):
        trajectory = _solve(model, mode, times, asked)
        layers.answer(trajectory)
        if not layers.looks_ahead:
            break
        wanted = layers.felt(pair)
        asked = layers.at_answer(asked)
        if asked.agrees_with(wanted, AGREED):
            break
        last, asked = asked, wanted.with_series(passes.propose(asked.series, wanted.series))
    else:
        if not last.agrees_with(wanted, NEARLY):
            raise ModelError(
                f"effects: found no agreement in {MOST_PASSES} passes, accepted: weaker effects",
                model.source,
            )
    at = np.searchsorted(times, time_s)
    found = {name: values[at] for name, values in vars(trajectory).items()}
    found |= {name: layers.sides[0][name][at] for name in COLUMNS}
    return Trajectory(**found)


def looks_ahead(model: Model, mode: Mode) -> bool:
    """Return whether the model takes several passes: one `near` another begins with that."""
    return Layers(model.effects, mode, takes_slopes=False).looks_ahead


def _solve(model: Model, mode: Mode, time_s: FloatArray, asked: Asked) -> Trajectory:
    pair, motor, load = model.transmission, asked.motor, asked.load
    if model.solver == "mesh":
        return simulate_mesh(pair, mode, time_s, motor, load, asked.histories, asked.slope)
    if model.solver == "lumped":
        return simulate_lumped(pair, model.lumped, mode, time_s, motor, load)
    return simulate_mesh_free(pair, mode, time_s, motor, load)


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
    with ThreadPoolExecutor(max_workers=cores()) as pool:
        jobs = [
            pool.submit(simulate, models[i % len(models)], mode, series[i % len(series)])
            for i in range(count)
        ]
        return [job.result() for job in jobs]
