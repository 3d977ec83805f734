"""How long a diagnosis may fit: `sets`, `growing` and `learn` ask before each fit."""

from __future__ import annotations

import math
import time


class TimeLimit:
    """A time after which nothing further is fitted; `cut` where that left something out.

    Parameters
    ----------
    seconds : float
        From now.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._until, self.cut = time.monotonic() + seconds, False

    def has_time(self) -> bool:
        """Whether there is time for one more fit; what is left out for lack of it is `cut`."""
        self.cut = self.cut or time.monotonic() >= self._until
        return not self.cut
