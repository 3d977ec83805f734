"""The numbers of one pull-pull pair, as the solvers read them: SI units, no files, no defaults.

`description` builds a `Transmission` from the model file; `mesh`, `mesh_free`, `lumped` solve it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.model.errors import ModelError

FloatArray = NDArray[np.float64]

BEARINGS = (
    "motor_bearing_nm",
    "load_bearing_nm",
    "motor_bearing_nm_s_per_rad",
    "load_bearing_nm_s_per_rad",
)


@dataclass(frozen=True)
class FrictionLaw:
    """Friction between cable and conduit: the coefficient as a function of state.

    A segment that slides with local speed ``v`` under tension ``T`` has

        mu = (mu_d (1 + stribeck_gain exp(-(v/stribeck_speed)^2)) + mu_v |v|)
             * (1 +- direction_asymmetry) * (T / pretension)^(-tension_exponent)

    and a segment at standstill breaks away at ``mu_s`` (eq. (6) of the paper, by state). Each term
    has its equation, source and limit in `bowden.model.friction`.

    Parameters
    ----------
    mu_d, mu_s : float, >= 0
        Coulomb and breakaway coefficients, ``mu_s >= mu_d``.
    stiction_length_m : float or None, m, > 0
        Length over which the excess ``mu_s - mu_d`` acts at a front, whatever the mesh: a front
        segment breaks away at a wrap of ``mu_d ds/R + (mu_s - mu_d) stiction_length_m / R``.
        None is the paper's choice, the length of the segment itself (then stiction depends on N).
    mu_v_s_per_m : float, s/m, >= 0
        Viscous term.
    stribeck_gain : float, >= 0
    stribeck_speed_m_per_s : float, m/s, > 0
    tension_exponent : float, -1 < p < 1
        ``mu ~ (T/T0)^-p``.
    direction_asymmetry : float, -1 < a < 1
        ``mu (1 + a)`` while the pair moves towards positive angle, ``mu (1 - a)`` back.
    memory_s : float, s, >= 0
        Time constant of the low-pass filter on the speed of the Stribeck term.
    memory_is_of_friction : bool
        The filter is on the term itself: friction follows speed late (Hess and Soom 1990).
    ageing_gain : float, >= 0
        Rise of mu by a factor of e in the age of contacts, see `bowden.model.friction.ageing`.
    ageing_s : float, s, > 0
        Age from which it counts.
    ageing_m : float, m, > 0
        Slip that renews contacts.
    presliding_m : float, m, >= 0
        Slip over which friction builds up before a segment slides.
    presliding_is_rounded : bool
        It nears its limit by a share 1 - e^(-slip/presliding_m), as Dahl's law with i = 1 has it
        (`bowden.model.friction.dahl`), in place of rising in proportion until the segment slides.
    presliding_keeps_share : bool
        What it keeps as tensions change is its share of the limit, not its force.
    lag_s : float, s, >= 0
        Time constant with which friction approaches what its law says.
    lag_slow_m_per_s : float, m/s, >= 0
        At this sliding speed the lag is twice as long; slower, friction needs a way and no time.
    """

    mu_d: float
    mu_s: float
    stiction_length_m: float | None = None
    mu_v_s_per_m: float = 0.0
    stribeck_gain: float = 0.0
    stribeck_speed_m_per_s: float = 0.01
    tension_exponent: float = 0.0
    direction_asymmetry: float = 0.0
    memory_s: float = 0.015
    memory_is_of_friction: bool = False
    ageing_gain: float = 0.0
    ageing_s: float = 0.1
    ageing_m: float = 5e-4
    presliding_m: float = 0.0
    presliding_is_rounded: bool = False
    presliding_keeps_share: bool = False
    lag_s: float = 0.0
    lag_slow_m_per_s: float = 0.0

    @property
    def has_stiction(self) -> bool:
        """Return whether a segment at standstill holds more than a sliding one."""
        return self.mu_s > self.mu_d

    @property
    def is_rate_independent(self) -> bool:
        """Return whether time scaling leaves the answer as it is."""
        timeless = self.mu_v_s_per_m == 0.0 and self.stribeck_gain == 0.0 and self.lag_s == 0.0
        return timeless and self.ageing_gain == 0.0

    @property
    def is_coulomb(self) -> bool:
        """Return whether sliding obeys one constant coefficient, so that the capstan law holds."""
        plain = self.tension_exponent == 0.0 and self.presliding_m == 0.0
        return self.is_rate_independent and plain


@dataclass(frozen=True, eq=False)
class Transmission:
    """One pull-pull pair: two equal cables, a motor pulley and a load pulley.

    Parameters
    ----------
    axial_stiffness_n : float, N, > 0
        EA of one cable (the ``K_c`` of eqs. (2) and (3)).
    piece_length_m : ndarray of shape (n_pieces,), m, > 0
        The path of both conduits, from the motor (s = 0) to the load (s = L).
    piece_curvature_per_m : ndarray of shape (n_pieces,), 1/m, >= 0
        1/R of each piece; exactly 0 is straight.
    pretension_n : float, N, >= 0
        Uniform tension of both cables at the first sample.
    motor_pulley_radius_m, load_pulley_radius_m : float, m, > 0
    friction : FrictionLaw
    segments : int or None
        Mesh: number of segments a cable. None lets the mesh-free solver take it where it can.
    graded : bool
        Segments of equal wrap within each piece of the path, in place of equal length.
    rest_time_s : float, s, >= 0
        With stiction: how long an end must be at standstill until its cable sticks again.
    velocity_dead_band_m_per_s : float, m/s, >= 0
        Speed of a cable end below which it counts as at standstill.
    initial_position_m, initial_tension_n : ndarray of shape (n_points,) or None, m and N
        Initial tension profile of both cables in place of the uniform pretension: linear between
        the points; positions rise from 0 to L.
    stiffening : float, 0 <= g < 1
        Share of the tangent stiffness that depends on tension: EA sqrt(1 - g + g T/T0).
    creep_share : float, >= 0
        Compliance that follows with a delay, over the one that follows at once.
    creep_time_s : float, s, > 0
        Time constant of that delay, at constant tension.
    motor_inertia_kg_m2 : float, kg m2, >= 0
        Of the motor and its pulley; counts with the motor's torque given.
    damping_s : float, s, >= 0
        Of the cables' strands: their tension feels the strain that will be so much later. Counts
        with the motor's inertia, where it ends ringing. Wire ropes lose some per cent of critical.
    motor_bearing_nm, load_bearing_nm : float, N m, >= 0
        Dry friction between a torque that is given and its pulley.
    motor_bearing_nm_s_per_rad, load_bearing_nm_s_per_rad : float, N m s/rad, >= 0
        Viscous friction there.
    load_play_rad : float, rad, >= 0
        Play between the load's pulley and the handle, from contact to contact.
    """

    axial_stiffness_n: float
    piece_length_m: FloatArray
    piece_curvature_per_m: FloatArray
    pretension_n: float
    motor_pulley_radius_m: float
    load_pulley_radius_m: float
    friction: FrictionLaw
    segments: int | None = None
    graded: bool = False
    rest_time_s: float = 0.02
    velocity_dead_band_m_per_s: float = 1e-6
    initial_position_m: FloatArray | None = None
    initial_tension_n: FloatArray | None = None
    stiffening: float = 0.0
    creep_share: float = 0.0
    creep_time_s: float = 1.0
    motor_inertia_kg_m2: float = 0.0
    damping_s: float = 3e-4
    motor_bearing_nm: float = 0.0
    load_bearing_nm: float = 0.0
    motor_bearing_nm_s_per_rad: float = 0.0
    load_bearing_nm_s_per_rad: float = 0.0
    load_play_rad: float = 0.0

    @property
    def pulley_ratio(self) -> float:
        """Load pulley's radius over the motor's, 5.2 with Table I."""
        return self.load_pulley_radius_m / self.motor_pulley_radius_m

    def __post_init__(self) -> None:
        problems = [
            f"{name}: found {value}, accepted: {accepted}"
            for name, value, ok, accepted in self._checks()
            if not ok
        ]
        if problems:
            raise ModelError(problems)

    def _checks(self) -> list[tuple[str, object, bool, str]]:
        law = self.friction
        radii = (self.motor_pulley_radius_m, self.load_pulley_radius_m)
        lengths, curvatures = self.piece_length_m, self.piece_curvature_per_m
        return [
            ("axial_stiffness_n", self.axial_stiffness_n, _positive(self.axial_stiffness_n), "> 0"),
            ("pulley radius", radii, all(_positive(r) for r in radii), "> 0"),
            ("pretension_n", self.pretension_n, 0 <= self.pretension_n < np.inf, ">= 0"),
            (
                "path",
                f"{lengths.tolist()} m, {curvatures.tolist()} 1/m",
                lengths.shape == curvatures.shape
                and lengths.size > 0
                and bool(np.all((lengths > 0) & np.isfinite(lengths)))
                and bool(np.all((curvatures >= 0) & np.isfinite(curvatures))),
                "pieces with length > 0 and radius > 0",
            ),
            ("mu_d", law.mu_d, 0 <= law.mu_d < np.inf, ">= 0"),
            ("mu_s", law.mu_s, law.mu_d <= law.mu_s < np.inf, f">= mu_d = {law.mu_d}"),
            (
                "stiction_length_m",
                law.stiction_length_m,
                law.stiction_length_m is None or _positive(law.stiction_length_m),
                "> 0",
            ),
            ("mu_v_s_per_m", law.mu_v_s_per_m, 0 <= law.mu_v_s_per_m < np.inf, ">= 0"),
            ("stribeck_gain", law.stribeck_gain, 0 <= law.stribeck_gain < np.inf, ">= 0"),
            (
                "stribeck_speed_m_per_s",
                law.stribeck_speed_m_per_s,
                _positive(law.stribeck_speed_m_per_s),
                "> 0",
            ),
            ("tension_exponent", law.tension_exponent, -1 < law.tension_exponent < 1, "-1 .. 1"),
            (
                "direction_asymmetry",
                law.direction_asymmetry,
                -1 < law.direction_asymmetry < 1,
                "-1 .. 1",
            ),
            ("memory_s", law.memory_s, 0 <= law.memory_s < np.inf, ">= 0"),
            ("ageing_gain", law.ageing_gain, 0 <= law.ageing_gain < np.inf, ">= 0"),
            ("ageing_s", law.ageing_s, 0 < law.ageing_s < np.inf, "above 0"),
            ("ageing_m", law.ageing_m, 0 < law.ageing_m < np.inf, "above 0"),
            ("presliding_m", law.presliding_m, 0 <= law.presliding_m < np.inf, ">= 0"),
            ("lag_s", law.lag_s, 0 <= law.lag_s < np.inf, ">= 0"),
            (
                "lag_slow_m_per_s",
                law.lag_slow_m_per_s,
                0 <= law.lag_slow_m_per_s < np.inf,
                ">= 0",
            ),
            (
                "motor_inertia_kg_m2",
                self.motor_inertia_kg_m2,
                0 <= self.motor_inertia_kg_m2 < np.inf,
                ">= 0",
            ),
            ("damping_s", self.damping_s, 0 <= self.damping_s < np.inf, ">= 0"),
            ("stiffening", self.stiffening, 0 <= self.stiffening < 1, "0 .. 1"),
            ("creep_share", self.creep_share, 0 <= self.creep_share < np.inf, ">= 0"),
            ("creep_time_s", self.creep_time_s, _positive(self.creep_time_s), "> 0"),
            *(
                (name, getattr(self, name), 0 <= getattr(self, name) < np.inf, ">= 0")
                for name in BEARINGS
            ),
            ("load_play_rad", self.load_play_rad, 0 <= self.load_play_rad < np.inf, ">= 0"),
            ("segments", self.segments, self.segments is None or self.segments >= 1, ">= 1"),
        ]

    @property
    def is_plain(self) -> bool:
        """Return whether cables and pulleys are linear springs without losses."""
        return self.has_plain_cables and not any(getattr(self, name) for name in BEARINGS)

    @property
    def has_plain_cables(self) -> bool:
        """Return whether the cables are linear springs, fixed to their pulleys without play."""
        return self.stiffening == 0.0 and self.creep_share == 0.0 and self.load_play_rad == 0.0

    @property
    def bearings(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Dry friction, N m, and viscous, N m s/rad, of the motor's bearing and of the load's."""
        return (
            (self.motor_bearing_nm, self.motor_bearing_nm_s_per_rad),
            (self.load_bearing_nm, self.load_bearing_nm_s_per_rad),
        )

    @property
    def length_m(self) -> float:
        """Length L of one cable."""
        return float(self.piece_length_m.sum())

    @property
    def wrap_rad(self) -> float:
        """Angle by which the conduit turns, integral of ds/R."""
        return float(self.piece_length_m @ self.piece_curvature_per_m)

    @property
    def softest_n_per_m(self) -> float:
        """Stiffness of one cable that slides whole, at its end of less tension.

        There T(s) = T e^(phi s / L), phi = mu_d times the wrap angle, so that a change of T
        stretches it by L / EA (e^phi - 1) / phi as much.
        """
        phi = self.friction.mu_d * self.wrap_rad
        softer = float(np.expm1(phi)) / phi if phi > 0.0 else 1.0
        return self.axial_stiffness_n / self.length_m / softer


def _positive(value: float) -> bool:
    return 0 < value < np.inf
