"""Steps with the bridge on: direction and constant of the motor, properties of the cables.

Each says how much torque the motor is going to make before it makes any.
"""

from __future__ import annotations

import numpy as np

from bowden.commission.job import Job
from bowden.commission.measures import (
    Measured,
    motor_direction,
    taut_torque_nm,
    through_torque_nm,
    torque_scale,
)
from bowden.commission.state import StepFinding, Verdict
from bowden.commission.winding import read_trace, winding_of
from bowden.drive.reduced_model import reduced_model
from bowden.drive.torque_profile import TorqueProfile
from bowden.errors import BadInput, DriveFailed
from bowden.estimation.quantities import estimate
from bowden.model.experiments.signals import ramp_period_s, ramps_with_dwells, sample_times
from bowden.recording.recording import Recording

_ATTEMPTS = 3
_RAMP_S = 0.5
_DWELL_S = 0.5
_PROFILE_RATE_HZ = 100.0
#: Of the torque at which the pulled cable's front gets through: beyond it, the whole cable slides.
_BEYOND = 1.2
#: Of what would slacken a sliding cable; half of it leaves room for a wrong stated pretension.
_TAUT_SHARE = 0.5
#: A load that moves by more is not locked.
LOCKED_RAD = 0.02


def find_motor_direction(job: Job) -> list[StepFinding]:
    """Find whether positive torque turns the motor encoder up; the operator corrects the wires."""
    peak = min(0.5 * through_torque_nm(job.model), job.drive.read("motor_torque_limit"))
    profile = _ramps(peak, peak)
    name, mended = "motor direction", False
    for _ in range(_ATTEMPTS):
        job.operator.ask("Direction of the motor", _moves(peak), "lock the load")
        # A motor that turns backwards may trip the drive's supervision (ends_apart): what was
        # recorded until then says so, too.
        way, failure = 0, None
        try:
            recording = job.record("motor_direction", profile.duration_s, profile)
            way = motor_direction(_locked(recording))
        except DriveFailed as fault:
            failure = fault
            way = motor_direction(_locked(job.last_recording()))
        if way > 0 and failure is not None:
            raise failure
        if way == 0:
            found = f"no motion of the motor encoder at {peak:.2f} N m"
            raise DriveFailed(f"{name}: {found}; check motor wiring and encoder")
        if way > 0:
            break
        mended = True
        todo = "swap two leads of the motor (brushed: its two leads)"
        job.operator.mend(f"{name}: a positive torque turns it backwards", todo)
    else:
        raise DriveFailed(f"{name}: still backwards after {_ATTEMPTS} attempts")
    found = "turned backwards" if mended else "a positive torque turns it to the positive side"
    return [StepFinding(what=name, verdict="mended" if mended else "as stated", found=found)]


def find_torque_constant(job: Job) -> list[StepFinding]:
    """Find the motor's torque per ampere of its sensor from the load cell; correct it."""
    torque = _TAUT_SHARE * taut_torque_nm(job.model)
    half_s = job.facts.by_hand_s
    times = np.array([0.0, _RAMP_S, half_s, half_s + _RAMP_S, 2.0 * half_s])
    levels = torque * np.array([0.0, 1.0, 1.0, -1.0, -1.0])
    profile = TorqueProfile(times, levels, "commissioning: torque constant")
    job.operator.ask(
        "Torque constant",
        _moves(torque),
        f"unlock the load; move it slowly to and fro by 30 deg or more for {2 * half_s:g} s, at "
        "least three times there and back under either torque",
    )
    scale = torque_scale(job.record("torque_constant", profile.duration_s, profile), job.ratio)
    stated = job.drive.read("torque_constant")
    value, low, high = (stated * share for share in (scale.value, scale.low, scale.high))
    right = scale.holds(1.0)
    if not right:
        job.write({"torque_constant": value})
    found = (
        f"{value:.5f} N m per ampere as the drive reads it, {scale.value - 1.0:+.2%} against "
        "what was stated; gain of the current sensor and constant of the motor are in it together"
    )
    number = Measured(value, low, high)
    verdict: Verdict = "as stated" if right else "corrected"
    return [StepFinding.of("torque constant", verdict, found, number, "N m/A")]


def find_cables(job: Job) -> list[StepFinding]:
    """Find stiffness, pretension and friction from torque ramps on the locked load (III-B)."""
    limit = job.drive.read("motor_torque_limit")
    through = through_torque_nm(job.model)
    peak = min(_BEYOND * through, limit)
    profile = _ramps(peak, job.facts.ramp_nm_per_s)
    todo = (
        "lock the load, let the pretension off and set it anew: the model begins with cables that "
        "have just been tensioned"
    )
    job.operator.ask("Stiffness, pretension, friction", _moves(peak), todo)
    recording = _locked(job.record("cables", profile.duration_s, profile))
    found = estimate("stiffness", job.model, [recording])
    before = job.model
    job.model = found.calibration.as_model([job.source(job.recordings[-1])])
    job.write(reduced_model(job.model).entries)
    findings = []
    for one in found.calibration.estimates:
        known = one.low is not None and one.high is not None
        words = f"{one.value:.5g}"
        if one.low is not None and one.high is not None:
            words += f" (95 %: {one.low:.5g} to {one.high:.5g})"
        words += f"; the file said {before.value(one.path):.5g}"
        findings.append(
            StepFinding(
                what=one.path,
                verdict="measured",
                found=words if known else f"{words}; no interval, see below",
                value=one.value,
                low=one.low,
                high=one.high,
            )
        )
    caveats = list(found.caveats)
    through = through_torque_nm(job.model)  # of the cables as they are
    if peak < through:
        caveats.append(
            f"{peak:.3g} N m do not get through the pulled cable ({through:.3g} N m would): less "
            "pretension or a higher motor_torque_limit tells stiffness and friction apart better."
        )
    findings += [StepFinding(what="caveat", verdict="measured", found=text) for text in caveats]
    return findings


def _ramps(peak_nm: float, slope_nm_per_s: float) -> TorqueProfile:
    """Return one period of the paper's ramps with dwells, from 0 to both sides."""
    duration_s = ramp_period_s(peak_nm, slope_nm_per_s, _DWELL_S)
    time_s = sample_times(duration_s, _PROFILE_RATE_HZ)
    torque = ramps_with_dwells(time_s, peak_nm, slope_nm_per_s, _DWELL_S)
    return TorqueProfile(time_s, torque, "commissioning: ramps")


def _moves(torque_nm: float) -> str:
    return f"the motor, with up to {torque_nm:.3g} N m both ways"


def _locked(recording: Recording) -> Recording:
    """Refuse a recording in which the load moved.

    Raises
    ------
    BadInput
        It did.
    """
    moved = float(np.ptp(recording.load_angle_rad))
    if moved > LOCKED_RAD:
        raise BadInput(recording.source, f"a load that moved by {moved:.3f} rad", "a locked load")
    return recording


def find_winding(job: Job) -> list[StepFinding]:
    """Find resistance and inductance of the motor; correct what gives the current loop's gains."""
    job.operator.ask(
        "Winding",
        "the motor, hardly: a small alternating voltage for 10 ms, which hums",
        "nothing to do: the load may be free or locked",
    )
    trace = read_trace(job.drive)
    if trace is None:
        found = "not measured: this board has no such measurement; the drive's numbers stay"
        return [StepFinding(what="winding", verdict="as stated", found=found)]
    winding = winding_of(*trace)
    findings = []
    for name, what, number, unit in (
        ("motor_resistance", "resistance", winding.resistance, "Ohm"),
        ("motor_inductance", "inductance", winding.inductance, "H"),
    ):
        stated = job.drive.read(name)
        right = number.holds(stated)
        if not right:
            job.write({name: number.value})
        verdict: Verdict = "as stated" if right else "corrected"
        found = f"{number.value:.4g} {unit}, {number.value / stated - 1.0:+.1%} against the stated"
        findings.append(StepFinding.of(f"winding {what}", verdict, found, number, unit))
    return findings
