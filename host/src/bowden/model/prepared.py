"""One model, mode and recording, simulated over and over with other numbers.

`prepare` checks the model's paths and the inputs once and returns a `Prepared`:

    ready = prepare(model, mode, inputs, ["rig.cable.pretension_n", "friction.mu_d"])
    ready.run([11.0, 0.2])                   one Trajectory
    simulate_many(ready, np.array([[11.0, 0.2], [9.0, 0.2]]))    (2, n, 2): both predicted series

A caller gets the very numbers of `simulate(model.with_values(...), mode, inputs)`, bit for bit from
`run` and to the solvers' tolerance from `simulate_many`, which works on all cores and shares what
does not depend on the values. Impossible values are a `ModelError` of `run` and rows of NaN of
`simulate_many`, so that a search goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.simulation import simulate
from bowden.model.trajectory import FloatArray, Inputs, Mode, Trajectory
from bowden.workers import cores


@dataclass(frozen=True)
class Prepared:
    """A simulation whose numbers at some paths are still open; made by `prepare`.

    Parameters
    ----------
    model : Model
        With all other numbers.
    mode : Mode
    inputs : Inputs
        Checked for the mode.
    paths : tuple of str, length k
        As `Model.value` takes them, such as ``effects[0].mu_v_s_per_m``.
    """

    model: Model
    mode: Mode
    inputs: Inputs
    paths: tuple[str, ...]

    @property
    def start(self) -> FloatArray:
        """The model's own values, shape (k,)."""
        return np.array([self.model.value(path) for path in self.paths])

    def with_values(self, values: ArrayLike) -> Model:
        """Return the model with these values.

        Parameters
        ----------
        values : array_like of shape (k,)

        Raises
        ------
        ModelError
            Impossible values, each named.
        """
        row = np.asarray(values, dtype=np.float64)
        return self.model.with_values(dict(zip(self.paths, row.tolist(), strict=True)))

    def run(self, values: ArrayLike) -> Trajectory:
        """Simulate with these values.

        Parameters
        ----------
        values : array_like of shape (k,)

        Raises
        ------
        ModelError
            Impossible values, or what `simulate` raises.
        """
        return simulate(self.with_values(values), self.mode, self.inputs)


def prepare(model: Model, mode: Mode, inputs: Inputs, paths: Sequence[str] = ()) -> Prepared:
    """Check a model, its inputs and the paths of the numbers that will vary.

    Parameters
    ----------
    model : Model
    mode : Mode
    inputs : Inputs
        Holds at least the mode's two series; what a simulation does not read is dropped.
    paths : sequence of str
        Of numbers in the model.

    Raises
    ------
    ModelError
        A path that holds no number, or inputs that the mode cannot use.
    """
    time_s, motor, load = inputs.for_mode(mode)
    given = dict(zip(mode.columns, (motor, load), strict=True))
    inputs = Inputs(time_s, conduit_temperature_c=inputs.conduit_temperature_c, **given)
    ready = Prepared(model, mode, inputs, tuple(paths))
    ready.with_values(ready.start)
    return ready


def simulate_many(prepared: Prepared, values: ArrayLike) -> FloatArray:
    """Simulate many sets of values.

    Parameters
    ----------
    prepared : Prepared
    values : array_like of shape (m, k)
        One set of values a row.

    Returns
    -------
    ndarray of shape (m, n, 2)
        The series named by `Mode.predicted`, n samples each. A set that is impossible or that
        the solver finds no answer for is all NaN; `Prepared.run` says why.

    Raises
    ------
    ValueError
        Values of another shape.
    """
    rows = np.asarray(values, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != len(prepared.paths):
        raise ValueError(f"found values of {rows.shape}, accepted: (m, {len(prepared.paths)})")
    names = prepared.mode.predicted
    found = np.full((rows.shape[0], prepared.inputs.time_s.size, len(names)), np.nan)

    def run(number: int) -> None:
        try:
            trajectory = prepared.run(rows[number])
        except ModelError:
            return
        for place, name in enumerate(names):
            found[number, :, place] = getattr(trajectory, name)

    # The kernels release the interpreter, so threads do and nothing has to be copied.
    with ThreadPoolExecutor(max_workers=cores()) as pool:
        list(pool.map(run, range(rows.shape[0])))
    return found
