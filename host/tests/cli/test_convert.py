from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.recording.csv_file import read_csv

MEASURED = Path(__file__).resolve().parents[4] / "shared" / "measured" / "mrd_da_vinci_tool"


@pytest.mark.skipif(not MEASURED.is_dir(), reason=f"measured data not there: {MEASURED}")
def test_a_real_run_becomes_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = MEASURED / "Tool_5_Maryland_L_3_05.TXT", tmp_path / "tool.csv"
    assert main(["convert", str(source), "--from", "mrd", "--output", str(out)]) == 0
    recording = read_csv(out)
    assert recording.time_s.size == 19_500
    assert "motor_current_a" in recording.channels
    assert "Open Database License" in recording.metadata["data_source"]
    assert "sign" in capsys.readouterr().err
    cut = ["--startup", "2.5", "--distal-zero", "-210"]
    assert main(["convert", str(source), "--from", "mrd", "--output", str(out), *cut]) == 0
    assert np.isclose(read_csv(out).time_s[-1], 17.499)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["none.TXT", "--from", "mrd"], "none.TXT"),
        (["none.blf", "--from", "blf"], "none.blf"),
        (["bad.TXT", "--from", "mrd"], "bad.TXT, line 1"),
        (["bad.TXT", "--from", "mrd", "--startup", "-1"], "--startup"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    complaint: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.TXT").write_text("1,2,3\n")
    assert main(["convert", *arguments, "--output", "out.csv"]) == 2
    shown = capsys.readouterr().err
    assert complaint in shown
    assert shown.count("\n") == 1
    assert not Path("out.csv").exists()
