"""The logger's capture: raw CAN frames (BLF) and a JSON side file; written and read here.

A capture is written as ``NAME.part`` and gets its name when it is closed, so that a file with its
own name is always whole. Cut short, it is closed and kept all the same, and says why; even after a
power cut the ``.part`` can be read up to the last second. Never needs a drive.
"""

from __future__ import annotations

import dataclasses
import io
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType

import can
from can.io.blf import BLFParseError

from bowden.errors import BadInput
from bowden.recording.decode import Decoded, decode
from bowden.recording.recording import Recording
from bowden.recording.side_file import (
    Clock,
    Lost,
    SideFile,
    read_side_file,
    side_path,
    write_side_file,
)
from bowden.recording.source_bytes import is_packed, read_source

NOT_CLOSED = "the recorder ended without closing the capture"


class CaptureWriter:
    """Writes one capture; a context manager that closes it whatever happens.

    Parameters
    ----------
    path : Path
        The name that it gets in the end.
    side : SideFile
        What is known at the start.

    Attributes
    ----------
    side : SideFile
        With all that was noted; after `close` also the account of losses.
    decoded : Decoded or None
        After `close`, the samples as read back from the file; None when there is none.
    """

    def __init__(self, path: Path, side: SideFile) -> None:
        self.path = path
        self.side = side
        self.decoded: Decoded | None = None
        self._part = path.with_name(path.name + ".part")
        try:
            self._blf = can.BLFWriter(self._part)
        except OSError as error:
            raise BadInput(
                str(path), error.strerror or str(error), "a path in a folder that can be written to"
            ) from error
        write_side_file(self._part, side.model_copy(update={"cut": NOT_CLOSED}))

    def write(self, frame: can.Message) -> None:
        """Add a frame."""
        # BLF numbers channels from the adapter's name, which need not be a number.
        self._blf.on_message_received(_without_channel(frame))

    def note(self, **fields: object) -> None:
        """Set fields of the side file: the counters, or `cut` where it was cut."""
        self.side = self.side.model_copy(update=fields)

    def close(self) -> None:
        """Close the capture, account for its losses and give it its name."""
        self._blf.stop()
        with suppress(BadInput):
            self.decoded = decode(_frames(self._part), self.side, str(self.path))
        self.side = _account(self.side, self.decoded)
        write_side_file(self.path, self.side)
        self._part.replace(self.path)
        side_path(self._part).unlink(missing_ok=True)

    def __enter__(self) -> CaptureWriter:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        if error is not None and self.side.cut is None:
            self.note(cut=str(error) or type(error).__name__)
        self.close()


def read_capture(path: Path) -> Recording:
    """Read a capture as a recording; what was lost or cut is told in its metadata.

    Raises
    ------
    BadInput
        No side file, not a BLF, or no complete sample.
    """
    side = read_side_file(path)
    decoded = decode(_frames(path), side, str(path))
    return as_recording(decoded, side, str(path))


def as_recording(decoded: Decoded, side: SideFile, source: str) -> Recording:
    """Turn decoded samples into a `Recording`.

    Raises
    ------
    BadInput
        No complete sample.
    """
    if not decoded.time_s.size:
        raise BadInput(source, "no sample of which every PDO arrived", "a capture with samples")
    metadata = _metadata(decoded, side)
    return Recording(decoded.time_s, decoded.channels, metadata=metadata, source=source)


def _metadata(decoded: Decoded, side: SideFile) -> dict[str, str]:
    metadata = dict(side.metadata)
    metadata["sample_rate_hz"] = f"{1 / side.sample_period_s:g}"
    metadata["started"] = side.started
    metadata["node_id"] = str(side.node_id)
    metadata["dictionary_hash"] = side.dictionary_hash
    metadata["frames_lost"] = str(decoded.losses.total)
    for pdo in side.pdos:
        if ranges := decoded.losses.ranges(pdo.name):
            metadata[f"lost_{pdo.name.lower()}"] = " ".join(ranges)
    if decoded.clock:
        metadata["clock_drift_ppm"] = f"{decoded.clock.drift_ppm:.3g}"
    if side.emergencies:
        metadata["emergencies"] = "; ".join(side.emergencies)
    if side.cut:
        metadata["cut"] = side.cut
    return metadata


def _account(side: SideFile, decoded: Decoded | None) -> SideFile:
    if decoded is None:
        return side.model_copy(update={"samples": 0})
    losses = decoded.losses
    return side.model_copy(
        update={
            "samples": losses.expected,
            "lost": {
                pdo: Lost(count=int(numbers.size), samples=losses.ranges(pdo))
                for pdo, numbers in losses.lost.items()
            },
            "clock": Clock(**dataclasses.asdict(decoded.clock)) if decoded.clock else None,
        }
    )


def _frames(path: Path) -> Iterator[can.Message]:
    try:
        data = io.BytesIO(read_source(path, "a BLF capture")) if is_packed(path) else path
        with can.BLFReader(data) as reader:
            yield from reader
    except struct.error:
        # The file ends inside a block: the recorder was killed. All whole blocks have been read.
        return
    except (BLFParseError, zlib.error, ValueError, OverflowError, OSError) as error:
        raise BadInput(str(path), f"a damaged file ({error})", "a BLF capture") from error


def _without_channel(frame: can.Message) -> can.Message:
    frame.channel = None
    return frame
