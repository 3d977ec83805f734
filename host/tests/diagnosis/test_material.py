"""The meshes and steps on which rigs are diagnosed whose cables stick before they slide."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.contribution import idle
from bowden.diagnosis.fitting import parameters_with, start_of
from bowden.diagnosis.material import as_fine, as_searched, make_material
from bowden.estimation.covariance import covariance
from bowden.estimation.descend import descend
from bowden.estimation.likelihood import Scales
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.model.experiments.variants import with_segments
from bowden.recording.recording import Recording
from bowden.workers import workers
from numpy.typing import NDArray

STICKING = """
rig:
  cable:
    length_m: 1.6
    axial_stiffness_n: 4000
    path: [{length_m: 0.6, radius_m: 0.15}, {length_m: 1.0, radius_m: 0.5}]
    pretension_n: 14
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
friction: {law: stiction, mu_d: 0.24, mu_s: 0.38, stiction_length_m: 0.17}
effects: []
"""

BUMP = next(
    one for one in candidates(("position_dependent_friction",)) if one.strengths[0].name == "bump_a"
)
NONE = Scales((0.0, 0.0))
NOISE_NM = 1e-3


def motor_angle_rad(model: Model) -> NDArray[np.float64]:
    """Three strokes of the load against a motor without torque."""
    time_s = np.arange(6000) * 1e-3
    load_rad = 0.5 * np.sin(2 * np.pi * 0.5 * time_s)
    inputs = Inputs(time_s=time_s, motor_torque_nm=np.zeros(time_s.size), load_angle_rad=load_rad)
    return simulate(model, Mode.TORQUE_POSITION, inputs).motor_angle_rad


def recorded(
    model: Model,
    time_s: NDArray[np.float64],
    load_rad: NDArray[np.float64],
    torque_nm: NDArray[np.float64],
) -> Recording:
    """What a rig reads that is driven so: angles exactly, the load cell with its noise."""
    inputs = Inputs(time_s=time_s, motor_torque_nm=torque_nm, load_angle_rad=load_rad)
    run = simulate(model, Mode.TORQUE_POSITION, inputs)
    noise_nm = np.random.default_rng(1).normal(0.0, NOISE_NM, time_s.size)
    return Recording(
        time_s,
        motor_torque_nm=torque_nm,
        load_torque_nm=run.load_torque_nm + noise_nm,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load_rad,
    )


def test_a_cable_gives_way_on_the_search_mesh_when_it_does_on_any_finer_one() -> None:
    model = parse_model(STICKING)
    settled = motor_angle_rad(with_segments(model, 1600))
    for meshed in (as_searched(model), as_fine(model)):
        off_rad = motor_angle_rad(meshed) - settled
        # A tenth of what an encoder of 2000 counts leaves open, 3.1 mrad over the root of 12.
        assert np.sqrt(np.mean(off_rad**2)) < 9e-5


def test_stiction_over_a_segment_keeps_the_segments_of_the_file() -> None:
    """Eq. (6): breakaway depends on the mesh, and so another mesh is another rig."""
    per_segment = STICKING.replace(", stiction_length_m: 0.17", "")
    model = parse_model(per_segment + "numerics: {segments: 40}")
    filed = motor_angle_rad(model)
    assert np.array_equal(motor_angle_rad(as_searched(model)), filed)
    assert np.array_equal(motor_angle_rad(as_fine(model)), filed)


def test_where_an_end_gives_way_is_nowhere_corrected_and_known_to_a_step() -> None:
    """Sampled every 16 ms it gives way up to so much too late: a correction would be two jumps."""
    model, time_s = parse_model(STICKING), np.arange(6000) * 1e-3
    load_rad = 0.5 * np.sin(2 * np.pi * 0.5 * time_s)
    torque_nm = 0.1 * np.sin(2 * np.pi * 0.31 * time_s)
    exact, count_rad = recorded(model, time_s, load_rad, torque_nm), 2 * np.pi / 2000
    counts = np.round(exact.motor_angle_rad / count_rad)
    recording = exact.with_channels({}, motor_angle_rad=counts * count_rad)
    with workers(1) as pool:
        material = make_material([recording], model, Mode.TORQUE_POSITION, 0, pool)
        (searched,) = material.searched(model)
        whole = material.fine[0].predict(model)  # every sample
        predicted = material.predictions(model, [[]])[0]
        assert not np.any(material.correction(model, [[]], (searched,))[0])
    unit = np.where(searched.observations.channel == 0, NOISE_NM, count_rad / np.sqrt(12.0))
    off = np.abs(predicted - whole) / unit
    known_to = np.sqrt(covariance(searched, model).own) / unit
    assert off.max() > 4.0  # a reading meets a jump
    assert np.all(off < 2.0 * known_to)  # 1.7 is the most of a uniform distribution
    assert np.mean(known_to < 1.2) > 0.9


@pytest.mark.parametrize(("bump", "is_idle"), [(1e-6, True), (-0.1, False)])
def test_how_far_a_slip_runs_on_is_no_work_of_an_effect(*, bump: float, is_idle: bool) -> None:
    """Friction over position takes the implicit solver, by which another part of a cable slips."""
    model, time_s = parse_model(STICKING), np.arange(12_000) * 1e-3
    stroke = np.clip((time_s % 1.5) / 0.8, 0.0, 1.0)  # strokes with a rest after each
    corner_rad = np.random.default_rng(5).uniform(-0.6, 0.6, 9)
    at = (time_s // 1.5).astype(int)
    load_rad = corner_rad[at] + np.diff(corner_rad)[at] * stroke**2 * (3.0 - 2.0 * stroke)
    torque_nm = 0.12 * np.sin(2 * np.pi * 0.31 * time_s)
    recording = recorded(model, time_s, load_rad, torque_nm)
    effects = [(BUMP, {"bump_a": bump, "centre_rad": 0.0, "width_rad": 0.1})]
    with workers(1) as pool:
        material = make_material([recording], model, Mode.TORQUE_POSITION, 1, pool)
        searched = as_searched(model)
        problem = material.problem(parameters_with(searched, []))
        like = descend(problem, problem.start(), problem.noises(problem.start()), NONE, rounds=0)
        assert like is not None
        start = start_of(material, searched, effects, {}, like)
        assert start is not None
        assert idle(start.unmoved()) == ([0] if is_idle else [])
