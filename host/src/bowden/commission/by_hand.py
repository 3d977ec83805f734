"""Steps with the bridge off: the operator turns the load and hangs weights.

Directions of the sensors, counts per turn, zero of the current, zero and gain of the load cell,
zero of the angles, and where the index pulses lie from it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bowden.commission.job import Job
from bowden.commission.measures import Measured, cell_scale, directions, encoder_counts
from bowden.commission.state import StepFinding, Verdict
from bowden.drive.homing import angle_reference, home_here, learn_index
from bowden.drive.meanings import AngleReference
from bowden.errors import DriveFailed

GRAVITY_M_PER_S2 = 9.80665  # standard; on earth it differs by up to 0.3 %
_STANDING_S = 1.0
_ATTEMPTS = 3  # at the same fault of the wiring
#: Between decoders that count one, two or four edges of a quadrature signal.
_EDGES = (0.25, 0.5, 2.0, 4.0)
_SWAP = {
    "load encoder direction": "swap A and B of the load encoder",
    "motor encoder direction": "swap A and B of the motor encoder",
}


def find_directions(job: Job) -> list[StepFinding]:
    """Find the signs of encoders and load cell; encoders are mended by the operator."""
    todo = (
        "turn the load to its positive side, the one to which cable a pulls it, by at least "
        f"30 deg, then to and fro for {job.facts.by_hand_s:g} s"
    )
    mended: list[str] = []
    for _ in range(_ATTEMPTS):
        job.operator.ask("Directions", "", todo)
        signs = directions(job.record("directions", job.facts.by_hand_s))
        encoders = dict(zip(_SWAP, (signs.load_encoder, signs.motor_encoder), strict=True))
        wrong = [name for name, sign in encoders.items() if sign < 0]
        if not wrong:
            break
        for name in wrong:
            mended.append(name)
            job.operator.mend(f"{name}: it counts backwards", _SWAP[name])
    else:
        raise DriveFailed(f"{', '.join(wrong)}: still backwards after {_ATTEMPTS} attempts")
    findings = [
        StepFinding(
            what=name,
            verdict="mended" if name in mended else "as stated",
            found="counted backwards" if name in mended else "counts up to the positive side",
        )
        for name in _SWAP
    ]
    if signs.load_cell < 0:
        gain = job.drive.read("load_cell_gain")
        job.write({"load_cell_gain": -gain})
        found = f"the cables seemed to drive the load; load_cell_gain is {-gain:g} now"
        findings.append(StepFinding(what="load cell sign", verdict="corrected", found=found))
    else:
        found = "the cables resist the motion"
        findings.append(StepFinding(what="load cell sign", verdict="as stated", found=found))
    return findings


def find_counts(job: Job) -> list[StepFinding]:
    """Find counts per turn of both encoders from two marks at the load; correct them."""
    facts = job.facts
    job.operator.ask(
        "Encoder counts",
        "",
        f"turn the load from one mark to the other, {math.degrees(facts.angle_rad):g} deg, and "
        f"back again, to the marks and not beyond, for {facts.by_hand_s:g} s",
    )
    recording = job.record("counts", facts.by_hand_s)
    names = ("load", "motor")
    stated = {name: job.drive.read(f"{name}_encoder_resolution") for name in names}
    measured = encoder_counts(
        recording, facts.angle_rad, facts.angle_tolerance_rad, (stated["load"], stated["motor"]),
        job.ratio,
    )  # fmt: skip
    findings, right, in_model = [], {}, {}
    for name, number in zip(names, measured, strict=True):
        verdict, value = _resolution(stated[name], number)
        found = f"{number.value:.0f} counts per turn measured, {stated[name]:.0f} stated"
        if value != stated[name]:
            found += f"; {value:.0f} from now on: compare with its data sheet"
            right[f"{name}_encoder_resolution"] = value
            if getattr(job.model.document.rig, f"{name}_encoder_counts_per_turn") is not None:
                in_model[f"rig.{name}_encoder_counts_per_turn"] = value
        findings.append(
            StepFinding.of(f"{name} encoder counts", verdict, found, number, "counts per turn")
        )
    job.write(right)
    job.model = job.model.with_values(in_model) if in_model else job.model
    return findings


def _resolution(stated: float, number: Measured) -> tuple[Verdict, float]:
    """Return verdict and counts per turn to work with."""
    if number.holds(stated):
        return "as stated", stated
    for factor in _EDGES:
        if number.holds(stated * factor):
            return "corrected", stated * factor
    return "corrected", float(round(number.value))


def find_current_zero(job: Job) -> list[StepFinding]:
    """Find what current the drive reads with the bridge off."""
    job.operator.ask("Zero of the current", "", "nothing to do: the bridge is off")
    recording = job.record("current_zero", _STANDING_S)
    constant = job.drive.read("torque_constant")
    amperes = recording.motor_torque_nm / constant
    number = _mean(amperes)
    found = f"{1e3 * number.value:+.2f} mA with the bridge off"
    return [StepFinding.of("current zero", "measured", found, number, "A")]


def find_load_cell(job: Job) -> list[StepFinding]:
    """Find zero and gain of the load cell from known weights; correct both."""
    facts = job.facts
    title = "Load cell"
    known = [0.0, *(kg * GRAVITY_M_PER_S2 * facts.lever_m for kg in facts.weights_kg)]
    readings = []
    for number, torque in enumerate(known):
        if number == 0:
            todo = "take the cables off the load pulley and all load off the cell"
        else:
            todo = (
                f"hang {facts.weights_kg[number - 1]:g} kg at {facts.lever_m:g} m, so that it "
                f"turns the load to its positive side ({torque:.3f} N m)"
            )
        job.operator.ask(title, "", todo)
        recording = job.record(f"load_cell_{number}", _STANDING_S)
        readings.append(float(recording.load_torque_nm.mean()))
    job.operator.ask(title, "", "take the weight off and put the cables on again")
    stated = job.drive.read("load_cell_gain"), job.drive.read("load_cell_zero")
    gain, zero = cell_scale(known, readings, *stated)
    wrong = not gain.holds(stated[0]), not zero.holds(stated[1])
    job.write({"load_cell_gain": gain.value, "load_cell_zero": round(zero.value)})
    off = gain.value / stated[0] - 1.0
    return [
        StepFinding.of(
            "load cell gain",
            "corrected" if wrong[0] else "as stated",
            f"{1e6 * gain.value:.3f} uN m per count, {off:+.2%} against what was stated",
            gain,
            "N m per count",
        ),
        StepFinding.of(
            "load cell zero",
            "corrected" if wrong[1] else "as stated",
            f"{zero.value:.1f} counts, {stated[1]:.0f} stated",
            zero,
            "count",
        ),
    ]


def set_zero(job: Job) -> list[StepFinding]:
    """Set the zero of both angles where the operator has brought the load."""
    job.operator.ask("Zero of the angles", "", "bring the load to its zero by hand and let go")
    home_here(job.drive)
    found = f"angles count {angle_reference(job.drive).doc}"
    return [StepFinding(what="zero of the angles", verdict="measured", found=found)]


def learn_pulses(job: Job) -> list[StepFinding]:
    """Note where both encoders' index pulses lie; set the zero anew where it is not the one shown.

    A drive that was switched off since the zero was set counts from where it stood at power-on.
    """
    shown = angle_reference(job.drive) is AngleReference.HOMED
    findings = [] if shown else set_zero(job)
    job.operator.ask("Index pulses", "", "turn the load slowly to and fro, through its whole range")
    pulses = learn_index(job.drive)
    job.written |= {f"index_position.{name}": float(at) for name, at in pulses._asdict().items()}
    found = f"{pulses.motor} (motor) and {pulses.load} (load) counts from the zero"
    return [*findings, StepFinding(what="index pulses", verdict="measured", found=found)]


def _mean(values: NDArray[np.float64]) -> Measured:
    """Return the mean of samples with its interval, from the means of ten blocks."""
    blocks = np.array([block.mean() for block in np.array_split(values, 10)])
    by = 2.262 * float(blocks.std(ddof=1)) / math.sqrt(10)  # t for nine degrees of freedom
    mean = float(values.mean())
    return Measured(mean, mean - by, mean + by)
