"""Screening: a strength that only shows near the true one is found all the same."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.rules.fit import HypothesisFit, solve
from bowden.diagnosis.rules.free_parameters import free_parameters
from bowden.diagnosis.rules.prepare import prepare
from bowden.diagnosis.rules.problem import WeighedRecordings
from bowden.diagnosis.rules.screening import screen
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.recording import Recording

from ...rigs import TABLE_1_COARSE

MODE = Mode.TORQUE_POSITION


@pytest.mark.parametrize("inertia_kg_m2", [1.1e-5, 3.5e-5, 1.3e-4])
def test_a_motor_that_rings_is_looked_at_near_its_true_inertia(inertia_kg_m2: float) -> None:
    """Half as heavy, it rings at another frequency, and explains nothing."""
    model = parse_model(TABLE_1_COARSE)
    true = model.with_effect("motor_inertia", {"inertia_kg_m2": inertia_kg_m2})
    time_s = np.arange(3000) * 1e-3
    load = 0.2 * np.sin(2 * np.pi * time_s)
    torque = 0.1 * np.sign(np.sin(2 * np.pi * 2.3 * time_s))
    run = simulate(true, MODE, Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load))
    noise = np.random.default_rng(3).normal(size=time_s.size)
    recording = Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm + 5e-4 * noise,
    )
    with ThreadPoolExecutor(2) as pool:
        problem = WeighedRecordings(MODE, prepare(model, MODE, [recording], 0, pool)).with_noise_of(
            model
        )
    fit = HypothesisFit(model, free_parameters(model), problem)
    base = solve(fit, np.zeros(len(fit.parameters)))
    (candidate,) = candidates(["motor_inertia"])
    best = screen(fit, base, candidate)[0]
    # Strengths are looked at in steps of a fifth.
    assert best.values["inertia_kg_m2"] == pytest.approx(inertia_kg_m2, rel=0.25)
    assert best.gain > 0.3 * base.cost
    assert best.rings
