"""What a long recording costs: processor time and memory of the commands that fit, by its length.

    python -m hil_tests.benchmarks --only long_recordings

One rig is drawn and recorded by the independent solver (`hil_tests.hidden_effects`), nothing
hidden: ten minutes at 1 kHz. Shorter recordings are its first minutes. Each command is a process of
its own, so that its peak memory is its own. Touches a temporary folder only.
"""

from __future__ import annotations

import os
import sys
import tempfile
from itertools import islice
from pathlib import Path
from subprocess import DEVNULL, Popen

from hil_tests.benchmarks.measurement import Figure, scaling_exponent
from hil_tests.hidden_effects.recordings import draw_case

SEED = 77
LENGTHS_S = (60, 150, 600)
RATE_HZ = 1000
SEARCHED_S = 60.0  # of a diagnosis, after which no further set of effects is fitted
COMMANDS = {
    "compare": ("compare",),
    "calibrate": ("calibrate",),
    "estimate_friction": ("estimate", "friction"),
    "diagnose": ("diagnose", "--time-limit", str(SEARCHED_S)),
}
MOST_MB = 1500.0
_KB_A_MB = 1e3  # ru_maxrss is in kB


def figures() -> list[Figure]:
    """Measure."""
    with tempfile.TemporaryDirectory(prefix="bowden_long_") as place:
        folder = Path(place)
        whole, model = draw_case(SEED, "complete", length_s=float(LENGTHS_S[-1])).write(folder)
        recordings = [_first(whole, seconds) for seconds in LENGTHS_S]
        found = []
        for command, words in COMMANDS.items():
            used = [_used([*words, *_given(command, model, one)]) for one in recordings]
            times_s, peaks_mb = [one[0] for one in used], [one[1] for one in used]
            said = f"bowden {' '.join(words)}, one recording at 1 kHz"
            each = ", ".join(
                f"{seconds} s: {time_s:.1f} s, {peak_mb:.0f} MB"
                for seconds, time_s, peak_mb in zip(LENGTHS_S, times_s, peaks_mb, strict=True)
            )
            name = f"host.long.{command}"
            found += [
                Figure(f"{name}.core_time", times_s[-1], "s", f"{said}; {each}"),
                Figure(f"{name}.peak", peaks_mb[-1], "MB", said, f"<= {MOST_MB:g}"),
            ]
            if command != "diagnose":  # how many sets it fits depends on the data
                exponent = scaling_exponent([*LENGTHS_S], times_s)
                found.append(Figure(f"{name}.scaling_exponent", exponent, "", said, "<= 1.1"))
        return found


def _given(command: str, model: Path, recording: Path) -> tuple[str, ...]:
    """Return how a command takes its model and its recording."""
    if command.startswith("estimate"):
        return str(recording), "--model", str(model)
    return str(model), str(recording)


def _first(whole: Path, seconds: int) -> Path:
    """Write the first seconds of a recording beside it."""
    part = whole.with_name(f"first_{seconds}.csv")
    with whole.open(encoding="utf-8") as source, part.open("w", encoding="utf-8") as target:
        comments_and_header = 3
        target.writelines(islice(source, comments_and_header + seconds * RATE_HZ))
    return part


def _used(words: list[str]) -> tuple[float, float]:
    """Run a command; return its processor time, s, and its peak memory, MB."""
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "bowden.cli.main", *words]
    with Popen(command, stdout=DEVNULL, stderr=DEVNULL, env=one_thread) as process:
        _, status, use = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"bowden {' '.join(words)}: exit status {process.returncode}")
    return use.ru_utime + use.ru_stime, use.ru_maxrss / _KB_A_MB
