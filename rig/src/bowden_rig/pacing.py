"""Keeps virtual time beside the wall clock: how much of it is due now.

Pure arithmetic on times that the caller reads, so it is tested without waiting. Used by
`process`.
"""

from __future__ import annotations

from typing import Final

MOST_SLICES_AT_ONCE: Final = 2
GIVE_UP_S: Final = 2.0


class Pace:
    """Deadlines on a fixed grid, so that errors never add up to drift.

    After a stall virtual time runs at twice the speed of the clock, two slices at once at most: the
    bus sees twice its usual load, not a burst that overruns the receiver. A stall longer than
    `GIVE_UP_S` (or a machine that is too slow) moves the grid instead; `skipped_s` says how far.

    Parameters
    ----------
    slice_s : float
        Virtual time of one slice.
    now_s : float
        Of a monotonic clock; the first slice is due one slice later.
    """

    def __init__(self, slice_s: float, now_s: float) -> None:
        self.slice_s = slice_s
        self.worst_lateness_s = 0.0
        self.late_slices = 0
        self.slices = 0
        self.skipped_s = 0.0
        self._next_s = now_s + slice_s
        self._earliest_s = now_s

    def due(self, now_s: float) -> int:
        """Count the slices to run now: 0, 1 or 2."""
        lateness_s = now_s - self._next_s
        if lateness_s < 0.0 or now_s < self._earliest_s:
            return 0
        self.worst_lateness_s = max(self.worst_lateness_s, lateness_s)
        if lateness_s >= GIVE_UP_S:
            self.skipped_s += lateness_s
            self._next_s = now_s
            lateness_s = 0.0
        count = min(1 + int(lateness_s / self.slice_s), MOST_SLICES_AT_ONCE)
        self.late_slices += count - 1
        self.slices += count
        self._next_s += count * self.slice_s
        self._earliest_s = now_s + 0.5 * count * self.slice_s
        return count

    def wait_s(self, now_s: float) -> float:
        """Tell how long to sleep before asking `due` again."""
        return max(max(self._next_s, self._earliest_s) - now_s, 0.0)
