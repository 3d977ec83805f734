"""Which samples of a recording the drive's bridge was on for.

The column ``status`` holds the drive's CiA 402 state. Recordings from elsewhere have none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bowden.recording.recording import Recording

# CiA 402 statusword: mask of the state, and Operation enabled.
_STATE, _ENABLED = 0x6F, 0x27


def enabled(recording: Recording) -> NDArray[np.bool_] | None:
    """Return for each sample whether the drive was enabled; None where it is unknown."""
    status = recording.channels.get("status")
    return None if status is None else (status.astype(np.int64) & _STATE) == _ENABLED


def until_disabled(recording: Recording) -> Recording:
    """Return the recording up to the last sample with the drive enabled.

    When the bridge opens, the motor springs back within milliseconds, which a quasi-static model
    does not describe. A recording in which the drive was never enabled stays whole.
    """
    on = enabled(recording)
    if on is None or not on.any() or on[-1]:
        return recording
    end = int(np.flatnonzero(on)[-1]) + 1
    return recording.select(slice(end))
