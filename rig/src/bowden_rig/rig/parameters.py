"""What the simulated rig is made of: plain numbers, frozen, SI units.

Imports nothing of this package. `plant`, `operator` and `sensors` read it. The defaults are the
paper's Table I (EA 4000 N, L 2 m, R 0.28 m, T0 10 N, mu_d 0.21, 40 deg at 0.5 Hz) on a small
brushed motor.

Two choices make the rig independent of the offline model. Static friction equals dynamic friction
by default, as in a lined conduit; `static_ratio` with `stribeck_speed_m_per_s` makes it weaken with
speed. And sliding friction grows a little with speed (`viscous_s_per_m`): 1 % at 0.1 m/s.

Fields that are zero (or one, or infinite) by default are the rig's hidden truths: a test sets one
of them and checks the drive or the diagnosis. `hidden` maps them to the effects of the diagnosis'
catalogue; `changed` sets one by its name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Final, Literal


def _check(part: object, positive: tuple[str, ...]) -> None:
    """Refuse what no rig has: `positive` must be above 0, every other friction or noise not below.

    Errors, offsets and drifts may have either sign.
    """
    for name in positive:
        if not getattr(part, name) > 0.0:
            raise ValueError(f"{name}: found {getattr(part, name)}; accepted: above 0")
    for name, value in vars(part).items():
        signed = name in positive or any(word in name for word in SIGNED)
        if not signed and isinstance(value, int | float) and not value >= 0.0:
            raise ValueError(f"{name}: found {value}; accepted: 0 or above")


SIGNED = (
    *("error", "offset", "drift", "asymmetry", "eccentricity", "temperature"),
    *("change", "phase", "extra"),
)
OperatorMotion = Literal["still", "sine", "locked", "free"]


@dataclass(frozen=True)
class Cable:
    """Each of the two cables in its conduit.

    Parameters
    ----------
    path : tuple of (length_m, radius_m)
        Pieces of the conduit from the motor to the load; radius ``math.inf`` is straight.
    axial_stiffness_n : float, N
        EA.
    pretension_n : float, N
        Uniform at the start.
    mass_per_length_kg_per_m : float
        A 0.75 mm stranded steel cable has about 2.5 g/m.
    friction : float
        mu_d, of the sliding cable.
    static_ratio : float
        mu_s / mu_d, where `stribeck_speed_m_per_s` is positive.
    stribeck_speed_m_per_s : float
        mu(v) = mu_d (1 + (static_ratio - 1) exp(-(v / v_s)^2) + ...); 0 is without.
    viscous_s_per_m : float
        mu(v) = ... + viscous_s_per_m |v|, added to mu_d.
    direction_asymmetry : float
        mu (1 + a) while the cable moves as for positive angles, mu (1 - a) back.
    tension_exponent : float
        mu (T / T0)^-p.
    friction_lag_s : float
        A bristle is bent to its limit no faster than with this time constant.
    contact_stiffness_n_per_m2 : float
        Shear stiffness of liner and strands per length of conduit: friction builds up
        elastically before the cable slides, over mu T / (R times this): 5 um at 10 N on the
        default path. A soft one is presliding compliance.
    material_damping_s : float
        Kelvin-Voigt time of the strands; 10 us is 1 % of critical in the first axial mode.
    extra_wrap_rad : float
        Wrap beyond that of the path, spread evenly.
    conduit_stiffness_n_per_m : float
        Of each conduit, in series with its cable; half of its give is at each end.
    stiffening_per_n : float
        beta: the tangent of EA is EA (1 + beta T) / (1 + beta T0).
    stiffest_n : float
        Tension up to which a stiffening cable is simulated stably.
    creep, creep_time_s : float
        Standard linear solid: that share more of stretch, with that time constant.
    friction_change_per_k, warming_change_k, warming_time_s : float
        mu (1 + alpha (temperature - 20 degC)); the conduit warms by so much, exponentially.
    wear_change, wear_travel_m : float
        mu (1 + change (1 - exp(-travel / travel_m))).
    dwell_gain, dwell_time_s, dwell_slip_m : float
        mu (1 + gain q); q rises to 1 with rest and is rubbed off over a slip.
    place_gain, place_per_turn, place_phase_rad : float
        mu (1 + gain cos(k theta_l + phase)).
    bump_gain_change, bump_centre_offset_rad, bump_width_rad : float
        mu (1 + gain exp(-((theta_l - centre) / width)^2)).
    pile_change, pile_width_rad : float
        A liner whose pile leans: mu (1 + b) while the cable moves as for positive angles,
        mu (1 - b) back, with b = change tanh(theta_l / width). In no catalogue of effects.
    pretension_loss, pretension_loss_time_s : float
        T0 (1 - a ln(1 + t / tau)).
    """

    path: tuple[tuple[float, float], ...] = ((2.0, 0.28),)
    axial_stiffness_n: float = 4000.0
    pretension_n: float = 10.0
    mass_per_length_kg_per_m: float = 2.5e-3
    friction: float = 0.21
    static_ratio: float = 1.0
    stribeck_speed_m_per_s: float = 0.0
    viscous_s_per_m: float = 0.02
    direction_asymmetry: float = 0.0
    tension_exponent: float = 0.0
    friction_lag_s: float = 0.0
    contact_stiffness_n_per_m2: float = 1.5e6
    material_damping_s: float = 1.0e-5
    extra_wrap_rad: float = 0.0
    conduit_stiffness_n_per_m: float = math.inf
    stiffening_per_n: float = 0.0
    stiffest_n: float = 60.0
    creep: float = 0.0
    creep_time_s: float = 0.2
    friction_change_per_k: float = 0.0
    warming_change_k: float = 0.0
    warming_time_s: float = 30.0
    wear_change: float = 0.0
    wear_travel_m: float = 10.0
    dwell_gain: float = 0.0
    dwell_time_s: float = 1.0
    dwell_slip_m: float = 1.0e-3
    place_gain: float = 0.0
    place_per_turn: float = 1.0
    place_phase_rad: float = 0.0
    bump_gain_change: float = 0.0
    bump_centre_offset_rad: float = 0.0
    bump_width_rad: float = 0.1
    pile_change: float = 0.0
    pile_width_rad: float = 0.3
    pretension_loss: float = 0.0
    pretension_loss_time_s: float = 10.0

    def __post_init__(self) -> None:
        _check(
            self,
            positive=(
                "length_m",
                "axial_stiffness_n",
                "mass_per_length_kg_per_m",
                "contact_stiffness_n_per_m2",
                "conduit_stiffness_n_per_m",
                "creep_time_s",
                "warming_time_s",
                "wear_travel_m",
                "dwell_time_s",
                "dwell_slip_m",
                "bump_width_rad",
                "pile_width_rad",
                "pretension_loss_time_s",
            ),
        )
        if any(length <= 0.0 or radius <= 0.0 for length, radius in self.path):
            raise ValueError(f"path: found {self.path}; accepted: lengths and radii above 0")

    @property
    def length_m(self) -> float:
        """Length of the conduit in metres."""
        return sum(length for length, _ in self.path)

    def wrap_angle_rad(self, start_m: float, end_m: float) -> float:
        """Integral of ds/R from `start_m` to `end_m`."""
        total, at = 0.0, 0.0
        for length, radius in self.path:
            overlap = min(end_m, at + length) - max(start_m, at)
            total += max(overlap, 0.0) / radius
            at += length
        return total


@dataclass(frozen=True)
class Motor:
    """Motor, amplifier and proximal pulley.

    `torque_constant_error` g, `torque_offset_nm` b: the true torque is (1 + g) times what the drive
    assumes, plus b while the bridge is on, plus cogging A cos(k theta + phase).
    `eccentricity` e: the pulley's radius is r (1 + e sin(theta + phase)).
    """

    pulley_radius_m: float = 0.020
    inertia_kg_m2: float = 3.0e-5
    torque_constant_nm_per_a: float = 0.060
    torque_constant_error: float = 0.0
    amplifier_bandwidth_hz: float = 1000.0
    current_limit_a: float = 12.0
    bearing_friction_nm: float = 0.0
    bearing_viscous_nm_s_per_rad: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase_rad: float = 0.0
    torque_offset_nm: float = 0.0
    cogging_nm: float = 0.0
    cogging_per_turn: int = 12
    cogging_phase_rad: float = 0.0

    def __post_init__(self) -> None:
        _check(self, positive=("pulley_radius_m", "inertia_kg_m2", "amplifier_bandwidth_hz"))


@dataclass(frozen=True)
class Load:
    """Distal pulley and handle.

    `cell_side_inertia_kg_m2` J and `gravity_nm` G sit between cables and load cell, which reads
    tau_l - J alpha - G sin(theta_l + phase). With `play_rad` the pulley, of `pulley_inertia_kg_m2`,
    turns so far in all before it takes the handle along; the load encoder is on the handle.
    """

    pulley_radius_m: float = 0.104
    inertia_kg_m2: float = 5.0e-3
    cell_side_inertia_kg_m2: float = 0.0
    bearing_friction_nm: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase_rad: float = 0.0
    gravity_nm: float = 0.0
    gravity_phase_rad: float = 0.0
    play_rad: float = 0.0
    pulley_inertia_kg_m2: float = 1.0e-4

    def __post_init__(self) -> None:
        _check(self, positive=("pulley_radius_m", "inertia_kg_m2", "pulley_inertia_kg_m2"))


@dataclass(frozen=True)
class Operator:
    """The operator at the handle: a spring and damper towards the intended motion.

    The transmission resists with 3 to 5 N m: to reach 40 deg, the operator aims `overreach_rad`
    beyond. Motion `still` holds the handle at zero, `locked` bolts it (Experiment 1),
    `free` releases it. `second_share` of a `sine` is a second one at 0.618 of the frequency: no
    two strokes are alike then, as an operator's are not.
    """

    motion: OperatorMotion = "sine"
    amplitude_rad: float = math.radians(40.0)
    frequency_hz: float = 0.5
    second_share: float = 0.0
    overreach_rad: float = math.radians(1.6)
    ramp_s: float = 1.0
    stiffness_nm_per_rad: float = 200.0
    damping_nm_s_per_rad: float = 2.0
    starts: Literal["on-enable", "now"] = "on-enable"

    def __post_init__(self) -> None:
        _check(self, positive=("ramp_s",))


@dataclass(frozen=True)
class Sensing:
    """Encoders, load cell, current sense and what the board says of them.

    A true value x is read as ``x (1 + gain_error) + offset + drift t``. Delays are whole control
    periods. Eccentricity e: an encoder reads theta + e sin(theta + phase). The load cell's
    hysteresis is play of that width: its reading follows where the play is used up.
    """

    motor_counts_per_turn: int = 2000
    load_counts_per_turn: int = 10000
    encoder_eccentricity_rad: float = 0.0
    encoder_eccentricity_phase_rad: float = 0.0
    load_encoder_eccentricity_rad: float = 0.0
    load_encoder_eccentricity_phase_rad: float = 0.0
    motor_encoder_offset_rad: float = 0.0
    load_encoder_offset_rad: float = 0.0
    load_cell_nm_per_count: float = 200e-6
    load_cell_noise_nm: float = 0.5e-3
    load_cell_gain_error: float = 0.0
    load_cell_offset_nm: float = 0.0
    load_cell_drift_nm_per_s: float = 0.0
    load_cell_hysteresis_nm: float = 0.0
    load_cell_full_scale_nm: float = 25.0
    current_a_per_count: float = 1.0e-3
    current_noise_a: float = 1.0e-3
    motor_encoder_delay_ticks: int = 0
    load_encoder_delay_ticks: int = 0
    load_cell_delay_ticks: int = 0
    motor_current_delay_ticks: int = 0
    bus_voltage_v: float = 24.0
    conduit_temperature_c: float = 25.0

    def __post_init__(self) -> None:
        _check(
            self,
            positive=(
                "motor_counts_per_turn",
                "load_counts_per_turn",
                "load_cell_nm_per_count",
                "load_cell_full_scale_nm",
                "current_a_per_count",
            ),
        )


@dataclass(frozen=True)
class Rig:
    """The whole rig, and how finely it is simulated.

    Parameters
    ----------
    elements : int
        Masses a cable.
    substeps : int
        Integration steps in one control period; `plant` checks that they are stable.
    """

    cable: Cable = field(default_factory=Cable)
    motor: Motor = field(default_factory=Motor)
    load: Load = field(default_factory=Load)
    operator: Operator = field(default_factory=Operator)
    sensing: Sensing = field(default_factory=Sensing)
    elements: int = 32
    substeps: int = 12

    def __post_init__(self) -> None:
        _check(self, positive=("elements", "substeps"))


#: Names of version 0.2 that are still read.
DEPRECATED_PARTS: Final = {"hand": "operator"}


def changed(rig: Rig, assignment: str) -> Rig:
    """Rig with one number changed, for example by ``"cable.viscous_s_per_m=0.3"``.

    Raises ValueError that says what would have been accepted.
    """
    name, _, text = assignment.partition("=")
    part_name, _, field_name = name.partition(".")
    part_name = DEPRECATED_PARTS.get(part_name, part_name)
    parts = {f.name for f in fields(rig) if not isinstance(f.default, int)}
    if part_name not in parts:
        raise ValueError(
            f"rig: found {assignment!r}; accepted: {', '.join(sorted(parts))}, then .FIELD=VALUE"
        )
    part = getattr(rig, part_name)
    numbers = {
        f.name: type(getattr(part, f.name))
        for f in fields(part)
        if isinstance(getattr(part, f.name), int | float)
    }
    if field_name not in numbers:
        raise ValueError(
            f"rig.{part_name}: found {field_name!r}; accepted: {', '.join(sorted(numbers))}"
        )
    try:
        value = numbers[field_name](text)
    except ValueError:
        raise ValueError(f"rig.{name}: found {text!r}; accepted: a number") from None
    if not math.isfinite(value):
        raise ValueError(f"rig.{name}: found {text!r}; accepted: a finite number")
    return replace(rig, **{part_name: replace(part, **{field_name: value})})
