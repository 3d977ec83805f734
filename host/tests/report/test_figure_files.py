"""Figures as files: drawings that stand alone, data that is all there, and named refusals."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import bowden
import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
from bowden.cli.main import main
from bowden.report.figure_files import standalone, write_figure


@pytest.fixture
def plot() -> go.Figure:
    x = np.linspace(0.0, 1.0, 5000)
    figure = go.Figure()
    figure.add_scatter(x=x, y=np.sin(9 * x), name='measured, "a"', line={"color": "#1a1a1a"})
    figure.add_scatter(x=x, y=np.cos(9 * x), name="simulated", line={"color": "#0072b2"})
    figure.update_xaxes(title="load angle (°)")
    figure.update_yaxes(title="load torque (N m)")
    return figure


def test_a_drawing_stands_alone_with_its_colours_and_words(plot: go.Figure) -> None:
    text = standalone(plot)
    root = ET.fromstring(text)
    assert float(root.attrib["width"]) > 0.0
    assert "var(" not in text  # of a page's style
    assert "#0072b2" in text
    assert "load torque (N m)" in "".join(root.itertext())


def test_the_data_holds_every_sample_of_every_curve(plot: go.Figure, tmp_path: Path) -> None:
    write_figure(plot, tmp_path / "loop.csv")
    table = pd.read_csv(tmp_path / "loop.csv")
    assert list(table.columns) == ["curve", "x", "y"]
    for trace in plot.data:
        rows = table[table.curve == trace.name]
        np.testing.assert_allclose(rows.y, trace.y, rtol=1e-8, atol=1e-12)  # nine digits


def test_a_pdf_is_written(plot: go.Figure, tmp_path: Path) -> None:
    pytest.importorskip("cairosvg")
    write_figure(plot, tmp_path / "loop.pdf")
    content = (tmp_path / "loop.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    assert content.rstrip().endswith(b"%%EOF")


def test_what_cannot_be_written_is_refused_by_name(
    plot: go.Figure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(bowden.BadInput, match=r"ends in '\.png'; accepted: \.svg, \.pdf, \.csv"):
        write_figure(plot, tmp_path / "loop.png")
    monkeypatch.setitem(__import__("sys").modules, "cairosvg", None)
    with pytest.raises(bowden.BadInput, match=r"bowden\[pdf\]"):
        bowden.write_figures(bowden.table_1(), tmp_path / "figures", [".pdf"])
    assert not list(tmp_path.iterdir())


def test_compare_writes_the_figures_of_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    time_s = np.arange(0.0, 4.0, 4e-3)
    given = bowden.Recording(
        time_s, load_angle_rad=0.5 * np.sin(3 * time_s), motor_torque_nm=0.1 * np.sin(2 * time_s)
    )
    model = bowden.table_1()
    run = bowden.simulate(model, given)
    noise = 2e-3 * np.random.default_rng(0).standard_normal(time_s.size)
    bowden.write_csv(run.with_channels(load_torque_nm=run.load_torque_nm + noise), Path("run.csv"))
    bowden.write_model(model, "rig.yaml")
    arguments = ["compare", "rig.yaml", "run.csv", "--figures", "figures", "--figure-form", "svg"]
    assert main(arguments) == 0
    assert {path.name for path in Path("figures").iterdir()} == {
        "time.svg",
        "loop.svg",
        "conditions.svg",
    }
    assert "figure: figures/loop.svg" in capsys.readouterr().err
    assert main(["compare", "rig.yaml", "run.csv", "--figure-form", "pdf"]) == 2
    assert "--figures DIR" in capsys.readouterr().err
