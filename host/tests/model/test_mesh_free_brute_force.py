"""The mesh-free solver against two slow, independent solutions that share none of its algebra.

1. The play operator on 4000 points: a profile of log tension, clipped from both ends at given
   end tensions; displacements by the trapezoid rule.
2. A chain of 40 nodes with dry friction at each, both ends moved, every step solved by sweeping
   until no node wants to move: no fronts, no regimes, no log tension. It finds by itself which
   part slides where.
"""

from __future__ import annotations

import numba
import numpy as np
import pytest
from bowden.model.mesh_free.solver import simulate_mesh_free
from bowden.model.trajectory import Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
EA, T0, MU = 4000.0, 10.0, 0.21
NODES = 40
PATHS = {
    "one bend": ([2.0], [1 / 0.28]),
    "two bends": ([0.8, 1.2], [6.0, 2.0]),
    "straight between": ([0.7, 0.5, 0.8], [5.0, 0.0, 4.0]),
    "straight at the ends": ([0.3, 1.5, 0.2], [0.0, 4.0, 0.0]),
}


def pair(path: str) -> Transmission:
    lengths, curvatures = PATHS[path]
    return Transmission(
        axial_stiffness_n=EA,
        piece_length_m=np.array(lengths),
        piece_curvature_per_m=np.array(curvatures),
        pretension_n=T0,
        motor_pulley_radius_m=1.0,
        load_pulley_radius_m=1.0,
        friction=FrictionLaw(MU, MU),
    )


def move_ends(rig: Transmission, motor_m: FloatArray, load_m: FloatArray) -> Trajectory:
    """Give cable a's end displacements: pulleys of 1 m."""
    time = np.arange(len(motor_m)) * 1e-3
    return simulate_mesh_free(rig, Mode.POSITION_POSITION, time, -motor_m, -load_m)


def fine_path(rig: Transmission, points: int) -> tuple[FloatArray, FloatArray]:
    """Positions, and wrap (mu times angle) up to them."""
    edges = np.concatenate(([0.0], np.cumsum(rig.piece_length_m)))
    s = np.unique(np.round(np.concatenate((np.linspace(0.0, edges[-1], points), edges)), 9))
    wrap = np.concatenate(([0.0], np.cumsum(MU * rig.piece_curvature_per_m * rig.piece_length_m)))
    return s, np.interp(s, edges, wrap)


def random_levels(rng: np.random.Generator, count: int, steps: int, size: float) -> FloatArray:
    levels = np.concatenate(([0.0], rng.uniform(-size, size, count)))
    return np.interp(np.linspace(0, count, count * steps + 1), np.arange(count + 1), levels)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_play_operator_on_4000_points(path: str, seed: int) -> None:
    rig = pair(path)
    s, wrap = fine_path(rig, 4000)
    total = wrap[-1]
    rng = np.random.default_rng(seed)
    # no end may drag the other along: then an end's displacement would not follow from tensions
    near = np.log(T0) + random_levels(rng, 8, 60, 0.49 * total)
    far = np.log(T0) + random_levels(rng, 8, 60, 0.49 * total)
    profile = np.full(s.shape, np.log(T0))
    u = T0 * s / EA
    motor, load = [], []
    for y_near, y_far in zip(near, far, strict=True):
        old = profile
        profile = np.clip(profile, y_near - wrap, y_near + wrap)
        profile = np.clip(profile, y_far - (total - wrap), y_far + (total - wrap))
        change = (np.exp(profile) - np.exp(old)) / EA
        added = np.concatenate(([0.0], np.cumsum(0.5 * (change[1:] + change[:-1]) * np.diff(s))))
        at_rest = int(np.argmin(np.abs(profile - old)))  # some point is: this one keeps its place
        u = u + added - added[at_rest]
        motor.append(u[0])
        load.append(u[-1])
    answer = move_ends(rig, np.array(motor), np.array(load) - T0 * s[-1] / EA)
    # a front is found within one of 4000 points: 4e-4 of the wrap, and the tension follows the
    # square root of the travel lost there
    np.testing.assert_allclose(answer.motor_tension_a_n, np.exp(near), rtol=2e-3)
    np.testing.assert_allclose(answer.load_tension_a_n, np.exp(far), rtol=2e-3)
    error = answer.motor_tension_a_n / np.exp(near) - 1
    assert np.sqrt(np.mean(error**2)) < 3e-4


@numba.njit
def sweep_chain(
    u: FloatArray, length: FloatArray, wrap: FloatArray, motor: FloatArray, load: FloatArray
) -> FloatArray:
    """Strains of the first and last segment; a row for each end."""
    strains = np.empty((2, len(motor)))
    for i in range(len(motor)):
        u[0], u[-1] = motor[i], load[i]
        old = u.copy()
        for _ in range(200000):
            largest = 0.0
            for j in range(1, len(u) - 1):
                ratio = np.exp(wrap[j])
                # where friction, fully against it, stops a node that comes from below, from above
                soft, stiff = length[j - 1], ratio * length[j]
                from_below = (soft * u[j + 1] + stiff * u[j - 1]) / (soft + stiff)
                soft, stiff = ratio * length[j - 1], length[j]
                from_above = (soft * u[j + 1] + stiff * u[j - 1]) / (soft + stiff)
                place = min(max(old[j], from_below), from_above)
                largest = max(largest, abs(place - u[j]))
                u[j] = place
            if largest < 1e-14:
                break
        strains[0, i] = (u[1] - u[0]) / length[0]
        strains[1, i] = (u[-1] - u[-2]) / length[-1]
    return strains


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("size", [0.002, 0.02])
def test_a_chain_of_nodes_with_dry_friction(path: str, seed: int, size: float) -> None:
    rig = pair(path)
    s, wrap = fine_path(rig, NODES + 1)
    bent = np.concatenate(([True], np.diff(wrap) > 1e-9)) | np.append(np.diff(wrap) > 1e-9, True)
    s, wrap = s[bent], wrap[bent]  # a straight piece is one segment
    rng = np.random.default_rng(seed)
    motor = random_levels(rng, 5, 20, size)
    # slack belongs to the pair's law, not to the chain's: keep a fifth of the stretch
    load = np.maximum(random_levels(rng, 5, 20, size), motor - 0.8 * T0 * s[-1] / EA)
    node_wrap = np.concatenate(([0.0], 0.5 * (wrap[2:] - wrap[:-2]), [0.0]))
    u = T0 * s / EA
    tension = EA * sweep_chain(u, np.diff(s), node_wrap, motor, load + T0 * s[-1] / EA)
    answer = move_ends(rig, motor, load)
    exact = np.array([answer.motor_tension_a_n, answer.load_tension_a_n])
    # a chain knows the tension, and where a front is, within a segment of wrap[-1] / NODES
    error = np.abs(np.log(tension / exact))
    assert np.max(error) < 2.0 * wrap[-1] / NODES
    assert np.sqrt(np.mean(error**2)) < 0.7 * wrap[-1] / NODES
