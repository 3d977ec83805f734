"""Outputs are written whole or not at all, and replace neither devices, links nor recordings."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from bowden.errors import BadInput
from bowden.recording.atomic import refuse_unwritable, replace_whole


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    with replace_whole(pipe) as temporary:
        temporary.write_text("report")
    reader.join()
    assert read == [b"report"]
    assert pipe.is_fifo()


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link.html").symlink_to("report.html")
    with replace_whole(tmp_path / "link.html") as temporary:
        temporary.write_text("report")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "report.html").read_text() == "report"


def test_a_full_device_is_named_and_not_replaced(tmp_path: Path) -> None:
    full = tmp_path / "full"
    full.symlink_to("/dev/full")
    with (
        pytest.raises(BadInput, match="full: found No space left on device"),
        replace_whole(full) as temporary,
    ):
        temporary.write_text("report")
    assert full.is_char_device()


@pytest.mark.parametrize(
    ("output", "found"),
    [
        ("missing/out.html", "No such file or directory"),
        ("folder", "a folder"),
        ("run.csv", "the input as output"),
        ("folder/../run.csv", "the input as output"),
    ],
)
def test_an_output_is_refused_before_anything_is_computed(
    output: str, found: str, tmp_path: Path
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "run.csv").write_text("measured")
    with pytest.raises(BadInput, match=found):
        refuse_unwritable([None, tmp_path / output], [tmp_path / "run.csv"])
    refuse_unwritable([None, tmp_path / "out.html"], [tmp_path / "run.csv"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "run.csv"]
    assert (tmp_path / "run.csv").read_text() == "measured"
