"""Watching a recording: counts the samples as they come and knows why it has to end.

Handles frames through the connection; stores nothing of them (the reading thread writes the
capture) and sends nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import can

from bowden.drive.client import Drive
from bowden.drive.entry import Layout
from bowden.drive.faults import describe_emergency
from bowden.drive.power import is_fault, power_state
from bowden.errors import DriveFailed

_VANISHED_S = 1.0
_PROGRESS_S = 0.1
_EMERGENCY_FOLLOWS_S = 0.05


@dataclass(frozen=True)
class Progress:
    """How far a recording is; `lost` is what the counters show so far, all PDOs together."""

    elapsed_s: float
    samples: int
    lost: int
    rate_hz: float


class Watch:
    """Handles the frames of one recording.

    Parameters
    ----------
    drive : Drive
        The drive that is recorded.
    layouts : sequence of Layout
        What its PDOs carry; the first has the sample counter and the device time.
    on_progress : callable, optional
        Called about ten times a second.
    """

    def __init__(
        self,
        drive: Drive,
        layouts: Sequence[Layout],
        on_progress: Callable[[Progress], None] | None,
    ) -> None:
        self._drive = drive
        self._clock = drive.connection.clock
        self._on_progress = on_progress
        self._pdos = {layout.cob_id: layout for layout in layouts}
        self._first = layouts[0].cob_id
        self._frames = 0
        self._last: dict[str, int] | None = None
        self._elapsed_us = 0
        self._elapsed_samples = 0
        self._last_at = self._clock()

    def run(self, duration_s: float, is_powered: bool) -> None:
        """Handle frames until the time is over; DriveFailed when the drive is."""
        drive = self._drive
        boots = drive.boots
        self._last_at = next_progress = self._clock()
        while self._elapsed_us < duration_s * 1e6:
            frame = drive.connection.receive(_PROGRESS_S)
            if frame is not None:
                self._count(frame)
            if drive.boots > boots:
                raise DriveFailed(f"node {drive.node_id} restarted while it was recorded")
            self._check_status(is_powered)
            self._check_silence()
            if self._clock() >= next_progress:
                next_progress = self._clock() + _PROGRESS_S
                self._tell()
        self._tell()

    def _count(self, frame: can.Message) -> None:
        layout = self._pdos.get(frame.arbitration_id)
        if layout is None or len(frame.data) != layout.size:
            return
        if frame.arbitration_id == self._first:
            now = layout.decode(bytes(frame.data))
            if self._last is not None:
                step_us = (now["device_time"] - self._last["device_time"]) % (1 << 32)
                self._elapsed_us += step_us
                self._elapsed_samples += (now["sample_counter"] - self._last["sample_counter"]) % (
                    1 << 16
                )
            else:
                self._frames = 0
            self._last = now
            self._last_at = self._clock()
        self._frames += 1

    def _check_status(self, is_powered: bool) -> None:
        statusword = self._last.get("statusword") if self._last else None
        if statusword is None:
            return
        drive, state = self._drive, power_state(statusword)
        if is_fault(statusword) and is_powered:
            drive.connection.listen(_EMERGENCY_FOLLOWS_S)
            why = describe_emergency(drive.emergencies[-1]) if drive.emergencies else "no EMCY"
            raise DriveFailed(f"node {drive.node_id} reports a fault: {why}")
        if is_powered and state != "operation enabled":
            raise DriveFailed(f"node {drive.node_id} has left 'operation enabled' for {state!r}")

    def _check_silence(self) -> None:
        if self._clock() - self._last_at <= _VANISHED_S:
            return
        drive = self._drive
        if drive.connection.silence_s(drive.node_id) <= _VANISHED_S:
            raise DriveFailed(
                f"node {drive.node_id} sends no samples any more (NMT {drive.nmt_state.lower()})"
            )
        raise DriveFailed(
            f"node {drive.node_id} has vanished: nothing from it for {_VANISHED_S:g} s"
        )

    def _tell(self) -> None:
        if self._on_progress is None:
            return
        elapsed_s = self._elapsed_us / 1e6
        # Frames of the sample that is just coming in are not lost yet.
        expected = len(self._pdos) * self._elapsed_samples + 1
        rate_hz = self._elapsed_samples / elapsed_s if elapsed_s else 0.0
        lost = max(0, expected - self._frames)
        self._on_progress(Progress(elapsed_s, self._elapsed_samples, lost, rate_hz))
