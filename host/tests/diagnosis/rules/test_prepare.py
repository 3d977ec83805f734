"""What is held back: never what stands nowhere else in the recording; what zeros are worth."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bowden.diagnosis.rules.noise_scale import AT_FLOOR
from bowden.diagnosis.rules.prepare import prepare
from bowden.diagnosis.rules.problem import BY_CHANCE, WeighedRecordings, about_zero
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.recording import Recording

from ...rigs import TABLE_1

MODEL = parse_model(TABLE_1)
MODE = Mode.TORQUE_POSITION


@pytest.mark.parametrize("cycle", [3, 4, 5])  # three neighbours: one of them in each third
def test_the_one_long_stroke_is_fitted(cycle: int) -> None:
    time_s = np.arange(12_000) * 1e-3
    size = np.where(time_s.astype(int) == cycle, 0.6, 0.2)
    load = size * np.sin(2 * np.pi * time_s)
    inputs = Inputs(time_s, motor_torque_nm=np.zeros(time_s.size), load_angle_rad=load)
    run = simulate(MODEL, MODE, inputs)
    recording = Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=inputs.motor_torque_nm,
        load_torque_nm=run.load_torque_nm,
    )
    with ThreadPoolExecutor(2) as pool:
        (part,) = prepare(MODEL, MODE, [recording], 1, pool)
    longest = int(np.argmax(np.abs(part.recording.load_angle_rad)))
    assert part.counts[longest]
    assert 0.2 < np.mean(~part.counts) < 0.5  # about a third judges


def test_encoders_that_round_down_do_not_make_a_right_model_wrong() -> None:
    """Half a count of a coarse load encoder is 7 mrad at the motor, four times its noise there."""
    model = parse_model(TABLE_1.replace("10000", "2000"))
    count = 2 * np.pi / 2000
    time_s = np.arange(6000) * 1e-3
    load = 0.4 * np.sin(np.pi * time_s)
    inputs = Inputs(time_s, motor_torque_nm=np.zeros(time_s.size), load_angle_rad=load)
    run = simulate(model, MODE, inputs)
    noise = np.random.default_rng(1).normal(0.0, 5e-4, time_s.size)
    motor, load = (count * np.floor(one / count) for one in (run.motor_angle_rad, load))
    recording = Recording(
        time_s,
        motor_angle_rad=motor,
        load_angle_rad=load,
        motor_torque_nm=inputs.motor_torque_nm,
        load_torque_nm=run.load_torque_nm + noise,
    )
    with ThreadPoolExecutor(2) as pool:
        parts = prepare(model, MODE, [recording], 1, pool)
    problem = WeighedRecordings(MODE, parts)
    gap = problem.gaps(model, parts[0])["motor_angle_rad"]
    channel = parts[0].channels["motor_angle_rad"]
    assert abs(float(np.mean(gap))) > 1.5 * float(np.median(channel.sigma))
    z = about_zero(model, "motor_angle_rad", channel, gap) / channel.sigma
    assert np.sqrt(np.mean(z**2)) < BY_CHANCE
    assert problem.rest(model) < AT_FLOOR
