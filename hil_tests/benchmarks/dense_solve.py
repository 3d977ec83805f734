"""The paper's equations solved as the paper has them: one dense linear system a step.

Eqs. (1) and (2) for every segment of both cables, the positions of the load's ends, the rigid motor
pulley and its torque: ``4 (N + 1)`` unknowns. Only for a pair that slides as a whole, where no last
moving node has to be searched: the search would cost several such solves a step, and a matrix built
anew for each. Here it is built once, in favour of the paper's scheme.
"""

from __future__ import annotations

import numpy as np
from bowden.model import Transmission
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def load_torque_while_sliding(
    pair: Transmission, motor_torque_nm: Floats, load_angle_rad: Floats
) -> Floats:
    """Return the load torque of a pair that slides towards positive angle all the time, N m.

    Parameters
    ----------
    pair : Transmission
        Of one curvature, with `segments` and Coulomb friction.
    motor_torque_nm, load_angle_rad : ndarray of shape (n,)
    """
    n = pair.segments or 100
    nodes = n + 1
    wrap = pair.friction.mu_d * float(pair.piece_curvature_per_m[0]) * pair.length_m / n
    rest_m = pair.pretension_n * pair.length_m / pair.axial_stiffness_n
    system = np.zeros((4 * nodes, 4 * nodes))
    given = np.zeros(4 * nodes)
    row = 0
    load_rows = []
    for cable, sign in enumerate((-1.0, 1.0)):  # cable a runs to the motor, b to the load
        u, t = 2 * cable * nodes, (2 * cable + 1) * nodes
        stretch = np.expm1(sign * wrap) / (sign * wrap)
        stretch *= pair.length_m / (n * pair.axial_stiffness_n)
        for i in range(n):
            system[row, t + i + 1], system[row, t + i] = 1.0, -np.exp(sign * wrap)
            system[row + 1, u + i + 1], system[row + 1, u + i] = 1.0, -1.0
            system[row + 1, t + i] = -stretch
            row += 2
        system[row, u + n] = 1.0
        load_rows.append(row)
        row += 1
    system[row, 0] = system[row, 2 * nodes] = 1.0
    system[row + 1, nodes], system[row + 1, 3 * nodes] = 1.0, -1.0

    out = np.empty_like(load_angle_rad)
    for sample, (torque, angle) in enumerate(zip(motor_torque_nm, load_angle_rad, strict=True)):
        given[load_rows[0]] = rest_m - pair.load_pulley_radius_m * angle
        given[load_rows[1]] = rest_m + pair.load_pulley_radius_m * angle
        given[row + 1] = torque / pair.motor_pulley_radius_m
        solution = np.linalg.solve(system, given)
        out[sample] = pair.load_pulley_radius_m * (solution[2 * nodes - 1] - solution[-1])
    return out
