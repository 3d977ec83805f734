"""A session file: recordings of one rig with what they share; every mistake is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording
from bowden.recording.session import (
    Groups,
    SessionEntry,
    SessionFile,
    read_recordings,
    read_session,
    write_session,
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "runs").mkdir()
    for number, name in enumerate(["a.csv", "b.csv.gz", "c.csv"]):
        one = Recording(np.arange(3.0), motor_angle_rad=np.full(3, number), metadata={"rig": "R"})
        write_csv(one, tmp_path / "runs" / name)
    return tmp_path


def session(folder: Path, text: str) -> Path:
    path = folder / "session.yaml"
    path.write_text(text)
    return path


def test_groups_come_from_the_recording_then_from_what_all_share_then_from_the_rig(
    folder: Path,
) -> None:
    text = """
rig: wrist
shared: {path: straight}
recordings:
- {file: runs/a.csv, zeros: monday}
- {file: runs/b.csv.gz, zeros: monday, path: bent}
- {file: runs/c.csv, notes: after a rest}
"""
    found = read_session(session(folder, text))
    assert found.rig == "wrist"
    assert [one.motor_angle_rad[0] for one in found.recordings] == [0, 1, 2]
    assert found.groups["path"] == ("straight", "bent", "straight")
    assert found.groups["tool"] == ("wrist",) * 3
    # Sensors may be zeroed between runs: without a word, a recording has zeros of its own.
    assert found.members("zeros") == {"monday": (0, 1), "runs/c.csv": (2,)}


def test_what_is_written_is_read_back(folder: Path) -> None:
    entries = tuple(
        SessionEntry(file=f"runs/{name}", zeros="x: 1", notes="# no remark")
        for name in ("a.csv", "b.csv.gz")
    )
    content = SessionFile(rig="8", shared=Groups(tool="5"), recordings=entries)
    write_session(folder / "s.yaml", content)
    found = read_session(folder / "s.yaml")
    assert (found.rig, found.groups["tool"]) == ("8", ("5", "5"))
    assert found.groups["zeros"] == ("x: 1", "x: 1")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("rig: r\nrecordings: [{file: runs/none.csv}]", r"recordings\[0\]\.file, .*No such file"),
        ("rig: r\nrecordings: []", "recordings: .* at least 1 item"),
        ("rig: r\nrecordings: [{file: runs/a.csv, zero: x}]", r"recordings\[0\]\.zero: unknown"),
        ("rig: r\nrecordings: [{file: runs/a.csv, path: 3}]", r"\[0\]\.path: '3', .*valid string"),
        ("recordings: [{zeros: x}]", r"rig: missing; recordings\[0\]\.file: missing"),
        ("rig: r\nrecordings:\n- {file: runs/a.csv}\n- {file: runs/a.csv}", "a.csv again"),
        ("rig: r\nrecordings:\n- {file: runs/a.csv}\n- {file: runs/../runs/a.csv}", "a.csv again"),
        ("rig: [", "line 1"),
        ("rig: r\nrig: s", "line 2"),
        ("", "no keys"),
        ("- a", "no keys"),
    ],
)
def test_mistakes_are_named_with_their_field(folder: Path, text: str, told: str) -> None:
    with pytest.raises(BadInput, match=rf"(?s)session\.yaml.*{told}"):
        read_session(session(folder, text))


def test_a_command_line_names_recordings_or_one_session(folder: Path) -> None:
    paths = [folder / "runs" / "a.csv", folder / "runs" / "c.csv"]
    found = read_recordings(paths)
    assert found.rig == "R"
    assert len(found.members("zeros")) == 2
    assert len(found.members("path")) == len(found.members("tool")) == 1
    one = session(folder, "rig: r\nrecordings: [{file: runs/a.csv}]")
    assert len(read_recordings([one]).recordings) == 1
    with pytest.raises(BadInput, match=r"runs/\.\./runs/a\.csv: found the same recording again"):
        read_recordings([*paths, folder / "runs" / ".." / "runs" / "a.csv"])
    with pytest.raises(BadInput, match="a session file among other files"):
        read_recordings([*paths, one])
