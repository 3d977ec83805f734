"""The cable cut into segments: a chain of Coulomb sliders joined by springs.

Reads a `Transmission`; `mesh.events` and `mesh.implicit` step what is built here.

Nodes 0..N carry a tension, segments 0..N-1 the friction. The friction of segment j acts at a slider
inside it, and a segment whose end tensions are T_j and T_j+1 has the stretch

    w_j (T_j + T_{j+1}) ds_j / EA,    w = tanh(a/2)/a,    a_j = mu_d ds_j/R_j.

A sliding segment has T_{j+1} = T_j exp(+-a_j), eq. (1), and with this w its stretch is exactly
that of eq. (2), in both directions; a segment at standstill next to a moving one obeys eq. (3) with
w in place of the half (w -> 1/2 as a -> 0). So the stretch is a function of the tensions alone:
nothing jumps when a segment starts, stops or reverses, and a dwell leaves no trace. Twice ``w
ds/EA`` is short, by a^2/12, of the stretch ds/EA of a segment that still has its uniform
pretension. Until a segment first slides, its halves therefore follow the two straight lines that
join the uniform state to the two sliding ones (`virgin_slope`), and plateaus do not depend on N.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.friction.coulomb import slide_exponent
from bowden.model.friction.stiction import breakaway_excess
from bowden.model.transmission import FloatArray, Transmission

RELEASE, PULL = 0, 1
FROM_END = slice(None), slice(None, None, -1)  # segments from the motor's end, from the load's
DEFAULT_SEGMENTS = 100
NO_STRAIN = 1e-9
_MESHES_KEPT = 64  # a fit changes numbers, seldom the path


class Tables(NamedTuple):
    """Constants of both cables; axes: cable c, end e (0 motor, 1 load), motion of that end, place.

    The motion is RELEASE or PULL; places count from the end e. ``decay[c, e, d, n]`` is the tension
    at node n over that at the end while all between slides; ``outer`` the stretch, per newton at
    the end, from the end to the near side of node n (its inner half-segment left out), m/N.
    ``half[e, n]`` and ``half_virgin[e, side, n]`` (side RELEASE: below pretension, PULL: above) are
    the compliance of half a segment, m/N; ``hold[c, e, d, n]`` is the ratio of tensions over
    segment n that starts it, ``sticks`` whether that exceeds the ratio while it slides. A cable
    with less than ``least_n`` is as good as slack. Where friction ``varies`` from step to step,
    `mesh.varying` works ``decay``, ``outer`` and ``hold`` out anew.
    """

    decay: FloatArray
    outer: FloatArray
    half: FloatArray
    half_virgin: FloatArray
    hold: FloatArray
    pretension_n: float
    least_n: float
    sticks: bool
    varies: bool


class State(NamedTuple):
    """State of the cables, changed in place.

    ``node_n[c, i]`` is valid between the two moving zones; a zone's tensions follow from ``end_n``
    by `Tables.decay`. ``depth[c, e]`` counts the sliding segments from end e, ``motion[c, e]`` is
    RELEASE or PULL, ``virgin[c]`` the range of segments that never slid, ``gap_m[c]`` how far a
    slack cable is from being taut (-1 while taut), ``rest_s[c, e]`` how long an end has rested.
    ``stiffness_n_per_m[c, e]`` is worked out from the rest by `mesh.zones.respond`.
    """

    node_n: FloatArray
    end_n: FloatArray
    depth: NDArray[np.int64]
    motion: NDArray[np.int64]
    virgin: NDArray[np.int64]
    gap_m: FloatArray
    rest_s: FloatArray
    stiffness_n_per_m: FloatArray


@dataclass(frozen=True)
class Mesh:
    """Segments of one cable, motor to load.

    Parameters
    ----------
    length_m : ndarray of shape (N,), m
    wrap_rad : ndarray of shape (N,), rad
        Angle turned within each segment, integral of ds/R.
    """

    length_m: FloatArray
    wrap_rad: FloatArray

    @property
    def position_m(self) -> FloatArray:
        """Place of the N + 1 nodes."""
        return np.concatenate(([0.0], np.cumsum(self.length_m)))


def segments_of(transmission: Transmission) -> int:
    """Return how many segments a cable has on the mesh; the usual number where none is named."""
    return transmission.segments or DEFAULT_SEGMENTS


def cut(transmission: Transmission) -> Mesh:
    """Cut the path into segments: of equal length, or graded by curvature.

    Graded, every piece of the path starts with one segment and the others go, one by one, to the
    piece whose segments turn by the largest angle. A straight piece needs one segment only: there
    the tension does not change. With fewer segments than pieces the cut is uniform.
    """
    lengths, curvatures = transmission.piece_length_m, transmission.piece_curvature_per_m
    n = segments_of(transmission)
    return _cut(n, transmission.graded, tuple(lengths.tolist()), tuple(curvatures.tolist()))


@lru_cache(maxsize=_MESHES_KEPT)
def _cut(
    n: int, graded: bool, piece_length_m: tuple[float, ...], curvature_per_m: tuple[float, ...]
) -> Mesh:
    lengths, curvatures = np.array(piece_length_m), np.array(curvature_per_m)
    ends = np.concatenate(([0.0], np.cumsum(lengths)))
    if graded and n >= lengths.size:
        turned = lengths * curvatures + 1e-9 * lengths
        count = np.ones(lengths.size, dtype=np.int64)
        for _ in range(n - lengths.size):
            count[np.argmax(turned / count)] += 1
        place = np.concatenate(
            [[0.0]]
            + [ends[i] + lengths[i] * np.arange(1, k + 1) / k for i, k in enumerate(count.tolist())]
        )
    else:
        place = np.linspace(0.0, ends[-1], n + 1)
    angle_at_end = np.concatenate(([0.0], np.cumsum(lengths * curvatures)))
    wrap = np.maximum(np.diff(np.interp(place, ends, angle_at_end)), 0.0)
    mesh = Mesh(np.diff(place), wrap)
    for shared in (mesh.length_m, mesh.wrap_rad):
        shared.flags.writeable = False
    return mesh


def slide_exponents(transmission: Transmission, mesh: Mesh) -> FloatArray:
    """Return a = mu_d ds/R by cable and direction of motion, shape (2, 2, N)."""
    law = transmission.friction
    return slide_exponent(law.mu_d, law.direction_asymmetry, mesh.wrap_rad)


def breakaway_excesses(transmission: Transmission, mesh: Mesh) -> FloatArray:
    """Return what each segment holds at standstill beyond its sliding friction, shape (N,)."""
    law = transmission.friction
    lengths = mesh.length_m, mesh.wrap_rad
    return breakaway_excess(law.mu_s, law.mu_d, law.stiction_length_m, *lengths)


def tables(transmission: Transmission, varies: bool = False) -> Tables:
    """Compute the constants of the sliding zones for the pair's own friction coefficient."""
    law = transmission.friction
    mesh = cut(transmission)
    n = mesh.length_m.size
    exponent = slide_exponents(transmission, mesh)
    excess = breakaway_excesses(transmission, mesh)
    compliance = mesh.length_m / transmission.axial_stiffness_n

    mean = exponent[0].mean(axis=0)  # of both directions, and so of either cable
    half = sliding_weight(mean) * compliance
    virgin = np.stack([virgin_slope(mean, side) * compliance for side in (RELEASE, PULL)])

    decay = np.ones((2, 2, 2, n + 1))
    outer = np.zeros((2, 2, 2, n + 1))
    hold = np.empty((2, 2, 2, n))
    for end, order in enumerate(FROM_END):
        for motion in (RELEASE, PULL):
            towards_load = motion if end == 1 else 1 - motion
            a = exponent[:, towards_load, order]
            sign = 1.0 if motion == PULL else -1.0
            fall = decay[:, end, motion]
            fall[:, 1:] = np.exp(-sign * np.cumsum(a, axis=1))
            both = half[order] * (fall[:, :-1] + fall[:, 1:])
            outer[:, end, motion, 1:] = np.cumsum(both, axis=1)
            hold[:, end, motion] = np.exp(a + excess[order])
    return Tables(
        decay,
        outer,
        np.stack([half[order] for order in FROM_END]),
        np.stack([virgin[:, order] for order in FROM_END]),
        hold,
        transmission.pretension_n,
        NO_STRAIN * transmission.axial_stiffness_n,
        law.has_stiction,
        varies,
    )


def rest_state(transmission: Transmission) -> State:
    """Return both cables at standstill: uniform pretension, or the given initial profile."""
    mesh = cut(transmission)
    n = mesh.length_m.size
    virgin = np.array([[0, n], [0, n]], dtype=np.int64)
    node = np.full((2, n + 1), transmission.pretension_n)
    if transmission.initial_position_m is not None and transmission.initial_tension_n is not None:
        node[:] = np.interp(
            mesh.position_m, transmission.initial_position_m, transmission.initial_tension_n
        )
        virgin[:] = 0
    gap = np.where(node.max(axis=1) > 0, -1.0, 0.0)
    return State(
        node_n=node,
        end_n=np.ascontiguousarray(node[:, [0, n]]),
        depth=np.zeros((2, 2), dtype=np.int64),
        motion=np.full((2, 2), PULL, dtype=np.int64),
        virgin=virgin,
        gap_m=gap,
        rest_s=np.zeros((2, 2)),
        stiffness_n_per_m=np.zeros((2, 2)),
    )


def sliding_weight(a: FloatArray) -> FloatArray:
    """Return tanh(a/2)/a, 1/2 at a = 0."""
    small = a < 1e-4
    safe = np.where(small, 1.0, a)
    return np.where(small, 0.5 - a**2 / 24, np.tanh(safe / 2) / safe)


def virgin_slope(a: FloatArray, side: int) -> FloatArray:
    """Return the half-segment compliance, over ds/EA, of a segment that never slid.

    It joins the stretch T0 at (T0, T0) to the one of eq. (2) at (T0 exp(+-a), T0).
    """
    small = a < 1e-3
    safe = np.where(small, 1.0, a)
    if side == PULL:
        return np.where(small, 0.5 - a / 12, 1 / safe - 1 / np.expm1(safe))
    return np.where(small, 0.5 + a / 12, 1 / -np.expm1(-safe) - 1 / safe)
