"""How many digits of a number to show: as many as its interval leaves a meaning."""

from __future__ import annotations

import math


def rounded(value: float, half_width: float) -> str:
    """Return a value to the precision of its interval."""
    if not (half_width > 0.0 and math.isfinite(value)) or value == 0.0:
        return f"{value:.5g}"
    digits = math.ceil(math.log10(abs(value) / half_width)) + 1
    return f"{value:.{min(max(digits, 3), 12)}g}"


def interval(low: float, high: float) -> str:
    """Return an interval with as many digits as its width needs: ``10.588 .. 10.612``."""
    tenth = 0.05 * (high - low)  # of the half width, so that rounding does not change it
    return f"{rounded(low, tenth)} .. {rounded(high, tenth)}"
