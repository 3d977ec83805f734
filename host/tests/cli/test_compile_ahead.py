"""What is compiled while a demo records is all that its comparison runs."""

from __future__ import annotations

import subprocess
import sys

#: A process of its own: here other tests have compiled. Counts what the comparison of another
#: recording adds to what `compile_ahead` has compiled.
_COUNT = """
import gc
import numpy as np
from numba.core.registry import CPUDispatcher
import bowden
from bowden.cli import compile_ahead

def compiled():
    kernels = (item for item in gc.get_objects() if isinstance(item, CPUDispatcher))
    return {(kernel.py_func.__qualname__, each) for kernel in kernels for each in kernel.signatures}

time_s = np.arange(0.0, 1.5, 2e-3)
stroke = np.cos(2.0 * np.pi * time_s) - 1.0
given = bowden.Recording(
    time_s,
    motor_torque_nm=0.05 * stroke,
    load_angle_rad=0.3 * stroke,
    motor_angle_rad=0.0 * stroke,
    load_torque_nm=0.0 * stroke,
)
run = bowden.simulate(bowden.table_1(), given)
noise = np.random.default_rng(1).normal(scale=2e-3, size=time_s.size)
measured = {
    "motor_angle_rad": np.round(run["motor_angle_rad"], 3),
    "load_angle_rad": np.round(run["load_angle_rad"], 3),
    "motor_torque_nm": run["motor_torque_nm"] + noise,
    "load_torque_nm": run["load_torque_nm"] + noise[::-1],
}
compile_ahead.compare_once()
before = compiled()
bowden.compare(bowden.table_1(), run.with_channels(measured))
print(len(before), sorted(name for name, _ in compiled() - before))
"""


def test_a_comparison_compiles_nothing_that_was_not_compiled_ahead() -> None:
    answer = subprocess.run(
        [sys.executable, "-c", _COUNT], capture_output=True, text=True, check=True
    )
    number, _, added = answer.stdout.strip().partition(" ")
    assert int(number) > 4, "the kernels are seen at all"
    assert added == "[]"
