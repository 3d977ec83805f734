"""Writing a capture: raw CAN frames as they come (BLF), whole or marked as cut.

A capture is written as ``NAME.part`` and gets its name when it is closed, so that a file with its
own name is always whole. Cut short, it is closed and kept all the same, and says why. After a power
cut or a kill the ``.part`` holds all but the last `FLUSH_EVERY_S`; `recover` makes it whole. Frames
come from the reading thread, everything else from the caller's: one lock guards both.
"""

from __future__ import annotations

import dataclasses
import os
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any

import can
import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.blf import read_frames
from bowden.recording.clock import clock_finding
from bowden.recording.decode import Decoded, decode
from bowden.recording.losses import LossReport, ranges
from bowden.recording.side_file import (
    Clock,
    Lost,
    MarkNote,
    SideFile,
    read_side_file,
    side_path,
    write_side_file,
)

NOT_CLOSED = "the recorder ended without closing the capture"
#: A kill or a power cut loses at most so much, s.
FLUSH_EVERY_S = 0.25


class CaptureWriter:
    """Writes one capture; a context manager that closes it whatever happens.

    Parameters
    ----------
    path : Path
        The name that it gets in the end.
    side : SideFile
        What is known at the start.
    pre_trigger_s : float, optional, s
        Keep only the frames of so long, until `release`; by default every frame is written.
    overwrite : bool
        Replace an unfinished recording of that name.

    Attributes
    ----------
    side : SideFile
        With all that was noted; after `close` also the account of losses.
    decoded : Decoded or None
        After `close`, the samples as read back from the file; None when there is none.
    failure : str or None
        Why nothing is written any more: a full disk. Frames are then dropped, and the bus is read
        on, so that the drive can still be stopped.

    Raises
    ------
    BadInput
        The path cannot be written, or an unfinished recording of that name is there.
    """

    def __init__(
        self,
        path: Path,
        side: SideFile,
        *,
        pre_trigger_s: float | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = path
        self.side = side
        self.decoded: Decoded | None = None
        self.failure: str | None = None
        self.part = path.with_name(path.name + ".part")
        self._lock = Lock()
        self._pre_trigger_s = pre_trigger_s or 0.0
        self._waiting: deque[can.Message] | None = None if pre_trigger_s is None else deque()
        self._flushed_s = -float("inf")
        if self.part.exists() and not overwrite:
            raise BadInput(
                str(self.part),
                "an unfinished recording",
                f"none: make it whole with `bowden recover {self.part}`, or --overwrite",
            )
        try:
            self._blf = _Blf(self.part)
        except OSError as error:
            raise BadInput(
                str(path), error.strerror or str(error), "a path in a folder that can be written to"
            ) from error
        lock_file(self._blf.file, self.part)
        try:
            write_side_file(self.part, side.model_copy(update={"cut": NOT_CLOSED}))
        except BadInput:
            self._blf.file.close()
            self.part.unlink()
            raise

    def write(self, frame: can.Message) -> None:
        """Add a frame."""
        with self._lock:
            if self._waiting is None:
                self._put(frame)
                return
            self._waiting.append(frame)
            oldest = frame.timestamp - self._pre_trigger_s
            while self._waiting[0].timestamp < oldest:
                self._waiting.popleft()

    def release(self) -> None:
        """Write what was kept before the trigger, and every frame from now on."""
        with self._lock:
            kept, self._waiting = self._waiting or (), None
            for frame in kept:
                self._put(frame)

    def note(self, **fields: object) -> None:
        """Set fields of the side file: the counters, or `cut` where it was cut."""
        self.side = self.side.model_copy(update=fields)

    def mark(self, text: str, device_time_us: int, host_time_s: float) -> None:
        """Keep a mark at a time of the drive's clock."""
        one = MarkNote(text=text, device_time_us=device_time_us, host_time_s=host_time_s)
        self.note(marks=[*self.side.marks, one])

    def close(self) -> None:
        """Close the capture, account for its losses and give it its name.

        Where it could not be written to its end, it stays a ``.part`` that says so.
        """
        with self._lock:
            self._waiting = None
            try:
                if self.failure is None:
                    self._blf.stop()
            except OSError as error:
                self._fail(error)
        if self.failure is not None:
            self.note(cut=self.failure)
        with suppress(BadInput):
            self.decoded = decode(read_frames(self.part), self.side, str(self.path))
        self.side = account(self.side, self.decoded)
        if self.failure is not None:
            with suppress(BadInput):  # the side file from the start says that it was cut, too
                write_side_file(self.part, self.side)
            return
        write_side_file(self.path, self.side)
        self.part.replace(self.path)
        side_path(self.part).unlink(missing_ok=True)

    def discard(self) -> None:
        """Remove a capture that holds nothing."""
        for name in (self.path, self.part):
            name.unlink(missing_ok=True)
            side_path(name).unlink(missing_ok=True)

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

    def _put(self, frame: can.Message) -> None:
        if self.failure is not None:
            return
        try:
            # BLF numbers channels from the adapter's name, which need not be a number.
            frame.channel = None
            self._blf.on_message_received(frame)
            if frame.timestamp - self._flushed_s >= FLUSH_EVERY_S:
                self._flushed_s = frame.timestamp
                self._blf.write_out()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        if self.failure is None:
            self.failure = f"could not be written to its end: {error.strerror or error}"
        with suppress(OSError):
            self._blf.file.close()


class _Blf(can.BLFWriter):
    """BLF that writes what it holds when it is told to, not only when a block is full."""

    def write_out(self) -> None:
        self._flush()
        self.file.flush()


def recover(part: Path, *, overwrite: bool = False) -> CaptureWriter:
    """Restore a capture from the ``.part`` that a killed recorder has left.

    Parameters
    ----------
    part : Path
        ``NAME.blf.part``, with its side file beside it.
    overwrite : bool
        Replace ``NAME.blf`` if it is there.

    Returns
    -------
    CaptureWriter
        Closed; its `decoded` and `side` tell what was saved.

    Raises
    ------
    BadInput
        No unfinished recording, one that is still being written, or a name that is taken.
    """
    if part.suffix != ".part":
        raise BadInput(str(part), "no unfinished recording", "a file NAME.blf.part")
    path = part.with_suffix("")
    if path.exists() and not overwrite:
        raise BadInput(str(path), "a file with that name", "--overwrite, or move it away")
    try:
        with part.open("rb") as handle:
            lock_file(handle, part)
    except OSError as error:
        raise BadInput(str(part), error.strerror or str(error), "a readable file") from error
    side = read_side_file(part)
    # Through a file of its own: the .part stays as it is until the whole one is there.
    whole = path.with_name(f"{path.name}.recovered")
    with CaptureWriter(whole, side, overwrite=True) as writer:
        for frame in read_frames(part):
            writer.write(frame)
    if writer.failure is not None:
        writer.discard()
        raise BadInput(str(whole), writer.failure, f"a disk with room; {part} is as it was")
    whole.replace(path)
    side_path(whole).replace(side_path(path))
    part.unlink()
    side_path(part).unlink(missing_ok=True)
    writer.path = path
    return writer


def account(side: SideFile, decoded: Decoded | None) -> SideFile:
    """Return the side file with the account of a capture's samples."""
    if decoded is None:
        return side.model_copy(update={"samples": 0})
    finding = clock_finding(decoded.clock, decoded.duration_s) if decoded.clock else None
    return side.model_copy(
        update={
            "samples": decoded.losses.expected,
            "lost": _by_pdo(decoded, lambda losses: losses.lost, all_pdos=True),
            "repeated": _by_pdo(decoded, lambda losses: losses.order.repeated),
            "delayed": _by_pdo(decoded, lambda losses: losses.order.delayed),
            "findings": [*filter(None, [finding]), *decoded.findings],
            "clock": Clock(**dataclasses.asdict(decoded.clock)) if decoded.clock else None,
        }
    )


def _by_pdo(
    decoded: Decoded,
    which: Callable[[LossReport], dict[str, NDArray[np.int64]]],
    *,
    all_pdos: bool = False,
) -> dict[str, Lost]:
    """Return the samples of each PDO of each drive, those of further drives with their node."""
    named = {"": decoded.losses}
    named |= {f"node {node_id} ": other.losses for node_id, other in decoded.others.items()}
    return {
        f"{prefix}{pdo}": Lost(count=int(numbers.size), samples=ranges(numbers))
        for prefix, losses in named.items()
        for pdo, numbers in which(losses).items()
        if numbers.size or all_pdos
    }


def lock_file(handle: Any, path: Path) -> None:  # noqa: ANN401  (any open file)
    """Refuse a file that another program is writing; its lock ends with that program."""
    if os.name != "posix":
        return
    import fcntl  # noqa: PLC0415  (not on Windows)

    try:
        fcntl.flock(handle.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise BadInput(str(path), "a recorder that is still running", "wait for its end") from error
