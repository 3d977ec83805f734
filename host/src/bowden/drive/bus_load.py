"""How busy the bus is: frames and bits, counted as they come by the connection's clock."""

from __future__ import annotations

import can

from bowden.drive.connection import Connection
from bowden.drive.dictionary import BITRATE

_BITS_WITHOUT_DATA = 47 + 3  # classic frame and interframe space; stuff bits are not counted


class BusLoad:
    """Counts the frames of a connection.

    Parameters
    ----------
    connection : Connection
        For its clock and its bit rate; the drive's where the adapter names none.
    """

    def __init__(self, connection: Connection) -> None:
        self.bitrate = float(connection.adapter.get("bitrate", BITRATE))
        self._clock = connection.clock
        self._since_s = self._clock()
        self._frames = 0
        self._bits = 0

    def count(self, frame: can.Message) -> None:
        """Take a frame."""
        if not frame.is_error_frame:
            self._frames += 1
            self._bits += _BITS_WITHOUT_DATA + 8 * len(frame.data)

    def take(self) -> tuple[float, float]:
        """Return frames a second and the share of the bit rate since the last call."""
        now = self._clock()
        span_s = max(now - self._since_s, 1e-3)
        told = self._frames / span_s, self._bits / span_s / self.bitrate
        self._since_s, self._frames, self._bits = now, 0, 0
        return told
