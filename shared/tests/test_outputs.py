"""The committed outputs are what the generator makes, and the command says so."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shared.dictionary import __main__ as command
from shared.dictionary import outputs
from shared.dictionary.outputs import ROOT, SOURCE, build


def test_committed_files_are_up_to_date() -> None:
    for path, text in outputs.outputs(SOURCE).items():
        assert (ROOT / path).read_text(encoding="utf-8") == text, f"{path} is stale"


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository in which the command may write."""
    for path in [*outputs.outputs(SOURCE), Path(".clang-format")]:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, tmp_path / path)
    monkeypatch.setattr(command, "ROOT", tmp_path)
    monkeypatch.setattr(outputs, "ROOT", tmp_path)
    return tmp_path


def test_check_names_what_is_stale_and_changes_nothing(
    copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    eds = copied / "shared" / "generated" / "bowden.eds"
    eds.write_text(eds.read_text() + "; by hand\n")
    (copied / "docs" / "object-dictionary.md").unlink()
    edited = eds.read_text()
    assert command.main(["--check"]) == 1
    assert capsys.readouterr().err.splitlines() == [
        "shared/generated/bowden.eds: stale",
        "docs/object-dictionary.md: stale",
    ]
    assert eds.read_text() == edited
    assert command.main([]) == 0
    assert command.main(["--check"]) == 0
    assert eds.read_text() == (ROOT / "shared/generated/bowden.eds").read_text()


def test_a_bad_source_is_refused_and_nothing_is_written(
    copied: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    source = copied / "object_dictionary.yaml"
    source.write_text(SOURCE.read_text().replace("type: u8", "type: real32"))
    monkeypatch.setattr(command, "SOURCE", source)
    assert command.main([]) == 2
    assert "error_register" in capsys.readouterr().err
    for path, text in outputs.outputs(SOURCE).items():
        assert (copied / path).read_text(encoding="utf-8") == text


def test_hash_counts_what_matters_on_the_wire_only() -> None:
    text = SOURCE.read_text()
    original = build(text, "x").hash
    assert build(text.replace('doc: "mu_d"', 'doc: "another word"'), "x").hash == original
    assert build(text + "\n# a comment\n", "x").hash == original
    for change in (
        ("default: 210000", "default: 210001"),
        ("range: [0, 3000000]", "range: [0, 3000001]"),
        ("name: tunnel_stiffness", "name: tunnel_stiffnes"),
        ("map: [sample_counter_low, load_angle", "map: [sample_counter_low, motor_angle"),
        ("code: 0x7380", "code: 0x7381"),
    ):
        assert change[0] in text
        assert build(text.replace(*change), "x").hash != original, change
