"""`diagnose` with as many recordings as a lab has."""

from __future__ import annotations

import numpy as np
from bowden.diagnosis.diagnose import diagnose
from bowden.model import parse_model

from ..rigs import TABLE_1, experiment_2


def test_five_recordings_get_a_verdict() -> None:
    rig = parse_model(TABLE_1).with_effect("viscous_friction", {"mu_v_s_per_m": 0.5})
    runs = []
    for seed in range(5):
        run = experiment_2(rig, seconds=2.5)
        noise = np.random.default_rng(seed).normal(0.0, 2e-3, run.time_s.size)
        runs.append(
            run.with_channels(load_torque_nm=run.load_torque_nm + noise).select(slice(0, None, 5))
        )
    found = diagnose(parse_model(TABLE_1), runs, names=["viscous_friction", "load_cell_gain"])
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["viscous_friction"]
    assert {one.source for one in found.series} == {"made by the model"}
    # Four folds of blocks, and each whole recording by fits that have seen none of it.
    assert found.validation is not None
    held_out = [one.held_out for one in found.validation.splits]
    assert sum(text.startswith("recording") for text in held_out) == 5
    assert [one.explanation for one in found.validation.splits] == ["viscous_friction"] * 9
