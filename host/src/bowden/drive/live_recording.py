"""The recording of a live session: a capture begun, marked and ended while a drive is watched."""

from __future__ import annotations

from pathlib import Path

from bowden.counted import counted
from bowden.drive.entry import Layout
from bowden.drive.faults import describe_emergency
from bowden.drive.follow import Follower
from bowden.drive.power import Run
from bowden.drive.provenance import run_metadata, side_file
from bowden.errors import BadInput
from bowden.recording.capture_writer import CaptureWriter


class LiveRecording:
    """At most one capture at a time, of the drive that a follower counts.

    Parameters
    ----------
    follower : Follower
    layouts : list of Layout
        What the drive's PDOs carry.
    """

    def __init__(self, follower: Follower, layouts: list[Layout]) -> None:
        self._follower = follower
        self._drive = follower.drive
        self._layouts = layouts
        self._writer: CaptureWriter | None = None
        self._from_us = 0
        self.last: str | None = None

    @property
    def path(self) -> Path | None:
        """Of the capture under way."""
        return self._writer.path if self._writer else None

    @property
    def has_failed(self) -> bool:
        """Whether the capture under way cannot be written any more."""
        return self._writer is not None and self._writer.failure is not None

    @property
    def elapsed_s(self) -> float:
        """Of the capture under way, by the drive's clock, s; 0 where there is none."""
        return (self._follower.elapsed_us - self._from_us) / 1e6 if self._writer else 0.0

    def start(self, path: Path, notes: str, run: Run | None) -> str:
        """Begin a capture; return what to tell.

        Raises
        ------
        BadInput
            One is under way, or there is a file of that name, or it cannot be written.
        """
        if self._writer is not None:
            raise BadInput(str(path), "a recording under way", "its end first")
        if path.exists():
            raise BadInput(str(path), "a file with that name", "a new name")
        told = {"notes": notes} if notes else {}
        metadata = told | run_metadata(self._drive, run)
        self._writer = CaptureWriter(path, side_file([self._drive], [self._layouts], metadata))
        self.count_from_now()
        self._drive.connection.set_tap(self._writer.write)
        return f"recording into {path.name}"

    def count_from_now(self) -> None:
        """Let `elapsed_s` begin at the last sample."""
        self._from_us = self._follower.elapsed_us

    def end(self, cut: str | None = None) -> str | None:
        """Close the capture, if there is one; return what to tell.

        Parameters
        ----------
        cut : str, optional
            Why it ends before its time.

        Raises
        ------
        BadInput
            It could not be written to its end.
        """
        writer, self._writer = self._writer, None
        if writer is None:
            return None
        self._drive.connection.set_tap(None)
        if codes := self._drive.emergencies:
            writer.note(emergencies=[describe_emergency(code) for code in codes])
        if cut is not None:
            writer.note(cut=cut)
        writer.close()
        if writer.failure is not None:
            raise BadInput(str(writer.path), writer.failure, f"a disk with room; see {writer.part}")
        self.last = str(writer.path)
        lost = writer.decoded.frames_lost if writer.decoded else 0
        frames = counted(lost, "frame", "frames")
        return f"{writer.path.name}: {writer.side.samples} samples, {frames} lost"

    def discard(self) -> None:
        """Remove the capture under way: what it was for has not begun."""
        writer, self._writer = self._writer, None
        if writer is not None:
            self._drive.connection.set_tap(None)
            writer.close()
            writer.discard()

    def mark(self, text: str) -> str:
        """Set a mark at the last sample; return what to tell.

        Raises
        ------
        BadInput
            No capture is under way.
        """
        last = self._follower.last
        if self._writer is None or last is None:
            raise BadInput("mark", "no recording under way", "start one first")
        self._writer.mark(text, last["device_time"], self._follower.last_host_s)
        return f"mark: {text}"
