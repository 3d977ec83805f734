"""The exact solution of a pull-pull pair with Coulomb friction: no mesh, no error of a mesh.

Imports the numbers of the pair and the answer's type, nothing else of ours. It turns a
`Transmission` into the arrays of `mesh_free.profile`, which holds the physics, and runs the kernels
of `mesh_free.steps` over the samples. `simulate` calls it; it is the judge of every mesh.

**Exact in space**, for any number of path pieces, straight ones included. **In time** a step takes
the shortest way from sample to sample: exact while the ends keep their direction, whatever the
step. Two events inside a step are resolved to the step only: a neutral point that wanders (both
ends of a cable pulled apart, or let together, after the whole cable has begun to move) and the
moment a slack cable becomes taut between ends that move against each other.

**Stiction.** Without a length of its own, a breakaway coefficient above mu_d has no effect here:
the excess acts over one segment, and there are none (the pair breaks away at T0 exp(mu_d L/R), the
limit of eqs. (4) and (6) as N grows). With a stiction length the tension of a cable whose end is
moved falls at once each time a front joins an older one (snap-through), the answer depends on the
dynamics that the quasi-static equations leave out, and the solver refuses.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bowden.model.errors import ModelError
from bowden.model.mesh_free.profile import (
    BREAKPOINT_FIELDS,
    COMPLIANCE,
    DISPLACEMENT,
    END,
    LUMP,
    PIECE,
    PIECE_FIELDS,
    PLAN_FIELDS,
    REACH_PULL,
    REACH_RELEASE,
    START,
    TENSION,
    X_FAR,
    X_NEAR,
    FloatArray,
    Pair,
)
from bowden.model.mesh_free.steps import (
    CARRIED_FIELDS,
    FAR_A,
    FAR_B,
    FOUND_FAR,
    FOUND_NEAR,
    MEAN,
    NEAR_A,
    NEAR_B,
    OUTPUT_ROWS,
    run_positions,
    run_torque,
)
from bowden.model.trajectory import SLACK_A, SLACK_B, Mode, Trajectory
from bowden.model.transmission import Transmission

_STRAIGHT_BELOW = 1e-8  # wrap (times mu) that counts as none: rounding of R/mu |T2 - T1| is worse
_LARGEST_WRAP = 300.0  # exp of it, squared, still fits a float
_LINEAR_ERROR = 1e-7  # of a linear initial profile, drawn as exponentials
_PAIRS_KEPT = 32  # a fit runs one pair on many inputs
_FIRST_ROOM = 256  # breakpoints; doubled when they run out


def simulate_mesh_free(
    transmission: Transmission,
    mode: Mode,
    time_s: FloatArray,
    first: FloatArray,
    second: FloatArray,
) -> Trajectory:
    """Run a pair through a series of two given end quantities.

    Parameters
    ----------
    transmission : Transmission
        A pair with Coulomb friction; `segments` is not read.
    mode : Mode
    time_s : ndarray of shape (n,), s
        Copied to the answer; the solution does not depend on it.
    first, second : ndarray of shape (n,), N m or rad
        The motor's and the load's given series (`Mode.columns`).

    Returns
    -------
    Trajectory
        At the first angle given each cable has its initial profile, and a free pulley starts where
        the ratio of the pulleys puts it; then the first torque is applied.
        `NOT_CARRIED` is never set: the stretches of the two cables sum to a constant >= 0, so the
        pulley always finds a cable to pull on.

    Raises
    ------
    ModelError
        A friction law that is not Coulomb's, or an initial profile that friction cannot hold.
    """
    seen_from_load = mode is Mode.POSITION_TORQUE
    path, profile = _virgin(transmission, seen_from_load)
    pair = _pair_at_rest(path, profile)
    stretch, carried = profile[-1, DISPLACEMENT], np.zeros(CARRIED_FIELDS)
    carried[MEAN] = profile[0, TENSION]
    out = np.zeros((OUTPUT_ROWS, len(time_s)))
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    motor_travel, load_travel = first - first[0], second - second[0]
    done = 0
    while done < len(time_s):
        if mode is Mode.TORQUE_POSITION:
            series = first / r_motor, -r_load * load_travel
            done = run_torque(pair, *series, stretch, carried, done, out)
        elif mode is Mode.POSITION_TORQUE:
            series = second / r_load, r_motor * motor_travel
            done = run_torque(pair, *series, stretch, carried, done, out)
        else:
            series = -r_motor * motor_travel, -r_load * load_travel
            done = run_positions(pair, *series, stretch, done, out)
        if done < len(time_s):
            pair = _with_more_room(pair)

    slack = SLACK_A * ((out[NEAR_A] == 0) & (out[FAR_A] == 0))
    slack = slack | (SLACK_B * ((out[NEAR_B] == 0) & (out[FAR_B] == 0)))
    motor_angle, load_angle, motor_torque, load_torque = first, second, first, second
    if mode is Mode.TORQUE_POSITION:
        motor_angle = (r_load * second[0] - out[FOUND_NEAR]) / r_motor
        load_torque = r_load * out[FOUND_FAR]
    elif mode is Mode.POSITION_TORQUE:
        load_angle = (r_motor * first[0] + out[FOUND_NEAR]) / r_load
        motor_torque = r_motor * out[FOUND_FAR]
    else:
        motor_torque, load_torque = r_motor * out[FOUND_NEAR], r_load * out[FOUND_FAR]
    motor_a, load_a, motor_b, load_b = NEAR_A, FAR_A, NEAR_B, FAR_B
    if seen_from_load:
        motor_a, load_a, motor_b, load_b = FAR_A, NEAR_A, FAR_B, NEAR_B
    return Trajectory(
        time_s=time_s,
        motor_angle_rad=motor_angle,
        load_angle_rad=load_angle,
        motor_torque_nm=motor_torque,
        load_torque_nm=load_torque,
        motor_tension_a_n=out[motor_a],
        load_tension_a_n=out[load_a],
        motor_tension_b_n=out[motor_b],
        load_tension_b_n=out[load_b],
        slack=slack.astype(np.uint8),
    )


@lru_cache(maxsize=_PAIRS_KEPT)
def _virgin(transmission: Transmission, seen_from_load: bool) -> tuple[FloatArray, FloatArray]:
    """Path tables and initial profile; the same for every input, and kernels change neither."""
    refuse_what_is_not_coulomb(transmission)
    path = path_tables(transmission, seen_from_load)
    return path, _initial_profile(transmission, path, seen_from_load)


def refuse_what_is_not_coulomb(transmission: Transmission) -> None:
    """Raise ModelError unless the mesh-free solution exists for this friction law."""
    law = transmission.friction
    problems = []
    if not law.is_coulomb:
        problems.append("friction: found a coefficient that depends on speed or tension")
    if law.direction_asymmetry != 0.0:
        problems.append(f"direction_asymmetry: found {law.direction_asymmetry:g}")
    if law.has_stiction and law.stiction_length_m is not None:
        problems.append(
            f"friction: found mu_s {law.mu_s:g} > mu_d {law.mu_d:g} over "
            f"{law.stiction_length_m:g} m of stiction length"
        )
    if problems:
        accepted = "numerics.solver mesh_free accepts Coulomb friction; give numerics.segments"
        raise ModelError([f"{problem}; {accepted}" for problem in problems])


def path_tables(transmission: Transmission, seen_from_load: bool = False) -> FloatArray:
    """Path pieces as the kernels read them.

    Returns
    -------
    ndarray of shape (2, n_curved + 2, PIECE_FIELDS)
        Seen from the near end (the load's if `seen_from_load`) and from the far end.
    """
    wrap = transmission.friction.mu_d * transmission.piece_curvature_per_m
    wrap = wrap * transmission.piece_length_m
    if wrap.sum() > _LARGEST_WRAP:
        raise ModelError(
            f"rig.cable.path: found a wrap of {wrap.sum():.0f} (mu times turning angle); "
            f"accepted: up to {_LARGEST_WRAP:.0f}"
        )
    compliance = transmission.piece_length_m / transmission.axial_stiffness_n
    if seen_from_load:
        wrap, compliance = wrap[::-1], compliance[::-1]
    near, far = _one_side(wrap, compliance), _one_side(wrap[::-1], compliance[::-1])
    far[-1, START] = far[-1, END] = near[-1, END]
    far[-2, END] = near[-1, END]
    return np.stack((near, far))


def _one_side(wrap: FloatArray, compliance: FloatArray) -> FloatArray:
    curved = np.flatnonzero(wrap > _STRAIGHT_BELOW)
    rows = np.zeros((len(curved) + 2, PIECE_FIELDS))
    ends = np.exp(np.cumsum(wrap[curved]))
    rows[:, START] = np.concatenate(([1.0, 1.0], ends))
    rows[:, END] = np.concatenate(([1.0], ends, [ends[-1] if len(curved) else 1.0]))
    rows[1:-1, COMPLIANCE] = compliance[curved] / wrap[curved]
    total = np.concatenate(([0.0], np.cumsum(np.where(wrap > _STRAIGHT_BELOW, 0.0, compliance))))
    rows[1:, LUMP] = np.diff(total[np.concatenate(([0], curved, [len(wrap)]))])
    pulled, released = 0.0, 0.0  # per newton at the end, up to the start of piece p
    for p in range(1, len(rows)):
        before, x, c = rows[p - 1, COMPLIANCE], rows[p, START], rows[p, COMPLIANCE]
        pulled += before * (1 / rows[p - 1, START] - 1 / x) + rows[p, LUMP] / x
        released += before * (x - rows[p - 1, START]) + rows[p, LUMP] * x
        rows[p, REACH_PULL] = pulled + c / x
        rows[p, REACH_RELEASE] = released - c * x
    return rows


def _initial_profile(
    transmission: Transmission, path: FloatArray, seen_from_load: bool
) -> FloatArray:
    """Breakpoints of the initial profile.

    Two at each path boundary: straight path between two curved pieces has one tension and two
    displacements.
    """
    if transmission.initial_tension_n is None and transmission.pretension_n == 0.0:
        ends = np.zeros((2, BREAKPOINT_FIELDS))
        ends[:, X_NEAR] = 1.0, path[0, -1, END]
        ends[:, X_FAR] = path[0, -1, END], 1.0
        ends[1, PIECE] = path.shape[1] - 1
        return ends
    wrap = transmission.friction.mu_d * transmission.piece_curvature_per_m
    is_curved = wrap * transmission.piece_length_m > _STRAIGHT_BELOW
    edges = np.concatenate(([0.0], np.cumsum(transmission.piece_length_m)))
    stations = _stations(transmission, edges)
    tension = _tension_at(transmission, stations)
    if np.any(tension <= 0):
        raise ModelError("initial tension: found 0 N or less within a profile; accepted: > 0")
    if seen_from_load:
        stations, edges = edges[-1] - stations[::-1], edges[-1] - edges[::-1]
        tension, wrap, is_curved = tension[::-1], wrap[::-1], is_curved[::-1]

    rows = [[1.0, 0.0, tension[0], 0.0, 1.0, 0.0]]
    curved = 0
    u = 0.0
    for piece in range(len(wrap)):
        inside = (stations >= edges[piece]) & (stations <= edges[piece + 1])
        s, t = stations[inside], tension[inside]
        if not is_curved[piece]:
            if np.ptp(t) > 1e-9 * t[0]:
                raise _not_held(edges[piece], edges[piece + 1])
            u += t[0] * (edges[piece + 1] - edges[piece]) / transmission.axial_stiffness_n
            continue
        curved += 1
        growth = np.diff(np.log(t))
        slope = growth / (wrap[piece] * np.diff(s))
        if np.any(np.abs(slope) > 1 + 1e-6):
            raise _not_held(edges[piece], edges[piece + 1])
        slope = np.where(np.abs(slope) > 1 - 1e-9, np.sign(slope), slope)
        x = path[0, curved, START] * np.exp(wrap[piece] * (s - s[0]))
        x[-1] = path[0, curved, END]
        c = path[0, curved, COMPLIANCE]
        for k in range(len(slope)):
            rows.append([x[k], 0.0, t[k], u, slope[k], curved])
            z = np.log(x[k + 1] / x[k])
            u += c * t[k] * (np.expm1(slope[k] * z) / slope[k] if slope[k] else z)
        rows.append([x[-1], 0.0, t[-1], u, 1.0, curved])
    rows.append([path[0, -1, END], 0.0, tension[-1], u, 0.0, path.shape[1] - 1])
    profile = np.array(rows, dtype=np.float64)
    profile[:, X_FAR] = path[0, -1, END] / profile[:, X_NEAR]
    return profile


def _stations(transmission: Transmission, edges: FloatArray) -> FloatArray:
    """Positions of the breakpoints.

    Path edges, points of the given profile, and enough between them that exponentials follow its
    straight lines.
    """
    at, given = transmission.initial_position_m, transmission.initial_tension_n
    if at is None or given is None:
        return edges
    knots = np.unique(np.concatenate((edges, np.clip(at, 0.0, edges[-1]))))
    tension = np.maximum(_tension_at(transmission, knots), 1e-12)
    pieces = np.ceil(np.abs(np.diff(np.log(tension))) / np.sqrt(8 * _LINEAR_ERROR)).astype(int)
    fine = [
        np.linspace(a, b, max(n, 1), endpoint=False)
        for a, b, n in zip(knots[:-1], knots[1:], pieces, strict=True)
    ]
    return np.concatenate((*fine, knots[-1:]))


def _tension_at(transmission: Transmission, position_m: FloatArray) -> FloatArray:
    at, given = transmission.initial_position_m, transmission.initial_tension_n
    if at is None or given is None:
        return np.full(position_m.shape, transmission.pretension_n)
    return np.interp(position_m, at, given)


def _not_held(start_m: float, end_m: float) -> ModelError:
    return ModelError(
        f"initial tension: found a change between {start_m:g} and {end_m:g} m that friction "
        "cannot hold; accepted: |dT/ds| <= mu_d T/R, none where the path is straight"
    )


def _pair_at_rest(path: FloatArray, profile: FloatArray) -> Pair:
    room = _FIRST_ROOM + 2 * len(profile)
    start = (room - len(profile)) // 2
    points = np.zeros((2, room, BREAKPOINT_FIELDS))
    points[:, start : start + len(profile)] = profile
    span = np.array([[start, start + len(profile) - 1]] * 2, dtype=np.int64)
    return Pair(points, span, path, np.zeros((2, PLAN_FIELDS)))


def _with_more_room(pair: Pair) -> Pair:
    """Centre both profiles in more room; a step adds at most one breakpoint at an end."""
    used = pair.span[:, 1] - pair.span[:, 0] + 1
    points = np.zeros((2, _FIRST_ROOM + 2 * int(used.max()), BREAKPOINT_FIELDS))
    span = np.empty_like(pair.span)
    for cable, (first, last) in enumerate(pair.span):
        start = (points.shape[1] - used[cable]) // 2
        points[cable, start : start + used[cable]] = pair.points[cable, first : last + 1]
        span[cable] = start, start + used[cable] - 1
    return pair._replace(points=points, span=span)
