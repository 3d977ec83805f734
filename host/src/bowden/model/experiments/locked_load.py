"""Experiment 1: the load pulley is locked, the motor ramps its torque up and down (Figs. 3 and 4).

1a varies the pretension, 1b the number of loops of the conduit. With Table I as printed no torque
reaches the load; the finding says so, with the figures that show why.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bowden.model.description import Model
from bowden.model.experiments.result import Case, Experiment, run_case
from bowden.model.experiments.signals import ramp_period_s, ramps_with_dwells, sample_times
from bowden.model.experiments.variants import with_loops, with_pretension
from bowden.model.measures import first_response
from bowden.model.simulation import simulate
from bowden.model.trajectory import FloatArray, Inputs, Mode
from bowden.model.transmission import Transmission

PEAK_TORQUE_NM = 0.125
SLOPE_NM_PER_S = 0.1
DWELL_S = 0.5
DURATION_S = 30.0
RATE_HZ = 1000.0

PRETENSIONS_N = {"printed": (5.0, 10.0, 15.0, 20.0), "transmitting": (1.0, 1.5, 2.0, 2.4)}
LOOPS = (1, 2, 3)
# At 0.6 N even three loops let 0.125 N m through: one cable is slack and e^-m of it arrives.
LOOPS_PRETENSION_N = {"printed": None, "transmitting": 0.6}


def pretension_series(model: Model, preset: str) -> Experiment:
    """Run Experiment 1a: four pretensions."""
    cases = tuple(
        locked_load_case(with_pretension(model, t), f"{t:g} N") for t in PRETENSIONS_N[preset]
    )
    return Experiment(
        "1a", preset, "Experiment 1a: pretension, load locked", _finding(cases, "pretension"), cases
    )


def loop_series(model: Model, preset: str) -> Experiment:
    """Run Experiment 1b: one, two and three loops of the conduit."""
    pretension = LOOPS_PRETENSION_N[preset]
    if pretension is not None:
        model = with_pretension(model, pretension)
    cases = tuple(
        locked_load_case(with_loops(model, n), f"{n} loop{'s' if n > 1 else ''}") for n in LOOPS
    )
    return Experiment(
        "1b", preset, "Experiment 1b: cable path, load locked", _finding(cases, "path"), cases
    )


def locked_load_case(model: Model, label: str = "locked load") -> Case:
    """Run the motor's torque profile once, load locked.

    Its figures: `first_response_nm`, the motor torque at which the load of a virgin rig first
    feels something (None: never); `front_a_m` and `front_b_m`, how far the motion gets into the
    cables in the virgin ramp.
    """
    time_s = sample_times(DURATION_S, RATE_HZ)
    torque = ramps_with_dwells(time_s, PEAK_TORQUE_NM, SLOPE_NM_PER_S, DWELL_S)
    case = run_case(
        label,
        model,
        Mode.TORQUE_POSITION,
        Inputs(time_s, motor_torque_nm=torque, load_angle_rad=np.zeros_like(time_s)),
        ramp_period_s(PEAK_TORQUE_NM, SLOPE_NM_PER_S, DWELL_S),
    )
    pair = model.transmission
    top = int(np.argmax(torque))
    figures = {
        "first_response_nm": first_response_nm(model),
        "front_a_m": front_depth_m(pair, float(case.trajectory.motor_tension_a_n[top])),
        "front_b_m": front_depth_m(pair, float(case.trajectory.motor_tension_b_n[top])),
    }
    return Case(case.label, model, case.mode, case.trajectory, case.first, case.steady, figures)


def front_depth_m(pair: Transmission, end_tension_n: float) -> float | None:
    """Return how far a virgin cable moves when one end is brought from T0 to a tension, m.

    Where ``integral of mu_d ds/R = abs(ln(T/T0))``, eq. (1), less what breakaway takes at the
    front; the whole length when the motion reaches the other end. None where the closed form does
    not hold: another friction law, an initial profile, no pretension, a slack cable.
    """
    law = pair.friction
    if not law.is_coulomb or law.direction_asymmetry or pair.initial_tension_n is not None:
        return None
    if pair.pretension_n <= 0 or end_tension_n <= 0:
        return None
    wrap_left = abs(float(np.log(end_tension_n / pair.pretension_n)))
    depth = 0.0
    for length, curvature in zip(pair.piece_length_m, pair.piece_curvature_per_m, strict=True):
        excess = (law.mu_s - law.mu_d) * (law.stiction_length_m or 0.0) * curvature
        wrap = law.mu_d * curvature * length
        if max(wrap_left - excess, 0.0) < wrap:
            return float(depth + max(wrap_left - excess, 0.0) / (law.mu_d * curvature))
        wrap_left -= wrap
        depth += length
    return float(depth)


def first_response_nm(model: Model) -> float | None:
    """Return the motor torque at which the load of a virgin rig first receives something, N m.

    Found with the model itself: a ramp up to the torque that pulls one cable through alone, then
    a finer one across the step in which the load torque first changes. None if it never does.
    """
    pair, law = model.transmission, model.transmission.friction
    piece_m = law.stiction_length_m or (pair.length_m / pair.segments if pair.segments else 0.0)
    excess = (law.mu_s - law.mu_d) * piece_m * float(pair.piece_curvature_per_m.max())
    wrap = (law.mu_d + law.mu_v_s_per_m + law.mu_d * law.stribeck_gain) * pair.wrap_rad + excess
    if wrap > 50.0:
        return None
    highest = 1.05 * pair.motor_pulley_radius_m * max(pair.pretension_n, 1e-3) * float(np.exp(wrap))
    torques = np.linspace(0.0, highest, 2001)
    found = None
    for _ in range(2):
        found = _first_felt(model, torques)
        if found is None:
            return None
        low, high = torques[max(found - 1, 0)], torques[found]
        torques = np.concatenate((torques[:found], np.linspace(low, high, 2001)[1:]))
    return float(torques[_first_felt(model, torques) or 0])


def _first_felt(model: Model, torques: FloatArray) -> int | None:
    # A slow ramp: 1 s a sample, so that terms of speed do not count.
    time_s = np.arange(torques.size, dtype=np.float64)
    inputs = Inputs(time_s, motor_torque_nm=torques, load_angle_rad=np.zeros_like(torques))
    answer = simulate(model, Mode.TORQUE_POSITION, inputs).load_torque_nm
    return first_response(
        torques, answer, 1e-9 * model.transmission.pulley_ratio * float(torques[-1])
    )


def _finding(cases: Sequence[Case], varied: str) -> str:
    silent = [case for case in cases if case.steady.load_torque_pp_nm == 0.0]
    if len(silent) == len(cases):
        return _why_silent(cases)
    arrived = "; ".join(
        f"{case.label}: {100 * (case.steady.efficiency or 0.0):.1f} %"
        + (
            f", {100 * case.steady.slack_share:.0f} % of the time a cable is slack"
            if case.steady.slack_share
            else ""
        )
        for case in cases
    )
    text = f"Share of the lossless torque that arrives in the steady cycle, by {varied}: {arrived}."
    for case in silent:
        reached = case.figures["first_response_nm"]
        once = case.first.load_torque_pp_nm > 0.0
        text += (
            f" At {case.label} the virgin rig feels the first ramp (from {reached:.3g} N m on) and "
            "nothing after it."
            if once and reached is not None
            else f" At {case.label} nothing arrives."
        )
    return text


def _why_silent(cases: Sequence[Case]) -> str:
    length = cases[0].model.transmission.length_m
    text = (
        f"No torque arrives at the load: {PEAK_TORQUE_NM:g} N m set only the motor's end of each "
        f"cable in motion, and friction holds the rest of its {length:g} m."
    )
    reach = [
        f"{case.label}: {case.figures['front_a_m']:.3f} and {case.figures['front_b_m']:.3f} m"
        for case in cases
        if case.figures["front_a_m"] is not None and case.figures["front_b_m"] is not None
    ]
    if reach:
        text += f" Pulled and released cable move up to a depth of {'; '.join(reach)}."
    needed = [
        f"{torque:.2f} N m ({case.label})"
        for case in cases
        if (torque := case.figures["first_response_nm"]) is not None
    ]
    return f"{text} The load would first respond at {', '.join(needed)}." if needed else text
