"""The lumped transmission of Kaneko et al.: masses, springs and dampers that rub in the conduit.

An alternative to the quasi-static solvers, with inertia and with friction laws that have a state
of their own (`bowden.model.friction`). Imports the numbers of the pair and the answer's type; the
arithmetic is in `lumped_chain`. Slow motion tends to the mesh-free answer.

Equation (Kaneko et al. 1991, 1992, as retold by their successors; the articles themselves were not
to be had), for each of N masses of a cable:

    m x_i'' = k (x_(i-1) - 2 x_i + x_(i+1)) + c (x'_(i-1) - 2 x'_i + x'_(i+1)) - f_i
    |f_i| <= mu T_i dtheta

Here the friction of an element is the capstan's over its wrap, so that the pair of end tensions is
right at any N, half springs lie at both ends of a cable, so that its whole compliance is L/EA, a
cable carries no pressure, and each element has its own curvature.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bowden.model.errors import ModelError
from bowden.model.friction.bouc_wen import BoucWen
from bowden.model.friction.dahl import Dahl
from bowden.model.friction.lugre import LuGre
from bowden.model.lumped_chain import BOUC_WEN, DAHL, LUGRE, Chain, run_chain
from bowden.model.trajectory import SLACK_A, SLACK_B, FloatArray, Mode, Trajectory
from bowden.model.transmission import Transmission

LAW_CODES = {Dahl: DAHL, LuGre: LUGRE, BoucWen: BOUC_WEN}
COULOMB = Dahl(presliding_m=1e-7, exponent=0.0)


@dataclass(frozen=True)
class Lumped:
    """What the lumped transmission has beyond the numbers of the pair.

    Parameters
    ----------
    elements : int, >= 1
        Masses in each cable.
    cable_mass_kg_per_m : float, kg/m, > 0
        0.0022 for a 0.75 mm steel cable.
    damping_s : float, s, >= 0
        Internal damping of the cable over its stiffness (c/k).
    motor_inertia_kg_m2 : float, kg m^2, >= 0
        Of motor and pulley, felt in torque-position mode. In the two other modes the motor's motion
        is given; a load torque is that of the cables, so the load's inertia is not theirs.
    law : Dahl, LuGre or BoucWen
        By default Coulomb, over a presliding length of 0.1 micrometre.
    """

    elements: int = 20
    cable_mass_kg_per_m: float = 0.0022
    damping_s: float = 1e-4
    motor_inertia_kg_m2: float = 0.0
    law: Dahl | LuGre | BoucWen = field(default=COULOMB)

    def __post_init__(self) -> None:
        checks = [
            ("elements", self.elements, self.elements >= 1, ">= 1"),
            ("cable_mass_kg_per_m", self.cable_mass_kg_per_m, self.cable_mass_kg_per_m > 0, "> 0"),
            ("damping_s", self.damping_s, self.damping_s >= 0, ">= 0"),
            (
                "motor_inertia_kg_m2",
                self.motor_inertia_kg_m2,
                self.motor_inertia_kg_m2 >= 0,
                ">= 0",
            ),
        ]
        problems = [
            f"{name}: found {value}, accepted: {accepted}"
            for name, value, is_good, accepted in checks
            if not (is_good and np.isfinite(value))
        ]
        if problems:
            raise ModelError(problems)


def simulate_lumped(  # noqa: PLR0917  (mode and series as for the other solvers)
    transmission: Transmission,
    lumped: Lumped,
    mode: Mode,
    time_s: FloatArray,
    first: FloatArray,
    second: FloatArray,
) -> Trajectory:
    """Run a pair with inertia through a series of two given end quantities.

    Parameters
    ----------
    transmission : Transmission
        Of the friction law only ``mu_d`` is read: it sets Fc, the law in `lumped` the rest.
    lumped : Lumped
    mode : Mode
    time_s : ndarray of shape (n,), s
        Increasing; one implicit step a sample, more where Newton's method asks for them.
    first, second : ndarray of shape (n,), N m or rad
        The motor's and the load's given series.

    Returns
    -------
    Trajectory
        At the first sample everything is at standstill under the pretension, and a free pulley
        stands where the ratio of the pulleys puts it.

    Raises
    ------
    ModelError
        An initial profile that is not uniform, or no convergence in some sample.
    """
    if transmission.initial_tension_n is not None:
        raise ModelError("initial tension: the lumped transmission accepts a uniform pretension")
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    from_load = mode is not Mode.POSITION_TORQUE  # the chain starts and ends at the given pulley
    nothing = np.zeros(len(time_s))
    inertia = 0.0
    if mode is Mode.TORQUE_POSITION:
        end, middle, push = r_load * (second - second[0]), nothing, first / r_motor
        inertia = lumped.motor_inertia_kg_m2 / r_motor**2
    elif mode is Mode.POSITION_TORQUE:
        end, middle, push = -r_motor * (first - first[0]), nothing, second / r_load
    else:
        end, middle = r_load * (second - second[0]), r_motor * (first - first[0])
        push = nothing
    chain = _chain(transmission, lumped, from_load, inertia)
    out = np.zeros((5, len(time_s)))
    held = mode is Mode.POSITION_POSITION
    law = LAW_CODES[type(lumped.law)]
    time = np.ascontiguousarray(time_s, dtype=np.float64)
    done = run_chain(chain, law, time, end, middle, push, held, lumped.damping_s, out)
    if done < len(time_s) or not np.all(np.isfinite(out)):
        raise ModelError(f"lumped transmission: no convergence in sample {done}")

    given_a, pulley_a, pulley_b, given_b = out[1:]
    # a slack cable still feels its own inertia: it is slack by its length, not by its tension
    rest = transmission.pretension_n * transmission.length_m / transmission.axial_stiffness_n
    slack = SLACK_A * (rest + out[0] - end <= 0) | SLACK_B * (rest - out[0] + end <= 0)
    motor_a, load_a, motor_b, load_b = pulley_a, given_a, pulley_b, given_b
    if not from_load:
        motor_a, load_a, motor_b, load_b = given_a, pulley_a, given_b, pulley_b
    motor_angle, load_angle = first, second
    motor_torque, load_torque = r_motor * (motor_a - motor_b), r_load * (load_a - load_b)
    if mode is Mode.TORQUE_POSITION:
        motor_angle, motor_torque = (r_load * second[0] + out[0]) / r_motor, first
    elif mode is Mode.POSITION_TORQUE:
        load_angle, load_torque = (r_motor * first[0] - out[0]) / r_load, second
    return Trajectory(
        time_s=time_s,
        motor_angle_rad=motor_angle,
        load_angle_rad=load_angle,
        motor_torque_nm=motor_torque,
        load_torque_nm=load_torque,
        motor_tension_a_n=motor_a,
        load_tension_a_n=load_a,
        motor_tension_b_n=motor_b,
        load_tension_b_n=load_b,
        slack=slack.astype(np.uint8),
    )


def _chain(
    transmission: Transmission, lumped: Lumped, from_load: bool, pulley_mass_kg: float
) -> Chain:
    n = lumped.elements
    edges = np.concatenate(([0.0], np.cumsum(transmission.piece_length_m)))
    turned = np.concatenate(
        ([0.0], np.cumsum(transmission.piece_length_m * transmission.piece_curvature_per_m))
    )
    borders = np.linspace(0.0, edges[-1], n + 1)
    wrap = transmission.friction.mu_d * np.diff(np.interp(borders, edges, turned))
    wrap_b = wrap  # from the motor on
    wrap_a = wrap[::-1]
    if not from_load:
        wrap_a, wrap_b = wrap_b, wrap_a
    element = transmission.length_m / n
    stiffness = np.full(n + 1, transmission.axial_stiffness_n / element)
    stiffness[[0, -1]] *= 2.0
    stiffness = np.concatenate((stiffness, stiffness))
    mass = np.full(2 * n + 1, lumped.cable_mass_kg_per_m * element)
    mass[n] = pulley_mass_kg
    way = np.ones(2 * n + 1)
    way[: n if from_load else 0] = -1.0
    if not from_load:
        way[n:] = -1.0
    nodes, springs = 2 * n + 1, 2 * n + 2
    return Chain(
        mass_kg=mass,
        grip=np.concatenate((np.tanh(0.5 * wrap_a), [0.0], np.tanh(0.5 * wrap_b))),
        towards_load=way,
        stiffness_n_per_m=stiffness,
        rest_stretch_m=transmission.pretension_n / stiffness,
        x=np.zeros(nodes),
        v=np.zeros(nodes),
        zeta=np.zeros(nodes),
        tension=np.full(springs, transmission.pretension_n),
        trial=np.zeros(nodes),
        correction=np.zeros(nodes),
        residual=np.zeros(nodes),
        lower=np.zeros(nodes),
        diagonal=np.zeros(nodes),
        upper=np.zeros(nodes),
        slope=np.zeros(springs),
        numbers=lumped.law.numbers,
    )
