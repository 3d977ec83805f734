"""Faults during a recording are named, with an effect missing in the model and without.

What is recorded is the model's own answer, with counts and noise; a missing effect is put into the
rig that records and left out of the model that is asked.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from bowden.estimation.gate.check import check_data
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.recording.recording import Recording

from ..rigs import TABLE_1, as_recording
from .test_gate import sensed

MODEL = parse_model(TABLE_1)
VISCOUS = ("viscous_friction", {"mu_v_s_per_m": 0.3})
RATE_HZ, LENGTH_S = 500.0, 24.0


def recorded(model: Model) -> Recording:
    """Strokes of several lengths under a slow motor torque."""
    time_s = np.arange(round(LENGTH_S * RATE_HZ)) / RATE_HZ
    load = 0.5 * np.sin(2.6 * time_s) * (0.7 + 0.3 * np.sin(0.5 * time_s))
    torque = 0.15 * np.sin(1.1 * time_s + 0.3)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load)
    return sensed(as_recording(simulate(model, Mode.TORQUE_POSITION, inputs)))


RUNS = {"complete": recorded(MODEL), "effect missing": recorded(MODEL.with_effect(*VISCOUS))}


def stepped(one: Recording) -> Recording:
    return one.with_channels(load_torque_nm=one.load_torque_nm + 0.15 * (one.time_s > 10.0))


def clipped(one: Recording) -> Recording:
    noise = np.random.default_rng(4).normal(0.0, 5e-4, one.time_s.size)
    most = 0.7 * float(np.abs(one.load_torque_nm).max())
    return one.with_channels(load_torque_nm=np.clip(one.load_torque_nm, -most, most) + noise)


def on_another_clock(one: Recording) -> Recording:
    at = one.time_s * 1.005
    names = ("motor_torque_nm", "load_torque_nm")
    return one.with_channels({name: np.interp(at, one.time_s, one[name]) for name in names})


@pytest.mark.parametrize("model", RUNS)
@pytest.mark.parametrize(
    ("fault", "what"),
    [(stepped, "zero_step"), (clipped, "clipped"), (on_another_clock, "clock")],
)
def test_a_fault_on_the_way_is_named(
    model: str, fault: Callable[[Recording], Recording], what: str
) -> None:
    found = check_data(MODEL, [fault(RUNS[model])], Mode.TORQUE_POSITION)
    assert what in {one.what for one in found if one.severity == "stop"}


@pytest.mark.parametrize("model", RUNS)
def test_without_a_fault_nothing_stops(model: str) -> None:
    found = check_data(MODEL, [RUNS[model]], Mode.TORQUE_POSITION)
    assert [one.text for one in found if one.severity == "stop"] == []


def test_the_moment_and_size_of_a_step_are_found() -> None:
    found = check_data(MODEL, [stepped(RUNS["complete"])], Mode.TORQUE_POSITION)
    (step,) = [one for one in found if one.what == "zero_step"]
    assert "at 10 s" in step.found
    assert float(step.found.split()[4]) == pytest.approx(0.15, abs=0.003)  # 5 sigma of the noise


def test_a_step_of_the_motors_torque_is_no_step_of_a_zero() -> None:
    """The cell's reading jumps with it, as the model says that it does."""
    time_s = np.arange(round(LENGTH_S * RATE_HZ)) / RATE_HZ
    load = 0.5 * np.sin(2.6 * time_s)
    torque = np.where(time_s > 10.3, 0.15, -0.1)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load)
    run = sensed(as_recording(simulate(MODEL, Mode.TORQUE_POSITION, inputs)))
    assert [
        one for one in check_data(MODEL, [run], Mode.TORQUE_POSITION) if one.severity == "stop"
    ] == []


def test_a_joint_whose_friction_turns_round_is_no_step_of_a_zero() -> None:
    """A torque that the model lacks jumps where the load turns, once in the recording."""
    run = RUNS["complete"]
    turn = int(np.argmax(run.load_angle_rad[: run.time_s.size // 2]))
    jump = 0.15 * (np.arange(run.time_s.size) > turn)
    found = check_data(
        MODEL, [run.with_channels(load_torque_nm=run.load_torque_nm + jump)], Mode.TORQUE_POSITION
    )
    assert "zero_step" not in {one.what for one in found}


def test_a_cable_that_lets_go_is_no_step_of_a_zero() -> None:
    """The motor's end jumps with the cell: no zero does that."""
    run = RUNS["complete"]
    late = run.time_s > 10.0
    slipped = run.with_channels(
        load_torque_nm=run.load_torque_nm + 0.15 * late,
        motor_angle_rad=run.motor_angle_rad + 0.1 * late,
    )
    found = check_data(MODEL, [slipped], Mode.TORQUE_POSITION)
    assert "zero_step" not in {one.what for one in found}


def test_recordings_of_two_rigs_are_told_apart_and_those_of_one_are_not() -> None:
    other = parse_model(TABLE_1.replace("mu_d: {value: 0.21", "mu_d: {value: 0.8"))
    mode = Mode.TORQUE_POSITION
    run, strange = RUNS["complete"], recorded(other)
    found = check_data(MODEL, [run, strange], mode)
    assert "two_rigs" in {one.what for one in found if one.severity == "stop"}
    # A model that is wrong about its rig is wrong in both alike.
    assert "two_rigs" not in {one.what for one in check_data(MODEL, [strange, strange], mode)}
    assert "two_rigs" not in {one.what for one in check_data(MODEL, list(RUNS.values()), mode)}


@pytest.mark.parametrize("friction", [0.7, 1.1, 1.3])
def test_a_locked_load_that_the_torque_just_reaches_is_no_other_rig(friction: float) -> None:
    """What arrives there is a difference of two torques: friction off by a tenth doubles it."""
    rig = parse_model(TABLE_1.replace("mu_d: {value: 0.21", f"mu_d: {{value: {0.21 * friction}"))
    time_s = np.arange(round(LENGTH_S * RATE_HZ)) / RATE_HZ
    levels_nm = 0.65 * np.array([0.0, -0.8, -0.8, 0.55, 0.55, -1.0, -1.0, 0.4, 0.4, 1.0, 1.0])
    torque = np.interp(time_s, [0, 1, 4, 6, 9, 11, 14, 16, 19, 21, 24], levels_nm)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=np.zeros(time_s.size))
    held = sensed(as_recording(simulate(rig, Mode.TORQUE_POSITION, inputs)))
    found = check_data(MODEL, [recorded(rig), held], Mode.TORQUE_POSITION)
    assert "two_rigs" not in {one.what for one in found}
