from __future__ import annotations

import numpy as np
import pytest
from bowden.model import Model, ModelError, format_model
from bowden.model.experiments import as_printed, single_case
from bowden.model.sweep import SweepAxis, grid, parse_axis, random_draws, run_points

T0 = "rig.cable.pretension_n"
MU = "friction.mu_d"


@pytest.fixture(scope="module")
def model() -> Model:
    return as_printed()


@pytest.mark.parametrize(
    ("text", "axis"),
    [
        (f"{T0}=5:20:4", SweepAxis(T0, (5.0, 10.0, 15.0, 20.0))),
        (f"{MU}=0.1,0.2", SweepAxis(MU, (0.1, 0.2))),
        (f"{MU}=0.1", SweepAxis(MU, (0.1,))),
        (f"{T0}=1:2", SweepAxis(T0, (1.0, 2.0), is_range=True)),
    ],
)
def test_axes_as_users_write_them(text: str, axis: SweepAxis) -> None:
    assert parse_axis(text) == axis


@pytest.mark.parametrize(
    "text", ["", "x", "x=", "x=a", "x=1:2:3:4", "x=1:2:0", "x=1:2:2.5", "x=:", "x=1,,2"]
)
def test_other_axes_are_refused(text: str) -> None:
    with pytest.raises(ModelError, match="--vary"):
        parse_axis(text)


def test_a_grid_is_every_combination(model: Model) -> None:
    sweep = grid(model, "1", [SweepAxis(T0, (1.0, 2.0)), SweepAxis(MU, (0.1, 0.2, 0.3))])
    assert sweep.points == ((1.0, 0.1), (1.0, 0.2), (1.0, 0.3), (2.0, 0.1), (2.0, 0.2), (2.0, 0.3))
    assert sweep.values(4) == {T0: 2.0, MU: 0.2}


def test_random_draws_stay_in_range_and_follow_the_seed(model: Model) -> None:
    axes = [SweepAxis(T0, (1.0, 3.0), is_range=True), SweepAxis(MU, (0.1, 0.2))]
    sweep = random_draws(model, "1", axes, 400, seed=3)
    tension, mu = np.array(sweep.points).T
    assert 1.0 <= tension.min() < tension.max() <= 3.0
    assert tension.mean() == pytest.approx(2.0, abs=4 * 2 / np.sqrt(12 * 400))  # four sigma
    assert set(mu) == {0.1, 0.2}
    assert sweep == random_draws(model, "1", axes, 400, seed=3)
    assert sweep.digest != random_draws(model, "1", axes, 400, seed=4).digest


def test_the_digest_knows_what_decides_the_rows(model: Model) -> None:
    axes = [SweepAxis(T0, (1.0, 2.0))]
    one = grid(model, "1", axes)
    assert one.digest == grid(model, "1", axes).digest
    others = [
        grid(model, "2", axes),
        grid(model, "1", [SweepAxis(T0, (1.0, 2.5))]),
        grid(model, "1", [SweepAxis(MU, (0.3, 0.4))]),
        grid(model.with_values({MU: 0.3}), "1", axes),
    ]
    assert len({sweep.digest for sweep in (one, *others)}) == 5


def test_a_row_is_the_experiment_on_that_model(model: Model) -> None:
    (row,) = run_points(format_model(model), "1", [(7, {T0: 1.0})])
    case = single_case("1", model.with_values({T0: 1.0}))
    assert row["index"] == 7
    assert row[T0] == 1.0
    assert row["steady_efficiency"] == case.steady.efficiency == pytest.approx(np.exp(-1.5))
    assert row["steady_loss_j"] == case.steady.loss_j
    assert row["error"] is None
    assert set(row) == set(grid(model, "1", [SweepAxis(T0, (1.0,))]).columns)


def test_a_point_that_no_rig_can_be_says_so_in_its_row(model: Model) -> None:
    # A radius of 1 mm makes a wrap that the mesh-free solution refuses; the others go on.
    radius = "rig.cable.path[0].radius_m"
    good, bad = run_points(format_model(model), "1", [(0, {radius: 0.2}), (1, {radius: 1e-3})])
    assert good["error"] is None
    assert "wrap" in str(bad["error"])


@pytest.mark.parametrize(
    ("axes", "complaint"),
    [
        ([], "none"),
        ([SweepAxis("rig.cabel", (1.0,))], "cabel"),
        ([SweepAxis(T0, (1.0, -1.0))], "pretension"),
        ([SweepAxis(T0, (1.0,)), SweepAxis(T0, (2.0,))], "twice"),
        ([SweepAxis(T0, (1.0, 2.0), is_range=True)], "count"),
    ],
)
def test_what_cannot_be_varied_is_refused_before_anything_runs(
    model: Model, axes: list[SweepAxis], complaint: str
) -> None:
    with pytest.raises(ModelError, match=complaint):
        grid(model, "1", axes)


def test_no_draws_are_refused(model: Model) -> None:
    with pytest.raises(ModelError, match="--random"):
        random_draws(model, "1", [SweepAxis(T0, (1.0, 2.0), is_range=True)], 0, seed=1)
