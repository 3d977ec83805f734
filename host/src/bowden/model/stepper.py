"""The pair one sample at a time, on its mesh: for controllers, co-simulation and live use.

`PairStepper` keeps the state of both cables between samples and gives the numbers that `simulate`
gives for the same series on the same mesh. What it leaves out it refuses: effects around the
solver and a motor's inertia, which need the series as a whole.
"""

from __future__ import annotations

import numpy as np

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.layers import refuse_layers
from bowden.model.mesh import events, implicit
from bowden.model.mesh.solver import (
    FREE_PULLEY,
    chain_state,
    chain_tables,
    needs_implicit_steps,
    pulleys,
)
from bowden.model.mesh.state import rest_state, tables
from bowden.model.trajectory import FloatArray, Mode


class PairStepper:
    """One sample at a time, from virgin cables, on whichever mesh the friction needs.

    Parameters
    ----------
    model : Model
        Solved on its mesh, whatever solver it names.
    mode : Mode
        Which two series are given.
    doing : str
        What it is for, for messages.

    Raises
    ------
    ModelError
        An effect or a motor inertia, which cannot be stepped.
    """

    def __init__(
        self, model: Model, mode: Mode = Mode.TORQUE_POSITION, doing: str = "stepping"
    ) -> None:
        refuse_layers(model.effects, doing)
        self._pair = model.transmission
        self._free = FREE_PULLEY[mode]
        self._last_force: float | None = None
        self._implicit = needs_implicit_steps(self._pair, mode)
        self._events_tables, self._events = tables(self._pair), rest_state(self._pair)
        if self._implicit:
            self._chain_tables = chain_tables(self._pair)
            self._chain = chain_state(self._pair, self._chain_tables)
            self._pulleys = pulleys(self._pair, self._free)

    def step(  # noqa: PLR0917  (as the kernels below)
        self, force: float, spring: float, motor: float, load: float, dt: float, row: FloatArray
    ) -> float:
        """Take one sample.

        Parameters
        ----------
        force, spring : float, N and N/m
            Difference of tensions at the free pulley, less `spring` times its displacement.
        motor, load : float, m
            Displacement of cable a's ends in this sample, outward; of a free pulley it is ignored.
        dt : float, s
            > 0.
        row : ndarray of shape (6,)
            Gets T1a, TLa, T1b, TLb (N) and the flags at places 1 to 5.

        Returns
        -------
        float, m
            The free pulley's displacement.

        Raises
        ------
        ModelError
            No equilibrium was found.
        """
        before = 0.0 if self._last_force is None else self._last_force
        free = self._free
        if self._implicit:
            s, given, plain = self._chain, (before, force, spring, motor, load), (1.0, 1.0)
            t, p = self._chain_tables, self._pulleys
            moved, flags = implicit.sample(t, s, p, free, *given, plain, 0.0, dt)
            ends = s.tension[:, [0, -1]]
            slack = s.gap_m >= 0
        else:
            tables, e = self._events_tables, self._events
            x, y = (0.0 if free == 0 else motor), (0.0 if free == 1 else load)
            moved, flags = events.step(tables, e, free, before, force, spring, x, y)
            if tables.sticks:
                pair = self._pair
                x, y = (moved if free == 0 else x), (moved if free == 1 else y)
                band, rest = pair.velocity_dead_band_m_per_s, pair.rest_time_s
                events.stick_at_rest(tables, e, x, y, dt, band, rest)
            ends, slack = e.end_n, e.gap_m >= 0
        if flags & 8 or not np.isfinite(moved):
            raise ModelError("no equilibrium found, accepted: lower gains or smaller steps")
        row[1:5] = np.maximum(ends, 0.0).ravel()
        row[5] = (flags & 7) + slack[0] + 2 * slack[1]
        end = max(free, 0)
        self._last_force = float(row[1 + end] - row[3 + end])
        return float(moved)
