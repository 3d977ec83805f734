"""Effects of a user's own: the docs' example as a file, and files that make no sense."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.model.effects import CATALOGUE
from bowden.recording.csv_file import read_csv

from .test_simulate import MODEL, inputs

DOCS = Path(__file__).parents[3] / "docs" / "effects.md"


@pytest.fixture(autouse=True)
def catalogue_as_it_was() -> Iterator[None]:
    before = dict(CATALOGUE)
    yield
    CATALOGUE.clear()
    CATALOGUE.update(before)


def own(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(text)
    return path


def simulated(tmp_path: Path, effects: str, *more: str) -> np.ndarray:
    model = tmp_path / "rig.yaml"
    model.write_text(MODEL.replace("effects: []", f"effects: [{effects}]"))
    time_s = np.arange(400) * 1e-3
    given = inputs(tmp_path, 0.05 * np.sin(10.0 * time_s), 0.1 * np.sin(7.0 * time_s))
    out = tmp_path / "out.csv"
    command = ["simulate", str(model), "--input", str(given), "--mode", "torque-position"]
    assert main([*command, "--output", str(out), *more]) == 0
    return read_csv(out).load_torque_nm


def test_the_effect_of_the_docs_is_simulated_from_a_file(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", DOCS.read_text("utf-8"), re.S)
    path = own(tmp_path, code + "\nEFFECTS = (EFFECT,)\n")
    true = simulated(tmp_path, "")
    read = simulated(tmp_path, "{name: load_cell_bend, c_per_nm: 0.05}", "--effects", str(path))
    # A file holds nine digits.
    np.testing.assert_allclose(read, true + 0.05 * true * np.abs(true), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("EFFECT = 3", "EFFECTS: found None"),
        ("EFFECTS = (3,)", "EFFECTS: found 3, accepted: an Effect"),
        (
            "from dataclasses import replace\nfrom bowden.model.effects import CATALOGUE\n"
            "EFFECTS = (replace(CATALOGUE['wear'], title='mine'),)",
            "found an effect called wear, which is taken",
        ),
    ],
)
def test_a_file_that_makes_no_sense_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    model = tmp_path / "rig.yaml"
    model.write_text(MODEL)
    with pytest.raises(SystemExit) as ended:
        main(["compare", str(model), "a.csv", "--effects", str(own(tmp_path, text))])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert said in line
    assert "mine.py" in line
