"""One measured figure, and how times are taken: interleaved, as medians, in this one process.

Knows no subject. Times are this process's own on its core, not the wall clock's; ratios come from
one run in which the contestants take turns, so that a busy machine slows all of them alike.
"""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Figure:
    """A row of build/bench.json.

    Parameters
    ----------
    name : str
        Dotted, stable: other tools look it up.
    value : float
    unit : str
    context : str
        What was run, so that the figure can be understood alone.
    goal : str
        What is aimed at; empty where nothing is.
    """

    name: str
    value: float
    unit: str
    context: str
    goal: str = ""


def medians_s(contestants: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Time callables in turns; return each one's median of core time, s, after an unmeasured run.

    Parameters
    ----------
    contestants : mapping of str to callable
    rounds : int, >= 1
    """
    for run in contestants.values():
        run()
    times: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            start = time.process_time()
            run()
            times[name].append(time.process_time() - start)
    return {name: statistics.median(values) for name, values in times.items()}


def scaling_exponent(sizes: list[int], times_s: list[float]) -> float:
    """Return p of ``time ~ size^p``, by least squares in logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(times_s), 1)[0])


def load() -> str:
    """Describe how busy this machine is now."""
    return f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def machine() -> str:
    """Describe this machine in a line."""
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next(x.split(":")[1].strip() for x in lines if x.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{processor}, {platform.system()}, Python {platform.python_version()}"
