from __future__ import annotations

import json
from pathlib import Path

import pytest
from bowden.cli.main import main


def test_figures_for_programs_on_stdout_finding_for_people_on_stderr(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["experiment", "1a", "--json"]) == 0
    shown = capsys.readouterr()
    document = json.loads(shown.out)
    assert document["experiment"] == "1a"
    assert [case["label"] for case in document["cases"]] == ["5 N", "10 N", "15 N", "20 N"]
    assert document["beside"]["preset"] == "transmitting"
    assert "No torque arrives" in shown.err
    assert main(["experiment", "1a"]) == 0
    assert capsys.readouterr().out == ""


def test_the_page_is_written_whole(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert main(["experiment", "3", "--gains", "2", "0", "--report", str(page)]) == 0
    text = page.read_text()
    assert text.rstrip().endswith("</html>")
    assert "50.0 %" in text


def test_a_rig_of_ones_own_on_a_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "rig.yaml"
    model.write_text(
        """
rig:
  cable:
    length_m: 1.0
    axial_stiffness_n: 4000
    path: [{length_m: 1.0, radius_m: .inf}]
    pretension_n: 10
  motor_pulley_radius_m: 0.02
  load_pulley_radius_m: 0.1
friction: {law: coulomb, mu_d: 0.2}
"""
    )
    command = ["experiment", "1a", "--model", str(model), "--segments", "5", "--json"]
    assert main(command) == 0
    cases = json.loads(capsys.readouterr().out)["cases"]
    # Straight conduit takes nothing.
    assert [case["steady_cycle"]["efficiency"] for case in cases] == pytest.approx([1.0] * 4)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["9"], "invalid choice"),
        (["2", "--segments", "0"], "segments"),
        (["2", "--segments", "5", "--solver", "mesh_free"], "not allowed"),
        (["2", "--gains", "1", "1"], "experiment 3"),
        (["3", "--gains", "0", "1"], "gains"),
        (["2", "--model", "nowhere.yaml"], "nowhere.yaml"),
        (["1a", "--set", "cable.pretension_n=3"], "--start-rig, which it is for"),
        (["3", "--duration", "nan"], "--duration"),
        (["3", "--report", "nowhere/page.html"], "page.html"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        status = main(["experiment", *arguments])
    except SystemExit as exit_:
        status = int(exit_.code or 0)
    assert status == 2
    shown = capsys.readouterr().err
    assert complaint in shown
    assert shown.count("\n") == 1
