"""The frames of some COB-IDs as arrays: one pass over a capture, whatever is in it.

Pure. `decode` turns the drives' frames into samples, `align` those of other nodes into channels.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import can
import numpy as np
from numpy.typing import NDArray

from bowden.recording.losses import Arrivals


class FrameId(NamedTuple):
    """What tells a frame on the bus."""

    cob_id: int
    extended: bool = False


@dataclass(frozen=True)
class Frames:
    """All frames of one id in order of arrival.

    Parameters
    ----------
    arrivals : Arrivals
        Place among all frames of the capture, and the host's receive time.
    octets : ndarray of shape (n, length), uint8
        Their data.
    """

    arrivals: Arrivals
    octets: NDArray[np.uint8]

    def integers(self, start: int, size: int, *, signed: bool) -> NDArray[np.int64]:
        """Return `size` bytes from `start` on as little-endian integers, of all frames at once."""
        value = np.zeros(len(self.octets), dtype=np.int64)
        for place in range(size):
            value |= self.octets[:, start + place].astype(np.int64) << (8 * place)
        if signed:
            unused = 64 - 8 * size
            value = (value << unused) >> unused
        return value

    def words(self, *, little_endian: bool) -> NDArray[np.uint64]:
        """Return each frame's eight bytes as one number; a shorter frame is filled with zeros."""
        whole = np.zeros((len(self.octets), 8), dtype=np.uint8)
        whole[:, : self.octets.shape[1]] = self.octets
        return whole.view("<u8" if little_endian else ">u8")[:, 0].astype(np.uint64)


def collect(frames: Iterable[can.Message], lengths: dict[FrameId, int]) -> dict[FrameId, Frames]:
    """Gather the frames of some ids.

    Parameters
    ----------
    frames : iterable of can.Message
        In order of arrival.
    lengths : dict of FrameId to int
        Which, and how many bytes each has. A frame of another length is not the one that is meant.
    """
    # Packed as they come: ten minutes of two drives are millions of frames.
    positions = {one: array("q") for one in lengths}
    times = {one: array("d") for one in lengths}
    data = {one: bytearray() for one in lengths}
    for position, frame in enumerate(frames):
        one = FrameId(frame.arbitration_id, frame.is_extended_id)
        if len(frame.data) != lengths.get(one) or frame.is_error_frame or frame.is_remote_frame:
            continue
        positions[one].append(position)
        times[one].append(frame.timestamp)
        data[one] += frame.data
    return {
        one: Frames(
            Arrivals(
                np.array(positions[one], dtype=np.int64), np.array(times[one], dtype=np.float64)
            ),
            np.frombuffer(bytes(data[one]), dtype=np.uint8).reshape(-1, length),
        )
        for one, length in lengths.items()
    }
