"""What a fit knows, in ArviZ: means, correlations and units are those of the model file."""

from __future__ import annotations

import sys
from pathlib import Path

import bowden
import numpy as np
import pytest
from bowden.diagnosis.wording import stopped
from bowden.estimation.gate.finding import Finding
from bowden.model import Mode, parse_model

TABLE_1 = Path(__file__).resolve().parents[3] / "docs" / "examples" / "table_1.yaml"
LAW = """\
effects:
- {name: learned, place: friction_factor, arguments: [load_angle_rad, direction],
   x: [-0.5, 0.0, 0.5], values: [-0.2, 0.0, 0.2]}
posterior:
  paths: [rig.cable.pretension_n, friction.mu_d, "effects[0].values[0]", "effects[0].values[1]",
          "effects[0].values[2]"]
  covariance:
  - [0.04, -0.0009, 0, 0, 0]
  - [-0.0009, 0.000025, 0, 0, 0]
  - [0, 0, 0.0001, 0, 0]
  - [0, 0, 0, 0.0001, 0.00005]
  - [0, 0, 0, 0.00005, 0.0001]
"""


@pytest.fixture
def model() -> bowden.Model:
    lines = TABLE_1.read_text().replace("effects: []\n", "")
    return parse_model(lines + LAW, "extended.yaml")


def test_draws_have_the_posterior_of_the_model_file(model: bowden.Model, tmp_path: Path) -> None:
    draws = bowden.to_arviz(model, draws=5000, seed=1).posterior
    tension, mu = draws["rig.cable.pretension_n"], draws["friction.mu_d"]
    assert tension.dims == ("chain", "draw")
    # 20 000 draws: a mean is known to 1/140 of its sigma, four of those.
    assert float(tension.mean()) == pytest.approx(10.0, abs=4 * 0.2 / 140)
    assert float(mu.std()) == pytest.approx(0.005, rel=0.03)
    correlation = np.corrcoef(tension.values.ravel(), mu.values.ravel())[0, 1]
    assert correlation == pytest.approx(-0.9, abs=0.02)
    law = draws["effects[0].values"]
    assert law.coords["effects[0].load_angle_rad"].values.tolist() == [-0.5, 0.0, 0.5]
    assert law.mean(("chain", "draw")).values == pytest.approx([-0.2, 0.0, 0.2], abs=1e-3)
    again = bowden.to_arviz(model, draws=5000, seed=1)
    path = tmp_path / "posterior.nc"
    again.to_netcdf(str(path))
    assert again.posterior["friction.mu_d"].equals(mu)
    assert path.stat().st_size > 0


def test_a_law_of_two_arguments_is_over_both() -> None:
    text = TABLE_1.read_text().replace("effects: []\n", LAW)
    text = text.replace("load_angle_rad, direction", "load_angle_rad, motor_torque_nm")
    text = text.replace("x: [-0.5, 0.0, 0.5]", "x: [-0.5, 0.5], y: [-0.1, 0.1]")
    text = text.replace("values: [-0.2, 0.0, 0.2]", "values: [-0.2, 0.0, 0.2, 0.3]")
    law = bowden.to_arviz(parse_model(text), draws=2000).posterior["effects[0].values"]
    assert law.dims[2:] == ("effects[0].load_angle_rad", "effects[0].motor_torque_nm")
    assert law.coords["effects[0].motor_torque_nm"].values.tolist() == [-0.1, 0.1]
    found = law.mean(("chain", "draw")).values
    # 8000 draws of a sigma of 0.01; the posterior in the file says nothing of the fourth knot.
    assert found == pytest.approx(np.array([[-0.2, 0.0], [0.2, np.nan]]), abs=1e-3, nan_ok=True)


def test_what_has_no_posterior_says_what_would_have_one(model: bowden.Model) -> None:
    with pytest.raises(bowden.BadInput, match=r"no posterior; accepted: a model that calibrate"):
        bowden.to_arviz(bowden.table_1())
    with pytest.raises(bowden.BadInput, match="draws: found 0; accepted: 1 or more"):
        bowden.to_arviz(model, draws=0)


def test_without_arviz_the_extra_is_named(
    model: bowden.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(bowden.BadInput, match=r"pip install 'bowden\[arviz\]'"):
        bowden.to_arviz(model)


def test_bad_data_extends_no_model_and_pages_are_of_results(tmp_path: Path) -> None:
    finding = Finding("unit", "load torque", "zeros", "a load cell", "stop")
    found = stopped(bowden.table_1(), Mode.TORQUE_POSITION, (finding,), (), 0)
    with pytest.raises(bowden.BadInput, match="bad data"):
        bowden.extend(found, tmp_path / "extended.yaml")
    assert list(tmp_path.iterdir()) == []
    page = bowden.write_report(found, tmp_path / "page.html")
    assert "cannot be trusted" in page.read_text()
    with pytest.raises(bowden.BadInput, match="write_report: found int"):
        bowden.write_report(1, tmp_path / "other.html")  # type: ignore[arg-type]
