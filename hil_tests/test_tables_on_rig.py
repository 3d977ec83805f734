"""Effects that go to the drive as tables reduce its rendering error, on the simulated rig.

The drive has no load cell to help: what it renders is what its model is worth. The truth to reach
is a rig without the effect whose drive has that rig's true model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.demo_diagnosis import LAB_MODEL, RIG
from bowden.cli.demo_learned import CHANGE, WIDTH_RAD
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import reduced_model
from bowden.model import Model, parse_model
from bowden_rig.rig.hidden import hide

from hil_tests.benchmarks.applied import RENDERED_S, STARTS_S, rendered, rig_with, with_pile

LAB = parse_model(LAB_MODEL)


def rendering_error_nm(
    path: Path,
    hidden: Mapping[str, Mapping[str, float]],
    model: Model,
    settings: Sequence[str] = (),
    *,
    start_s: float = 0.0,
) -> float:
    """RMS of the rendered torque, on a rig with `hidden` whose drive has `model`."""
    rig = rig_with((*RIG, *settings))
    for name, values in hidden.items():
        rig = hide(rig, name, values)
    assert reduced_model(model).left_out == ()
    law = CompensationLaw.MODEL_INVERSION
    run = rendered(rig, model, law, path, length_s=RENDERED_S, start_s=start_s)
    return float(run.figures.rms_error_nm)


def over_starts_nm(folder: Path, hidden: Mapping[str, Mapping[str, float]], model: Model) -> float:
    """RMS over runs that start at every second of the benchmark's moments of the stroke."""
    errors = [
        rendering_error_nm(folder / f"{start_s}.blf", hidden, model, start_s=start_s)
        for start_s in STARTS_S[::2]
    ]
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.fixture(scope="module")
def truth_nm(tmp_path_factory: pytest.TempPathFactory) -> float:
    return over_starts_nm(tmp_path_factory.mktemp("truth"), {}, LAB)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("viscous_friction", {"mu_v_s_per_m": 0.3}),
        ("direction_asymmetry", {"a": 0.3}),
    ],
)
def test_an_applied_effect_renders_as_if_it_were_not_there(
    name: str, values: dict[str, float], truth_nm: float, tmp_path: Path
) -> None:
    without = rendering_error_nm(tmp_path / "without.blf", {name: values}, LAB)
    applied = over_starts_nm(tmp_path, {name: values}, LAB.with_effect(name, values))
    assert applied <= 1.2 * truth_nm
    assert applied < 0.9 * without


def test_a_law_that_no_catalogue_has_goes_to_the_drive_as_a_table(tmp_path: Path) -> None:
    law = with_pile(LAB, CHANGE, WIDTH_RAD)
    settings = (f"cable.pile_change={CHANGE}", f"cable.pile_width_rad={WIDTH_RAD}")
    without = rendering_error_nm(tmp_path / "without.blf", {}, LAB, settings)
    applied = rendering_error_nm(tmp_path / "applied.blf", {}, law, settings)
    # .34 on 11 s, with the true curve
    assert applied < 0.6 * without
