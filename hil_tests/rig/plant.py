"""The rig's mechanics and its state: what `mechanics` moves, built from the parameters.

Reduces `parameters.Rig` to the constants of a step, refuses what would not be stable, and knows the
energy in the rig. Input: the actuators and the hand's intention, a control period at a time. Called
by `rig`; `scalars` (places named in `mechanics`) are what `sensors` and the bench's trace read.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil_tests.rig import mechanics as m
from hil_tests.rig import parameters

CONTROL_PERIOD_S: Final = 250e-6
GRAVITY_M_PER_S2: Final = 9.81


def largest_stable_step_s(cable: parameters.Cable, elements: int) -> float:
    """Bound of semi-implicit Euler on the chain's fastest axial mode, damping included.

    With omega = 2 c / dx and zeta = omega tau / 2 the step is stable below
    (2 / omega) (sqrt(1 + zeta^2) - zeta).
    """
    dx = cable.length_m / elements
    wave_speed = math.sqrt(cable.axial_stiffness_n / cable.mass_per_length_kg_per_m)
    omega = 2.0 * wave_speed / dx
    zeta = omega * cable.material_damping_s / 2.0
    return 2.0 / omega * (math.sqrt(1.0 + zeta * zeta) - zeta)


def constants(rig: parameters.Rig) -> m.Constants:
    """Reduce the parameters; ValueError where the step would not be stable."""
    cable, motor, load, hand = rig.cable, rig.motor, rig.load, rig.hand
    dt = CONTROL_PERIOD_S / rig.substeps
    limit = largest_stable_step_s(cable, rig.elements)
    if dt > 0.9 * limit:
        raise ValueError(
            f"rig.substeps: found {rig.substeps}; accepted: at least "
            f"{math.ceil(CONTROL_PERIOD_S / (0.9 * limit))} for {rig.elements} elements"
        )
    dx = cable.length_m / rig.elements
    stribeck = cable.stribeck_speed_m_per_s
    holds = {"free": m.HAND_FREE, "locked": m.HAND_LOCKED}
    return m.Constants(
        dt_s=dt,
        substeps=rig.substeps,
        mass_kg=cable.mass_per_length_kg_per_m * dx,
        spring_n_per_m=cable.axial_stiffness_n / dx,
        damper_n_s_per_m=cable.axial_stiffness_n / dx * cable.material_damping_s,
        bristle_n_per_m=cable.contact_stiffness_n_per_m2 * dx,
        weight_n=cable.mass_per_length_kg_per_m * dx * GRAVITY_M_PER_S2,
        pretension_n=cable.pretension_n,
        mu=cable.friction,
        mu_static_excess=cable.friction * (cable.static_ratio - 1.0) if stribeck > 0.0 else 0.0,
        stribeck_speed_m_per_s=stribeck if stribeck > 0.0 else 1.0,
        viscous_s_per_m=cable.viscous_s_per_m,
        asymmetry=cable.direction_asymmetry,
        motor_radius_m=motor.pulley_radius_m,
        eccentricity=motor.eccentricity,
        motor_inertia_kg_m2=motor.inertia_kg_m2,
        motor_bearing_nm=motor.bearing_friction_nm,
        motor_viscous_nm_s=motor.bearing_viscous_nm_s_per_rad,
        torque_nm_per_a=motor.torque_constant_nm_per_a * (1.0 + motor.torque_constant_error),
        amplifier_gain=-math.expm1(-2.0 * math.pi * motor.amplifier_bandwidth_hz * dt),
        current_limit_a=motor.current_limit_a,
        load_radius_m=load.pulley_radius_m,
        load_inertia_kg_m2=load.inertia_kg_m2,
        cell_inertia_kg_m2=load.cell_side_inertia_kg_m2,
        load_bearing_nm=load.bearing_friction_nm,
        hand=holds.get(hand.motion, m.HAND_ON),
        hand_stiffness_nm=hand.stiffness_nm_per_rad,
        hand_damping_nm_s=hand.damping_nm_s_per_rad,
    )


class Plant:
    """The rig's mechanics and its state.

    Parameters
    ----------
    rig : parameters.Rig
        ValueError where it cannot be simulated stably.
    """

    def __init__(self, rig: parameters.Rig) -> None:
        self.constants = constants(rig)
        dx = rig.cable.length_m / rig.elements
        self._wrap_rad = np.array(
            [rig.cable.wrap_angle_rad(i * dx, (i + 1) * dx) for i in range(rig.elements)]
        )
        self._masses = np.zeros((3, 2, rig.elements))
        self.position_m, self.speed_m_per_s, self.bristle_m = self._masses  # (2, elements) each
        self.scalars = np.zeros(m.SCALARS)
        self.scalars[m.MOTOR_TENSION_A : m.LOAD_TENSION_B + 1] = rig.cable.pretension_n

    def advance(
        self,
        reference_a: float,
        bridge_enabled: bool,
        hand_angle_rad: float,
        hand_speed_rad_per_s: float,
    ) -> None:
        """One control period with these actuators and this motion in the hand's mind."""
        m.advance(
            self.constants,
            self._wrap_rad,
            self._masses,
            self.scalars,
            reference_a,
            bridge_enabled,
            hand_angle_rad,
            hand_speed_rad_per_s,
        )

    def tension_n(self) -> NDArray[np.float64]:
        """Elastic tension of the springs, shape (2, elements + 1), from the motor to the load."""
        c, s = self.constants, self.scalars
        wound = m.wound(c, s[m.MOTOR_ANGLE])
        sign = np.array([[-1.0], [1.0]])
        points = np.hstack(
            [sign * wound, self.position_m, sign * c.load_radius_m * s[m.LOAD_ANGLE]]
        )
        spring = self._springs()
        tension: NDArray[np.float64] = np.maximum(
            c.pretension_n + spring * np.diff(points, axis=1), 0.0
        )
        return tension

    def stored_energy_j(self) -> float:
        """Kinetic energy, stretch of the cables and bent bristles."""
        c, s = self.constants, self.scalars
        kinetic = 0.5 * c.mass_kg * float(np.sum(self.speed_m_per_s**2))
        kinetic += 0.5 * c.motor_inertia_kg_m2 * s[m.MOTOR_SPEED] ** 2
        kinetic += 0.5 * c.load_inertia_kg_m2 * s[m.LOAD_SPEED] ** 2
        elastic = 0.5 * float(np.sum(self.tension_n() ** 2 / self._springs()))
        bent = 0.5 * c.bristle_n_per_m * float(np.sum(self.bristle_m**2))
        bent += 0.5 * c.motor_bearing_nm / m.BEARING_WINDUP_RAD * s[m.MOTOR_BRISTLE] ** 2
        bent += 0.5 * c.load_bearing_nm / m.BEARING_WINDUP_RAD * s[m.LOAD_BRISTLE] ** 2
        return float(kinetic + elastic + bent)

    def _springs(self) -> NDArray[np.float64]:
        spring = np.full(self.position_m.shape[1] + 1, self.constants.spring_n_per_m)
        spring[[0, -1]] *= 2.0
        return spring
