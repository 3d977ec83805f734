"""Checks that a recording is long, dense and finite enough, and has no large gaps.

Looks at one `Recording` without a model; returns findings.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bowden.estimation.gate.finding import NAMES, Finding
from bowden.recording.recording import Recording

SHORTEST_S, FEWEST = 2.0, 200
COARSE_STEP_S, COARSEST_STEP_S = 0.02, 0.2
GAP_SHARE = 0.3  # of a recording's time


def check_time_base(one: Recording, name: str) -> Iterator[Finding]:
    """Look at the times; after ``empty``, ``short`` or ``not_finite`` nothing else is checked."""
    if one.time_s.size < 2:
        yield Finding("empty", name, f"{one.time_s.size} samples", "at least 2 samples", "stop")
        return
    duration = float(one.time_s[-1] - one.time_s[0])
    if one.time_s.size < FEWEST or duration < SHORTEST_S:
        yield Finding(
            "short",
            name,
            f"{one.time_s.size} samples over {duration:.3g} s",
            f"at least {FEWEST} samples and {SHORTEST_S:g} s",
            "stop",
        )
        return
    for channel, words in NAMES.items():
        if channel in one.channels:
            bad = int(np.count_nonzero(~np.isfinite(one[channel])))
            if bad:
                first = float(one.time_s[np.flatnonzero(~np.isfinite(one[channel]))[0]])
                yield Finding(
                    "not_finite",
                    f"{name}, {words}",
                    f"{bad} samples that are no number, the first at {first:.4g} s",
                    "a number in every sample (leave such rows out: gaps are handled)",
                    "stop",
                )
    step = float(np.median(np.diff(one.time_s)))
    if step > COARSE_STEP_S:
        yield Finding(
            "sampling",
            f"{name}, time_s",
            f"a sample every {step:.3g} s",
            f"{COARSE_STEP_S:g} s at most: reversals pass unseen between samples (is time_s in s?)",
            "stop" if step > COARSEST_STEP_S else "warn",
        )
    gaps = one.gaps
    missing = sum(length for _, length in gaps)
    if gaps:
        yield Finding(
            "gap",
            f"{name}, time_s",
            f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''}, {missing:.3g} s in all, longest "
            f"{max(length for _, length in gaps):.3g} s",
            "none: the state of the friction after a gap is not known",
            "stop" if missing > GAP_SHARE * duration else "warn",
        )
