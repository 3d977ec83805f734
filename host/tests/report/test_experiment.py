from __future__ import annotations

import re

import numpy as np
import pytest
from bowden.model.experiments import Experiment, run_experiment
from bowden.report import experiment_plots as plots
from bowden.report.experiment import experiment_report, figures_table


@pytest.fixture(scope="module", params=["1a", "2", "3"])
def experiment(request: pytest.FixtureRequest) -> Experiment:
    return run_experiment(request.param)


def test_the_page_stands_alone_and_says_what_was_found(experiment: Experiment) -> None:
    page = experiment_report(experiment)
    assert page.startswith("<!DOCTYPE html>")
    assert page.rstrip().endswith("</html>")
    assert experiment.title.split(":")[0] in page
    markup = re.sub(r"<script[^>]*>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"(src|href)=", markup)
    assert "<script src" not in page
    assert len(page) < 1e6
    ids = re.findall(r'<figure id="([^"]+)"', page)
    assert len(ids) == len(set(ids)) >= 2
    if experiment.beside is not None:
        assert "where torque arrives" in page


def test_the_table_has_first_and_steady_cycle_of_every_case(experiment: Experiment) -> None:
    header, rows = figures_table(experiment)
    assert all(len(row) == len(header) for row in rows)
    assert [row[1] for row in rows] == ["first", "steady"] * len(experiment.cases)


def test_a_silent_load_is_drawn_as_a_flat_line() -> None:
    experiment = run_experiment("1a")
    arrived = [t for t in plots.locked_load(experiment.cases).data if t.xaxis == "x2"]
    assert [np.ptp(t.y) for t in arrived if t.name != "lossless"] == [0.0] * 4
    assert experiment.beside is not None
    louder = [t for t in plots.locked_load(experiment.beside.cases).data if t.xaxis == "x2"]
    assert all(np.ptp(t.y) > 10.0 for t in louder)  # mN m


def test_both_ends_of_the_ideal_follower_are_mirror_images() -> None:
    figure = plots.sharing(run_experiment("3").cases, 4.0)
    motor, load = (t for t in figure.data if t.xaxis == "x")
    assert np.max(motor.y) == pytest.approx(-np.min(load.y), rel=1e-6)
    assert np.max(motor.y) == pytest.approx(1.56, rel=1e-6)
