"""The rig of the mesh-free closed forms: Table I with Coulomb friction, and short operators."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
from bowden.model.mesh_free.solver import simulate_mesh_free
from bowden.model.trajectory import Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
EA, L, R, MU, T0 = 4000.0, 2.0, 0.28, 0.21, 10.0
R_IN, R_LOAD = 0.020, 0.104
RHO = R_LOAD / R_IN
M = MU * L / R
C = R / (MU * EA)
A_RELEASE = R / MU * (np.exp(M) - 1)
A_PULL = R / MU * (1 - np.exp(-M))


def table_1(**changes: Any) -> Transmission:
    rig = Transmission(
        axial_stiffness_n=EA,
        piece_length_m=np.array([L]),
        piece_curvature_per_m=np.array([1 / R]),
        pretension_n=T0,
        motor_pulley_radius_m=R_IN,
        load_pulley_radius_m=R_LOAD,
        friction=FrictionLaw(MU, MU),
    )
    return dataclasses.replace(rig, **changes)


def run(rig: Transmission, mode: Mode, first: FloatArray, second: FloatArray) -> Trajectory:
    return simulate_mesh_free(rig, mode, np.arange(len(first)) * 1e-3, first, second)


def torque_with_load_locked(rig: Transmission, torque: FloatArray) -> Trajectory:
    return run(rig, Mode.TORQUE_POSITION, torque, np.zeros_like(torque))


def through(*levels: float, steps: int = 200) -> FloatArray:
    """Straight lines from level to level; each level is hit exactly."""
    pieces = [np.linspace(a, b, steps, endpoint=False) for a, b in itertools.pairwise(levels)]
    return np.concatenate((*pieces, [levels[-1]]))


def phi(r: float) -> float:
    return float(r - 1 - np.log(r))
