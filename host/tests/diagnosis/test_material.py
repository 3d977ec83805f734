"""The meshes that hypotheses are searched on, of rigs whose cables stick before they slide."""

from __future__ import annotations

import numpy as np
from bowden.diagnosis.material import as_fine, as_searched
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.model.experiments.variants import with_segments
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


def motor_angle_rad(model: Model) -> NDArray[np.float64]:
    """Three strokes of the load against a motor without torque."""
    time_s = np.arange(6000) * 1e-3
    load_rad = 0.5 * np.sin(2 * np.pi * 0.5 * time_s)
    inputs = Inputs(time_s=time_s, motor_torque_nm=np.zeros(time_s.size), load_angle_rad=load_rad)
    return simulate(model, Mode.TORQUE_POSITION, inputs).motor_angle_rad


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
