"""The JSON side file of a capture: what is needed to read its raw frames, and how it ended.

Named like the capture with ``.json`` behind it (``run.blf.json``). It holds the PDO layouts, so
that a capture can be read long after the object dictionary has moved on, and without a drive.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole

#: Of this version; a file of a later one is refused, its frames might mean something else.
FORMAT = 2


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class PdoField(_Part):
    """One field of a PDO: whole bytes, little endian; value = raw * scale in the column's unit."""

    name: str
    bits: int = Field(multiple_of=8, ge=8, le=64)
    signed: bool
    scale: float
    column: str


class PdoLayout(_Part):
    """One PDO of a sample, with its COB-ID on the wire (node id included)."""

    name: str
    cob_id: int
    fields: list[PdoField]


class Clock(_Part):
    """`clock.ClockFit` in the file."""

    drift_ppm: float
    host_start_s: float
    residual_s: float


class Lost(_Part):
    """Frames of one PDO that never came, came again or came late: how many, of which samples."""

    count: int
    samples: list[str]


class MarkNote(_Part):
    """A mark set while recording, by the drive's and the host's clock."""

    text: str
    device_time_us: int
    host_time_s: float


class ForeignSignal(_Part):
    """One signal of another node's frame; value = raw * scale + offset in the column's unit.

    `shift` is the place of its lowest bit in the frame's eight bytes read as one number, little
    endian or big endian.
    """

    column: str
    shift: int = Field(ge=0, le=63)
    bits: int = Field(ge=1, le=64)
    little_endian: bool
    kind: Literal["unsigned", "signed", "float"] = "unsigned"
    scale: float = 1.0
    offset: float = 0.0


class ForeignSource(_Part):
    """One frame of another node, and what is taken from it."""

    name: str
    cob_id: int
    extended: bool = False
    length: int = Field(ge=1, le=8)
    signals: list[ForeignSignal]
    described_by: str = ""
    period_s: float | None = None


class OtherDrive(_Part):
    """A further drive in the recording; its columns begin with ``nodeN_``."""

    node_id: int
    dictionary_hash: str
    sample_period_s: float = Field(gt=0)
    pdos: list[PdoLayout]
    counter_before: int | None = None
    counter_after: int | None = None
    sync_counter: int | None = None


class SideFile(_Part):
    """Everything that the side file holds.

    `lost` names each PDO, `repeated` and `delayed` those with such a frame. `sync_counter` is a
    drive's sample counter before the first SYNC; None: it samples by its own
    timer.
    """

    format: int = Field(default=FORMAT, ge=1, le=FORMAT)
    bowden: str
    git: str | None
    dictionary_hash: str
    node_id: int
    adapter: dict[str, str]
    started: str
    sample_period_s: float = Field(gt=0)
    pdos: list[PdoLayout]
    counter_before: int | None = None
    counter_after: int | None = None
    sync_counter: int | None = None
    samples: int | None = None
    lost: dict[str, Lost] | None = None
    repeated: dict[str, Lost] = Field(default_factory=dict)
    delayed: dict[str, Lost] = Field(default_factory=dict)
    clock: Clock | None = None
    cut: str | None = None
    trigger: str | None = None
    marks: list[MarkNote] = Field(default_factory=list)
    error_frames: int = 0
    others: list[OtherDrive] = Field(default_factory=list)
    foreign: list[ForeignSource] = Field(default_factory=list)
    findings: list[str] = Field(default_factory=list)
    emergencies: list[str] = Field(default_factory=list)
    metadata: dict[str, str] = Field(default_factory=dict)

    def with_counters(self, field: str, by_node: Mapping[int, int]) -> SideFile:
        """Return it with the drives' sample counters in a field, where they are known."""
        others = [
            other.model_copy(update={field: by_node.get(other.node_id)}) for other in self.others
        ]
        return self.model_copy(update={field: by_node.get(self.node_id), "others": others})

    def with_one_period(self) -> SideFile:
        """Return it with the first drive's sample period for all drives, as SYNC gives it."""
        period = {"sample_period_s": self.sample_period_s}
        others = [other.model_copy(update=period) for other in self.others]
        return self.model_copy(update={"others": others})


def side_path(capture: Path) -> Path:
    """Return the side file's path for a capture's path; that of a packed one has no ``.gz``."""
    return capture.with_name(capture.name.removesuffix(".gz") + ".json")


def read_side_file(capture: Path) -> SideFile:
    """Read the side file of a capture.

    Raises
    ------
    BadInput
        Not there, or not a side file; all its problems at once.
    """
    path = side_path(capture)
    try:
        text = path.read_bytes()
        _refuse_later(path, text)
        return SideFile.model_validate_json(text)
    except OSError as error:
        raise BadInput(
            str(capture), f"no side file {path.name}", "a capture with its side file beside it"
        ) from error
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, item['loc'])) or 'file'}: {item['msg']}" for item in error.errors()
        )
        raise BadInput(str(path), problems, "the side file as the recorder wrote it") from error


def _refuse_later(path: Path, text: bytes) -> None:
    """Report a file of a later version as such, instead of its unknown keys."""
    try:
        tree = json.loads(text)
    except ValueError:
        return
    found = tree.get("format") if isinstance(tree, dict) else None
    if isinstance(found, int) and found > FORMAT:
        accepted = f"formats up to {FORMAT}, or a later bowden than this one"
        raise BadInput(str(path), f"format {found}, of a later bowden", accepted)


def write_side_file(capture: Path, side: SideFile) -> None:
    """Write the side file of a capture, whole or not at all."""
    with replace_whole(side_path(capture)) as temporary:
        temporary.write_text(side.model_dump_json(indent=2) + "\n", encoding="utf-8")
