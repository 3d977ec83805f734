"""`bowden convert`: any table, capture or folder becomes recordings, whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.recording.csv_file import read_csv
from bowden.recording.session import read_session

ROOT = Path(__file__).resolve().parents[3]
MEASURED = ROOT.parent / "shared" / "measured"
needs_measured = pytest.mark.skipif(
    not MEASURED.is_dir(), reason=f"measured data not there: {MEASURED}"
)
RUN = "Tool_5_Maryland_L_3_05"
MAP = """
time: {column: t, unit: ms}
channels:
  motor_angle_rad: {column: turns, unit: turns}
  motor_torque_nm: {column: amps, unit: A, torque_constant_nm_per_a: 0.05}
metadata: {rig: bench}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def table(name: str, start: int = 0) -> None:
    rows = "".join(f"{k};{k / 100};{k / 10}\n" for k in range(start, start + 20))
    Path(name).write_text(f"t;turns;amps\n{rows}")


def test_a_table_with_its_mapping(capsys: pytest.CaptureFixture[str]) -> None:
    table("in.csv")
    Path("map.yaml").write_text(MAP)
    assert main(["convert", "--map", "map.yaml", "in.csv", "out.csv.gz", "--json"]) == 0
    out = read_csv(Path("out.csv.gz"))
    np.testing.assert_allclose(out.motor_angle_rad, 2 * np.pi * np.arange(20) / 100)
    np.testing.assert_allclose(out.motor_torque_nm, 0.005 * np.arange(20))
    shown = capsys.readouterr()
    told = json.loads(shown.out)
    assert told["channels"] == ["motor_angle_rad", "motor_torque_nm"]
    assert told["samples"] == 20
    # A motor-only rig: what follows is said.
    assert "no load_angle_rad: mode torque-position cannot run" in told["consequences"]
    assert "position-torque cannot run" in shown.err
    # Whoever needs the load names it, in one line.
    model = ROOT / "docs" / "examples" / "table_1.yaml"
    for command in ("compare", "diagnose", "calibrate"):
        assert main([command, str(model), "out.csv.gz"]) == 2
        refused = capsys.readouterr().err
        assert "load_angle_rad" in refused
        assert refused.count("\n") == 1


def test_a_folder_of_tables_becomes_a_session() -> None:
    Path("logs").mkdir()
    table("logs/a.csv")
    table("logs/b.txt", start=5)
    Path("map.yaml").write_text(MAP)
    assert main(["convert", "logs", "out", "--map", "map.yaml", "--rig", "arm"]) == 0
    one = ["convert", "logs/a.csv", "a.csv", "--map", "map.yaml", "--rig", "arm"]
    assert main(one) == 2  # one recording is no session, so its rig would be lost
    assert not Path("a.csv").exists()
    session = read_session(Path("out/session.yaml"))
    assert session.rig == "arm"
    assert session.members("zeros") == {"map": (0, 1)}
    # Each keeps its own angles: nothing is zeroed run by run.
    assert session.recordings[1].motor_angle_rad[0] == pytest.approx(2 * np.pi * 0.05)


@needs_measured
def test_a_real_run_becomes_a_recording(capsys: pytest.CaptureFixture[str]) -> None:
    source = str(MEASURED / "mrd_da_vinci_tool" / f"{RUN}.TXT")
    assert main(["convert", source, "--from", "mrd", "--output", "tool.csv"]) == 0
    recording = read_csv(Path("tool.csv"))
    assert recording.time_s.size == 19_500
    assert "motor_current_a" in recording.channels
    assert "Open Database License" in recording.metadata["data_source"]
    assert "sign" in capsys.readouterr().err
    cut = ["--startup", "2.5", "--distal-zero", "-210"]
    assert main(["convert", source, "tool.csv", "--from", "mrd", *cut]) == 0
    assert np.isclose(read_csv(Path("tool.csv")).time_s[-1], 17.499)


@needs_measured
def test_the_mapping_in_the_docs_says_what_the_importer_does() -> None:
    """Two ways to one recording: the general mapping, and the importer that knows the stand."""
    source = str(MEASURED / "mrd_da_vinci_tool" / f"{RUN}.TXT")
    mapping = str(ROOT / "docs" / "examples" / "mappings" / "surgical_tool.yaml")
    assert main(["convert", source, "mapped.csv", "--map", mapping]) == 0
    assert main(["convert", source, "known.csv", "--from", "mrd", "--startup", "0"]) == 0
    mapped, known = read_csv(Path("mapped.csv")), read_csv(Path("known.csv"))
    np.testing.assert_allclose(mapped.time_s, known.time_s, atol=1e-9)
    for name in mapped.channels:
        np.testing.assert_allclose(mapped[name], known[name], rtol=1e-12, atol=1e-12)


@needs_measured
def test_a_real_folder_becomes_a_session_with_paths() -> None:
    source = MEASURED / "mrd_roll_pitch"
    Path("some").mkdir()
    for run in ("Roll_1_000", "Roll_1_001", "Pitch_3_000"):
        name = f"Tool_4_Maryland_L_{run}.TXT.gz"
        Path("some", name).symlink_to(source / name)
    assert main(["convert", "some", "out", "--from", "mrd"]) == 0
    session = read_session(Path("out/session.yaml"))
    assert session.members("path") == {"Pitch_3": (0,), "Roll_1": (1, 2)}
    assert session.members("tool") == {"Tool_4_Maryland_L": (0, 1, 2)}


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["none.TXT", "out.csv", "--from", "mrd"], "none.TXT"),
        (["none.blf", "out.csv", "--from", "blf"], "none.blf"),
        (["bad.TXT", "out.csv", "--from", "mrd"], "bad.TXT, line 1"),
        (["bad.TXT", "out.csv", "--from", "mrd", "--startup", "-1"], "start-up: found -1"),
        (["bad.TXT", "out.csv", "--startup", "1"], "only with --from mrd"),
        (["bad.TXT"], "no output"),
        (["bad.TXT", "out.csv", "--output", "o.csv"], "OUT and --output"),
        (["bad.TXT", "bad.TXT", "--from", "mrd"], "the input as output"),
        (["bad.TXT", "out.csv", "--map", "none.yaml"], "none.yaml"),
        (["bad.TXT", "out.csv"], "without time_s"),
        (["bad.TXT", "out.csv", "--from", "mrd", "--map", "m.yaml"], "not allowed with"),
        (["empty", "out.csv"], "empty: found no file to convert"),
        (["empty", "bad.TXT"], "bad.TXT: found a file"),
    ],
)
def test_bad_input_is_one_line(
    capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    Path("bad.TXT").write_text("1,2,3\n")
    Path("empty").mkdir()
    try:
        assert main(["convert", *arguments]) == 2
    except SystemExit as left:
        assert left.code == 2  # noqa: PT017  (usage errors leave, others return)
    shown = capsys.readouterr().err
    assert complaint in shown
    assert shown.count("\n") == 1
    assert not Path("out.csv").exists()


def test_one_bad_table_writes_no_folder(capsys: pytest.CaptureFixture[str]) -> None:
    Path("logs").mkdir()
    table("logs/a.csv")
    Path("logs/b.csv").write_text("t;turns;amps\n0;x;1\n")
    Path("map.yaml").write_text(MAP)
    assert main(["convert", "logs", "out", "--map", "map.yaml"]) == 2
    assert "line 2, column 'turns': found 'x'" in capsys.readouterr().err
    assert not Path("out").exists()
    Path("logs/b.csv").unlink()
    table("logs/a.txt")
    assert main(["convert", "logs", "out", "--map", "map.yaml"]) == 2
    assert "another file that would become a.csv" in capsys.readouterr().err
