"""A controller closed over the model: the motor's torque follows from what the rig does.

`Tunnel` is eq. (7) of the paper, on a chosen angle; `PiFollower` the position
controller of Experiment 3. `simulate_closed_loop` steps the mesh with the controller in the loop
and returns a `Trajectory`; the operator prescribes the load angle.

A controller is asked for a line, torque less stiffness times the motor's motion within the sample,
and the mesh finds where that line meets the cables. So a stiff controller needs no motor inertia to
be stable, as it would with the torque of the sample before.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.mesh.solver import trajectory_of
from bowden.model.stepper import PairStepper
from bowden.model.trajectory import FloatArray, Inputs, Mode, Trajectory


class Controller(Protocol):
    """What `simulate_closed_loop` asks of a controller; its memory is one number."""

    def line(
        self, memory: float, dt_s: float, motor_rad: float, load_rad: float, ratio: float
    ) -> tuple[float, float]:
        """Return torque (N m) at the motor angle given and its fall with that angle (N m/rad).

        `load_rad` is the load angle at the end of the sample, `motor_rad` the motor angle at its
        start, `ratio` load over motor pulley radius.
        """

    def remember(
        self, memory: float, dt_s: float, motor_rad: float, load_rad: float, ratio: float
    ) -> float:
        """Return the memory after a sample that ended at these angles; 0 before the first."""


class Watched(Enum):
    """The angle that the tunnel depends on."""

    LOAD_ANGLE = "load angle"
    MOTOR_ANGLE = "motor angle"
    SCALED_MOTOR_ANGLE = "motor angle over the ratio of the pulleys"


@dataclass(frozen=True)
class Tunnel:
    """Eq. (7): no torque within a half width, beyond it a spring that stops at a limit.

    Parameters
    ----------
    watched : Watched
        The load angle by default; a rig without load encoder has the motor's.
    half_width_rad : float, rad, >= 0
    stiffness_nm_per_rad : float, N m/rad, >= 0
    limit_nm : float, N m, >= 0
    """

    watched: Watched = Watched.LOAD_ANGLE
    half_width_rad: float = 0.05
    stiffness_nm_per_rad: float = 0.5
    limit_nm: float = 0.2

    def torque_nm(self, angle_rad: float) -> tuple[float, float]:
        """Return the torque at an angle and how much it falls there per rad."""
        beyond = abs(angle_rad) - self.half_width_rad
        if beyond <= 0:
            return 0.0, 0.0
        pull = self.stiffness_nm_per_rad * beyond
        free = pull < self.limit_nm
        size = pull if free else self.limit_nm
        return float(-np.sign(angle_rad) * size), self.stiffness_nm_per_rad if free else 0.0

    def line(
        self, memory: float, dt_s: float, motor_rad: float, load_rad: float, ratio: float
    ) -> tuple[float, float]:
        """See `Controller`."""
        del memory, dt_s
        if self.watched is Watched.LOAD_ANGLE:
            return self.torque_nm(load_rad)[0], 0.0
        scale = ratio if self.watched is Watched.SCALED_MOTOR_ANGLE else 1.0
        torque, stiffness = self.torque_nm(motor_rad / scale)
        return torque, stiffness / scale

    def remember(
        self, memory: float, dt_s: float, motor_rad: float, load_rad: float, ratio: float
    ) -> float:
        """See `Controller`; a tunnel has no memory."""
        del dt_s, motor_rad, load_rad, ratio
        return memory


@dataclass(frozen=True)
class PiFollower:
    """``tau = kp e + ki integral(e dt)``, ``e = rho theta_l - theta_m`` (Experiment 3).

    Parameters
    ----------
    kp_nm_per_rad : float, N m/rad, > 0
    ki_nm_per_rad_s : float, N m/(rad s), >= 0
    """

    kp_nm_per_rad: float = 5.0
    ki_nm_per_rad_s: float = 10.0

    def __post_init__(self) -> None:
        kp, ki = self.kp_nm_per_rad, self.ki_nm_per_rad_s
        if not (0 < kp < np.inf and 0 <= ki < np.inf):
            raise ModelError(f"gains: found kp {kp:g}, ki {ki:g}, accepted: kp > 0, ki >= 0")

    def line(
        self, memory: float, dt_s: float, motor_rad: float, load_rad: float, ratio: float
    ) -> tuple[float, float]:
        """See `Controller`; the memory is the integral of the error, rad s."""
        stiffness = self.kp_nm_per_rad + self.ki_nm_per_rad_s * dt_s
        error = ratio * load_rad - motor_rad
        return stiffness * error + self.ki_nm_per_rad_s * memory, stiffness

    def remember(
        self, memory: float, dt_s: float, motor_rad: float, load_rad: float, ratio: float
    ) -> float:
        """See `Controller`."""
        return memory + dt_s * (ratio * load_rad - motor_rad)


def simulate_closed_loop(
    model: Model, controller: Controller, time_s: FloatArray, load_angle_rad: FloatArray
) -> Trajectory:
    """Simulate a virgin rig whose motor obeys a controller while an operator moves the load.

    Parameters
    ----------
    model : Model
        Solved on its mesh, whatever solver it names.
    controller : Controller
    time_s, load_angle_rad : ndarray of shape (n,), s and rad

    Returns
    -------
    Trajectory
        Its ``motor_torque_nm`` is what the controller applied.

    Raises
    ------
    ModelError
        A series that cannot be used, or a sample without equilibrium.
    """
    given = Inputs(time_s, motor_torque_nm=np.zeros_like(time_s), load_angle_rad=load_angle_rad)
    time_s, _, load = given.for_mode(Mode.TORQUE_POSITION)
    pair = model.transmission
    r_motor, r_load = pair.motor_pulley_radius_m, pair.load_pulley_radius_m
    ratio = r_load / r_motor
    stepper = PairStepper(model, doing="a closed loop")
    out = np.zeros((time_s.size, 6))
    motor_rad, memory = ratio * load[0], 0.0
    for i in range(time_s.size):
        dt = time_s[i] - time_s[i - 1] if i > 0 else 0.0
        torque, stiffness = controller.line(memory, dt, motor_rad, load[i], ratio)
        load_end = -r_load * (load[i] - load[i - 1]) if i > 0 else 0.0
        step_s = dt if i > 0 else time_s[1] - time_s[0]
        force, spring = torque / r_motor, stiffness / r_motor**2
        moved = stepper.step(force, spring, 0.0, load_end, step_s, out[i])
        motor_rad += moved / r_motor
        out[i, 0] = r_motor * (motor_rad - ratio * load[0])
        memory = controller.remember(memory, dt, motor_rad, load[i], ratio)
    return trajectory_of(pair, Mode.TORQUE_POSITION, time_s, np.zeros_like(load), load, out)
