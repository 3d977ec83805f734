"""The same cable in Newton (PyPI `newton`), the nearest thing that a user could pick instead.

One cable of Table I with Coulomb friction, load end locked, the motor end pulled, let go and pulled
again. Needs an interpreter with `newton`: this one, or the one that BOWDEN_NEWTON_PYTHON names;
without it the subject is left out.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from bowden.model import Inputs, Mode, Trajectory, simulate
from numpy.typing import NDArray

from hil_tests.benchmarks.measurement import Figure
from hil_tests.benchmarks.model_speed import coulomb

_PINHOLES = 20
_ITERATIONS = 8
_RATE_HZ = 1000.0
_TIMED_RUNS = 5


def figures() -> list[Figure]:
    """Measure, if there is a Newton to measure."""
    python = _interpreter()
    if python is None:
        sys.stderr.write(
            "  left out: no `newton` here; install it in an environment of its own and set "
            "BOWDEN_NEWTON_PYTHON to that interpreter\n"
        )
        return []
    pull_m = _pull()
    exact, ours_s = _ours(pull_m, None)
    meshed, _ = _ours(pull_m, _PINHOLES)
    theirs = _theirs(python, pull_m)
    near, far = np.array(theirs["near_n"]), np.array(theirs["far_n"])
    work = (
        f"one cable of Table I, Coulomb friction, load end locked, pulled by 12 mm and back twice "
        f"in {pull_m.size / _RATE_HZ:g} s at 1 kHz; Newton {theirs['version']}, XPBD, {_PINHOLES} "
        f"pinholes, {_ITERATIONS} iterations, CPU"
    )
    errors = {
        "motor": _share(near, exact.motor_tension_a_n),
        "load": _share(far, exact.load_tension_a_n),
    }
    mesh_error = _share(meshed.motor_tension_a_n, exact.motor_tension_a_n)
    step_s = float(theirs["step_s"])
    return [
        *(
            Figure(
                f"model.newton.difference_{end}_tension",
                100.0 * error,
                "% of range, RMS",
                f"{work}; against the mesh-free solution (our mesh of {_PINHOLES} segments: "
                f"{100 * mesh_error:.2f} % at the motor)",
                "<= 1",
            )
            for end, error in errors.items()
        ),
        Figure(
            "model.newton.time_ratio",
            step_s * pull_m.size / ours_s,
            "x slower than mesh-free",
            f"{work}: {1e3 * step_s:.2f} ms a step, "
            f"{1 / (_RATE_HZ * step_s):.2f} x real time; ours: a pair, both cables",
        ),
    ]


def _interpreter() -> str | None:
    named = os.environ.get("BOWDEN_NEWTON_PYTHON")
    if named:
        return named
    return sys.executable if importlib.util.find_spec("newton") else None


def _pull() -> NDArray[np.float64]:
    """Pull by 12 mm, let go to 3 mm, pull again: the cable slides through, both ways."""
    levels = np.array([0.0, 12e-3, 3e-3, 12e-3])
    pull = np.interp(np.arange(4001) / 4000, np.linspace(0.0, 1.0, levels.size), levels)
    return np.asarray(pull)


def _ours(pull_m: NDArray[np.float64], segments: int | None) -> tuple[Trajectory, float]:
    model = coulomb(segments)
    angle = pull_m / model.transmission.motor_pulley_radius_m
    inputs = Inputs(
        np.arange(pull_m.size) / _RATE_HZ,
        motor_angle_rad=angle,
        load_angle_rad=np.zeros_like(angle),
    )
    simulate(model, Mode.POSITION_POSITION, inputs)  # compiles
    times = []
    for _ in range(_TIMED_RUNS):
        start = time.perf_counter()
        answer = simulate(model, Mode.POSITION_POSITION, inputs)
        times.append(time.perf_counter() - start)
    return answer, sorted(times)[_TIMED_RUNS // 2]


def _theirs(python: str, pull_m: NDArray[np.float64]) -> dict[str, Any]:
    pair = coulomb(None).transmission
    case = {
        "length_m": pair.length_m,
        "turning_rad": pair.wrap_rad,
        "mu": pair.friction.mu_d,
        "axial_stiffness_n": pair.axial_stiffness_n,
        "pretension_n": pair.pretension_n,
        "pinholes": _PINHOLES,
        "iterations": _ITERATIONS,
        "step_s": 1.0 / _RATE_HZ,
        "pull_m": pull_m.tolist(),
    }
    script = Path(__file__).with_name("newton_case.py")
    done = subprocess.run(
        [python, str(script)], input=json.dumps(case), capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"newton_case.py failed: {done.stderr.strip().splitlines()[-1]}")
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def _share(found: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean((found - truth) ** 2)) / np.ptp(truth))
