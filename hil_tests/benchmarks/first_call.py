"""How long a user waits for the first answer: a fresh process, numba's cache on disk warm."""

from __future__ import annotations

import subprocess
import sys

from hil_tests.benchmarks.measurement import Figure

_ASK = """
import time
start = time.perf_counter()
from bowden.model import *
from bowden.model.experiments.variants import *
import numpy as np
imported = time.perf_counter()
time_s = np.arange(1001) * 1e-3
inputs = Inputs(time_s, motor_torque_nm=0 * time_s, load_angle_rad=np.sin(time_s))
model = {model}
simulate(model, Mode.TORQUE_POSITION, inputs)
print(time.perf_counter() - imported, imported - start)
"""
_MODELS = {
    "mesh": "table_1()",
    "mesh_free": "without_mesh(without_stiction_length(table_1()))",
}
_ROUNDS = 3


def figures() -> list[Figure]:
    """Measure."""
    found = []
    for name, model in _MODELS.items():
        _ask(model)  # fills the cache
        answers = sorted(_ask(model) for _ in range(_ROUNDS))
        call_s, import_s = answers[_ROUNDS // 2]
        found.append(
            Figure(
                "model.first_call_s" if name == "mesh" else f"model.{name}.first_call_s",
                call_s,
                "s",
                f"first simulate() of a fresh process, {name} solver, after an import of "
                f"{import_s:.2f} s; compiled code from numba's cache",
                "< 3",
            )
        )
    return found


def _ask(model: str) -> tuple[float, float]:
    command = [sys.executable, "-c", _ASK.format(model=model)]
    answer = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(answer[0]), float(answer[1])
