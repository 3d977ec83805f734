"""Slow changes: friction with heat, travel, standstill and place; loss of pretension.

Compiled; works on the vector of scalars, `state` names its places. `mechanics.advance` calls `age`
once a control period and reads FRICTION_FACTOR, ASYMMETRY and PRETENSION.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled
from bowden_rig.rig.constants import Constants


@compiled
def age(c: Constants, s: NDArray[np.float64], period_s: float) -> None:
    """Let one control period's ageing happen.

    thermal   1 + alpha (temperature - 20 degC)
    wear      1 + change (1 - exp(-travel / travel_m))
    dwell     1 + gain q, q' = (1 - q) / time - q abs(v) / slip
    place     1 + gain cos(k theta_l + phase), 1 + gain exp(-((theta_l - centre) / width)^2)
    pile      asymmetry + change tanh(theta_l / width)
    loss      T0 (1 - a ln(1 + t / tau))
    """
    s[at.TIME] += period_s
    time_s = s[at.TIME]
    slip_m = c.load_radius_m * abs(s[at.LOAD_SPEED]) * period_s
    s[at.TRAVEL] += slip_m
    s[at.WARMING] = -c.warming_k * math.expm1(-time_s / c.warming_s)
    rested = s[at.REST] - (1.0 - s[at.REST]) * math.expm1(-period_s / c.dwell_time_s)
    s[at.REST] = rested * math.exp(-slip_m / c.dwell_slip_m)
    factor = 1.0 + c.friction_per_k * (c.above_reference_k + s[at.WARMING])
    factor *= 1.0 - c.wear_change * math.expm1(-s[at.TRAVEL] / c.wear_travel_m)
    factor *= 1.0 + c.dwell_gain * s[at.REST]
    factor *= 1.0 + c.place_gain * math.cos(c.place_per_turn * s[at.LOAD_ANGLE] + c.place_phase_rad)
    away = (s[at.LOAD_ANGLE] - c.bump_centre_rad) / c.bump_width_rad
    factor *= 1.0 + c.bump_gain * math.exp(-away * away)
    s[at.ASYMMETRY] = c.asymmetry + c.pile * math.tanh(s[at.LOAD_ANGLE] / c.pile_width_rad)
    s[at.FRICTION_FACTOR] = max(factor, 0.0)
    s[at.PRETENSION] = c.pretension_n * max(1.0 - c.loss * math.log1p(time_s / c.loss_time_s), 0.0)
