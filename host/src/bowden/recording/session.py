"""A session: recordings of one rig and what they share (zeros, path, tool), from a YAML side file.

    rig: Tool 5, left spindle
    shared: {zeros: day 1, tool: "5"}
    recordings:
    - {file: run_05.csv, path: roll 0}
    - {file: run_06.csv.gz, path: roll 90, notes: after the pause}

Recordings of one group have one number where others have one each: the same sensor zeros, the same
path of the cables, the same tool. `signals` and `estimation` read the groups; this module reads and
writes files only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

from pydantic import Field

from bowden.errors import BadInput
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden.recording.yaml_file import FilePart, read_yaml, write_yaml

#: What recordings of a session can share.
Shared = Literal["zeros", "path", "tool"]
SHARED: tuple[Shared, ...] = get_args(Shared)

#: File endings that mean a session.
SESSION_ENDINGS = (".yaml", ".yml")


class Groups(FilePart):
    """Group labels; recordings with the same label share that thing."""

    zeros: str | None = Field(default=None, min_length=1)
    path: str | None = Field(default=None, min_length=1)
    tool: str | None = Field(default=None, min_length=1)


class SessionEntry(Groups):
    """One recording of the file, relative to it."""

    file: str = Field(min_length=1)
    notes: str | None = None


class SessionFile(FilePart):
    """The whole file; `shared` holds for every recording that does not say otherwise."""

    rig: str = Field(min_length=1)
    shared: Groups = Groups()
    recordings: tuple[SessionEntry, ...] = Field(min_length=1)
    notes: str | None = None


@dataclass(frozen=True)
class Session:
    """Recordings of one rig, with the group of each.

    Parameters
    ----------
    rig : str
        Its name.
    recordings : tuple of Recording
        In the order of the file.
    groups : dict of str to tuple of str
        For ``"zeros"``, ``"path"`` and ``"tool"``, the label of each recording.
    """

    rig: str
    recordings: tuple[Recording, ...]
    groups: Mapping[Shared, tuple[str, ...]]

    def since(self, seconds: float) -> Session:
        """Return the session with the first seconds of each recording before it, not in it."""
        return replace(self, recordings=tuple(one.since(seconds) for one in self.recordings))

    def members(self, shared: Shared) -> dict[str, tuple[int, ...]]:
        """Return the recordings' numbers by group, in the order of first mention."""
        found: dict[str, tuple[int, ...]] = {}
        for number, label in enumerate(self.groups[shared]):
            found[label] = (*found.get(label, ()), number)
        return found


def read_session(path: str | Path) -> Session:
    """Read a session file and its recordings.

    A recording without tool or path shares them with the rig (the group is the rig's name). One
    without zeros has zeros of its own (the group is the file's name), since sensors may be zeroed
    between runs.

    Raises
    ------
    BadInput
        What `read_yaml` and `read_recording` raise, or a file that is listed twice.
    """
    path = Path(path)
    content = read_yaml(path, SessionFile, "a session file (YAML)")
    files = [(path.parent / entry.file).resolve() for entry in content.recordings]
    for number, entry in enumerate(content.recordings):
        if files[number] in files[:number]:
            raise BadInput(
                f"{path}, recordings[{number}].file", f"{entry.file} again", "each recording once"
            )
    recordings = []
    for number, entry in enumerate(content.recordings):
        try:
            recordings.append(read_recording(path.parent / entry.file))
        except BadInput as error:
            where = f"{path}, recordings[{number}].file, {error.where}"
            raise BadInput(where, error.found, error.accepted) from error
    groups = {
        shared: tuple(_label(shared, entry, content) for entry in content.recordings)
        for shared in SHARED
    }
    return Session(content.rig, tuple(recordings), groups)


def require_once(paths: Iterable[str | Path]) -> None:
    """Refuse a recording that is given twice: it would count twice, or be held out and fitted.

    Raises
    ------
    BadInput
        Names the second of them.
    """
    seen: set[Path] = set()
    for one in paths:
        if (path := Path(one).resolve()) in seen:
            raise BadInput(str(one), "the same recording again", "each recording once")
        seen.add(path)


def read_recordings(paths: Sequence[str | Path]) -> Session:
    """Read what a command line names: one session file, or recordings of one rig.

    Recordings without a session share tool and path, and have zeros of their own.

    Raises
    ------
    BadInput
        What `read_session` and `read_recording` raise, a session among other files, or a recording
        twice.
    """
    found = [Path(path) for path in paths]
    require_once(found)
    sessions = [path for path in found if path.suffix.lower() in SESSION_ENDINGS]
    if sessions and len(found) > 1:
        raise BadInput(
            str(sessions[0]),
            "a session file among other files",
            "one session file, or recordings (list them all in the session)",
        )
    if sessions:
        return read_session(sessions[0])
    recordings = tuple(read_recording(path) for path in found)
    rig = next((one.metadata["rig"] for one in recordings if "rig" in one.metadata), "rig")
    own = tuple(str(path) for path in found)
    one_rig = tuple(rig for _ in found)
    return Session(rig, recordings, {"zeros": own, "path": one_rig, "tool": one_rig})


def write_session(path: Path, content: SessionFile) -> None:
    """Write a session file, whole or not at all."""
    write_yaml(path, content)


def _label(shared: Shared, entry: SessionEntry, content: SessionFile) -> str:
    own: str | None = getattr(entry, shared)
    every: str | None = getattr(content.shared, shared)
    return own or every or (entry.file if shared == "zeros" else content.rig)
