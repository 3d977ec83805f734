"""The rig's mechanics and its state: what `mechanics` moves, built from the parameters.

Holds the arrays that a step works on and knows the energy in the rig. Input: the actuators and the
intended motion, a control period at a time. Called by `rig`; `scalars` (places named in `state`)
are what `sensors` and the bench's trace read.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import mechanics, parameters
from bowden_rig.rig import state as at
from bowden_rig.rig.cable import BRISTLE, CREEP, POSITION, SPEED
from bowden_rig.rig.compiled import packed
from bowden_rig.rig.constants import constants


class Plant:
    """The rig's mechanics and its state.

    Parameters
    ----------
    rig : parameters.Rig
        ValueError where it cannot be simulated stably.

    Attributes
    ----------
    constants, packed_constants
        What a step needs, for people and for the kernels.
    wrap_rad, masses, springs, scalars : ndarray
        Wrap angle of each element and the state, as `mechanics.advance` takes them.
    """

    def __init__(self, rig: parameters.Rig) -> None:
        self.constants = constants(rig)
        self.packed_constants = packed(self.constants)
        dx = rig.cable.length_m / rig.elements
        extra_rad = rig.cable.extra_wrap_rad / rig.elements
        self.wrap_rad = np.array(
            [
                max(rig.cable.wrap_angle_rad(i * dx, (i + 1) * dx) + extra_rad, 0.0)
                for i in range(rig.elements)
            ]
        )
        self.masses = np.zeros((3, 2, rig.elements))
        self.springs = np.zeros((3, 2, rig.elements + 1))
        self.scalars = np.zeros(at.SCALARS)
        self.scalars[at.MOTOR_TENSION_A : at.LOAD_TENSION_B + 1] = rig.cable.pretension_n
        self.scalars[at.PRETENSION] = rig.cable.pretension_n
        self.scalars[at.FRICTION_FACTOR] = 1.0
        self.scalars[at.ASYMMETRY] = rig.cable.direction_asymmetry

    @property
    def position_m(self) -> NDArray[np.float64]:
        """Displacement of the masses from the pretensioned rest, shape (2, elements)."""
        position: NDArray[np.float64] = self.masses[POSITION]
        return position

    def advance(
        self,
        reference_a: float,
        bridge_enabled: bool,
        operator_angle_rad: float,
        operator_speed_rad_per_s: float,
    ) -> None:
        """One control period with these actuators and this intended motion of the operator."""
        mechanics.advance(
            self.packed_constants,
            self.wrap_rad,
            self.masses,
            self.springs,
            self.scalars,
            reference_a,
            bridge_enabled,
            operator_angle_rad,
            operator_speed_rad_per_s,
        )

    def tension_n(self) -> NDArray[np.float64]:
        """Elastic tension of the springs, shape (2, elements + 1), from the motor to the load."""
        c = self.constants
        elastic = self.scalars[at.PRETENSION] + self._springs() * self._stretch_m()
        if c.stiffening_per_n > 0.0:
            at_rest = 1.0 + c.stiffening_per_n * c.pretension_n
            grown = np.exp(c.stiffening_per_n * (elastic - c.pretension_n) / at_rest)
            elastic = (at_rest * grown - 1.0) / c.stiffening_per_n
        tension: NDArray[np.float64] = np.maximum(elastic, 0.0)
        return tension

    def stored_energy_j(self) -> float:
        """Kinetic energy, stretch and creep of the cables, bent bristles, pressed stop, height."""
        c, s = self.constants, self.scalars
        kinetic = 0.5 * c.mass_kg * float(np.sum(self.masses[SPEED] ** 2))
        kinetic += 0.5 * c.motor_inertia_kg_m2 * s[at.MOTOR_SPEED] ** 2
        kinetic += 0.5 * c.load_inertia_kg_m2 * s[at.LOAD_SPEED] ** 2
        tension, spring, beta = self.tension_n(), self._springs(), c.stiffening_per_n
        if beta > 0.0:  # the integral of T dx, with dx = (1 + beta T0) / (k (1 + beta T)) dT
            each = (
                (1.0 + beta * c.pretension_n)
                / beta**2
                * (beta * tension - np.log1p(beta * tension))
            )
        else:
            each = 0.5 * tension**2
        elastic = float(np.sum(each / spring))
        if c.creep > 0.0:
            creep = self.springs[CREEP]
            elastic += float(np.sum(0.5 * spring / c.creep * creep**2 + c.pretension_n * creep))
        bent = 0.5 * c.bristle_n_per_m * float(np.sum(self.masses[BRISTLE] ** 2))
        bent += 0.5 * c.motor_bearing_nm / mechanics.BEARING_WINDUP_RAD * s[at.MOTOR_BRISTLE] ** 2
        bent += 0.5 * c.load_bearing_nm / mechanics.BEARING_WINDUP_RAD * s[at.LOAD_BRISTLE] ** 2
        height = -c.gravity_nm * math.cos(s[at.LOAD_ANGLE] + c.gravity_phase_rad)
        return float(kinetic + elastic + bent + self._stop_energy_j() + height)

    def _stop_energy_j(self) -> float:
        c, s = self.constants, self.scalars
        if c.play_rad == 0.0:
            return 0.0
        lead = abs(s[at.PULLEY_ANGLE] - s[at.LOAD_ANGLE])
        pressed = 0.5 * mechanics.STOP_NM_PER_RAD * max(lead - 0.5 * c.play_rad, 0.0) ** 2
        return float(pressed + 0.5 * c.pulley_inertia_kg_m2 * s[at.PULLEY_SPEED] ** 2)

    def _stretch_m(self) -> NDArray[np.float64]:
        """How much longer than at the pretensioned rest each spring is, creep taken off."""
        c, s = self.constants, self.scalars
        far = s[at.PULLEY_ANGLE if c.play_rad > 0.0 else at.LOAD_ANGLE]
        near_m = mechanics.wound(
            c.motor_radius_m, c.eccentricity, c.eccentricity_phase_rad, s[at.MOTOR_ANGLE]
        )
        far_m = mechanics.wound(
            c.load_radius_m, c.load_eccentricity, c.load_eccentricity_phase_rad, far
        )
        sign = np.array([[-1.0], [1.0]])
        points = np.hstack([sign * near_m, self.position_m, sign * far_m])
        stretch: NDArray[np.float64] = np.diff(points, axis=1) - self.springs[CREEP]
        return stretch

    def _springs(self) -> NDArray[np.float64]:
        spring = np.full(self.springs.shape[1:], self.constants.spring_n_per_m)
        spring[:, [0, -1]] *= self.constants.end_spring
        return spring
