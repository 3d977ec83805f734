"""The pull-pull pair in the continuum, quasi-static: motor torque and load angle in, answers out.

The truth behind the hidden-effect recordings; `pair_motion` solves it, sample by sample.
Independent of `bowden.model`: other unknowns (tension profiles on a fine graded grid), another
method (shooting). Signs as in the contracts: theta_m > 0 winds cable a, theta_l > 0 is the motion
that cable a produces, tau_m = r_in (T1a - T1b) by the motor, tau_l = r_load (TLa - TLb) by the
cables.

Effects inside the mechanics are fields of `Pair` and `Histories`; those of sensors and actuators
are in `effects`, which maps recorded quantities to the true ones that come in here and back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.cable_march import Path
from hil_tests.hidden_effects.pair_motion import Ends, run

Vector = NDArray[np.float64]

CELLS = 300
STRETCH_TOLERANCE_M = 2e-5
GRIDS = (1.0, 0.93, 1.07, 0.86)  # tried in turn where shooting misses a step


@dataclass(frozen=True)
class Pair:
    """The true pair: conduit pieces (length_m, radius_m), mu, the laws of cable and ends."""

    pieces: tuple[tuple[float, float], ...]
    mu: float
    law: Law
    ends: Ends
    extra_wrap_rad: float = 0.0

    @property
    def length_m(self) -> float:
        """Length of each cable."""
        return sum(length for length, _ in self.pieces)

    @property
    def wrap_rad(self) -> float:
        """Wrap angle of the whole path."""
        return sum(length / radius for length, radius in self.pieces) + self.extra_wrap_rad

    def path(self, cells: int = CELLS) -> Path:
        """Cells of the cable, finer towards both ends where reversals start."""
        turn = np.linspace(-1.0, 1.0, cells + 1)
        graded = 0.5 + 0.5 * (0.85 * np.sin(0.5 * np.pi * turn) + 0.15 * turn)
        corners = np.cumsum([0.0] + [length for length, _ in self.pieces])
        nodes = np.unique(np.concatenate([graded * self.length_m, corners]))
        nodes = nodes[np.concatenate([[True], np.diff(nodes) > 1e-9])]
        nodes[-1] = self.length_m
        bend = np.concatenate([[0.0], np.cumsum([length / r for length, r in self.pieces])])
        wrap = np.diff(np.interp(nodes, corners, bend))
        wrap *= self.wrap_rad / wrap.sum()
        breakaway = self.law.breakaway_m * wrap / np.diff(nodes)
        return Path(np.diff(nodes), self.mu * wrap, breakaway)


@dataclass(frozen=True)
class Histories:
    """What changes with time, a value a sample, or None.

    `friction_plus`, `friction_minus`: factor on mu while the pair moves towards positive angle and
    back; `extra_length_m`: by how much each cable's rest length has grown.
    """

    friction_plus: Vector | None = None
    friction_minus: Vector | None = None
    extra_length_m: Vector | None = None


@dataclass(frozen=True)
class Answer:
    """What the true pair does, a value a sample; tensions are (n, 4): motor a, b, load a, b."""

    motor_angle_rad: Vector
    load_torque_nm: Vector
    tensions_n: NDArray[np.float64]
    pulley_angle_rad: Vector


def solve(  # noqa: PLR0917  (the three columns belong together, in this order)
    pair: Pair,
    time_s: Vector,
    motor_torque_nm: Vector,
    load_angle_rad: Vector,
    histories: Histories | None = None,
    cells: int = CELLS,
    oversample: int = 1,
) -> Answer:
    """Run the pair from standstill at angle 0 through the true motor torque and handle angle.

    Parameters
    ----------
    pair : Pair
    time_s, motor_torque_nm, load_angle_rad : ndarray, shape (n_samples,)
        The first sample is the virgin rig at load angle 0; a torque there acts at once.
    histories : Histories, optional
    cells : int
        Of the grid along each cable.
    oversample : int
        Steps a sample, straight lines between: for inertia.

    Raises
    ------
    ArithmeticError
        The cables' profiles are not found, or friction would both bend and lag: it has one memory.
        Or it would hold more at standstill besides, which it never quite comes to.
    """
    if sum(x > 0.0 for x in (pair.law.slip_m, pair.law.lag_s, pair.law.breakaway_m)) > 1:
        raise ArithmeticError("friction can bend before it slides, lag, or break away: one of them")
    h = histories or Histories()
    n = time_s.size
    one, zero = np.ones(n), np.zeros(n)
    columns = [
        np.asarray(x, dtype=np.float64)
        for x in (
            time_s,
            motor_torque_nm,
            load_angle_rad,
            one if h.friction_plus is None else h.friction_plus,
            one if h.friction_minus is None else h.friction_minus,
            zero if h.extra_length_m is None else h.extra_length_m,
        )
    ]
    if oversample > 1:
        at = np.arange((n - 1) * oversample + 1) / oversample
        columns = [np.interp(at, np.arange(n), x) for x in columns]
    out = np.empty((columns[0].size, 8))
    worst = np.inf
    for grid in GRIDS:
        run(pair.law, pair.ends, pair.path(round(cells * grid)), tuple(columns), out)
        worst = float(np.abs(out[:, 7]).max())
        if worst < STRETCH_TOLERANCE_M:
            break
    else:
        raise ArithmeticError(f"a cable's profile and its stretch differ by {worst:.2g} m")
    out = out[::oversample]
    return Answer(out[:, 0].copy(), out[:, 1].copy(), out[:, 2:6].copy(), out[:, 6].copy())
