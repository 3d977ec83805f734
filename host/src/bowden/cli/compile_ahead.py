"""Compiles what a comparison runs, in a process beside a command that waits for something else.

numba compiles each kernel at its first call and keeps it on disk. The first comparison after an
installation would take half a minute for that; `bowden demo` lets it pass while the rig records.
The process compares a short recording that was made by the model; nothing of it is kept.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

import bowden

_DURATION_S = 2.0
_STEP_S = 1e-3
_URAD_PER_COUNT = 300.0
_NOISE_NM = 1e-3
_NICENESS = 10


@contextmanager
def compiling_ahead() -> Iterator[subprocess.Popen[bytes]]:
    """Compile beside the block; leave it at the end of what is under way, or at once on an error.

    Whether the process succeeds is not asked: what it leaves out is compiled when it is needed.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", __name__],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for the command: it ends this process here
    )
    try:
        yield process
        process.wait()
    finally:
        process.kill()
        process.wait()


def compare_once() -> None:
    """Compare a model with what it simulates, angles in counts, noise on the torques."""
    time_s = np.arange(0.0, _DURATION_S, _STEP_S)
    stroke = np.sin(np.pi * time_s)
    count_rad = 1e-6 * _URAD_PER_COUNT
    given = bowden.Recording(
        time_s,
        motor_torque_nm=0.1 * stroke,
        load_angle_rad=0.7 * stroke,
        motor_angle_rad=0.0 * stroke,
        load_torque_nm=0.0 * stroke,
    )
    simulated = bowden.simulate(bowden.table_1(), given)
    angles = {
        name: count_rad * np.round(simulated[name] / count_rad)
        for name in ("motor_angle_rad", "load_angle_rad")
    }
    noise = np.random.default_rng(0).normal(scale=_NOISE_NM, size=(2, time_s.size))
    torques = {
        name: simulated[name] + errors
        for name, errors in zip(("motor_torque_nm", "load_torque_nm"), noise, strict=True)
    }
    bowden.compare(bowden.table_1(), simulated.with_channels({**angles, **torques}))


if __name__ == "__main__":
    os.nice(_NICENESS)
    compare_once()
