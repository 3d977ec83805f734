"""How fast the offline model is: mesh, mesh-free solution, the paper's dense solve, batches.

The work is Experiment 2 (an operator moves the load by 40 degrees at 0.5 Hz against the tunnel) at
1 kHz, on one core.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from bowden.model import Inputs, Mode, Model, simulate, table_1
from bowden.model.experiments.locked_load import DWELL_S, PEAK_TORQUE_NM, SLOPE_NM_PER_S
from bowden.model.experiments.signals import ramps_with_dwells, sample_times, sine
from bowden.model.experiments.tunnel import tunnel_torque
from bowden.model.experiments.variants import with_segments, without_mesh, without_stiction_length

from hil_tests.benchmarks.dense_solve import load_torque_while_sliding
from hil_tests.benchmarks.measurement import Figure, medians_s, scaling_exponent

_RATE_HZ = 1000.0
_DURATION_S = 10.0
_SIZES = [50, 100, 200, 400]
_DURATIONS_S = [5, 10, 20, 40]
_LONG_S = 60.0  # so that what a call costs once does not count
_ROUNDS = 9
_DENSE_STEPS = 40


def figures() -> list[Figure]:
    """Measure."""
    return [*_mesh(), *_mesh_free(), _dense()]


def coulomb(segments: int | None) -> Model:
    """Return Table I with Coulomb friction, on a mesh or (None) without one."""
    model = without_stiction_length(table_1())
    text = {"friction.mu_s": model.value("friction.mu_d")}
    model = model.with_values(text)
    return without_mesh(model) if segments is None else with_segments(model, segments)


def _run(model: Model, duration_s: float = _DURATION_S) -> Callable[[], object]:
    time_s = sample_times(duration_s, _RATE_HZ)
    angle = sine(time_s, float(np.radians(40.0)), 0.5)
    inputs = Inputs(time_s, motor_torque_nm=tunnel_torque(angle), load_angle_rad=angle)
    return functools.partial(simulate, model, Mode.TORQUE_POSITION, inputs)


def _mesh() -> list[Figure]:
    table = with_segments(table_1(), 100)
    runs = {"table": _run(table), "coulomb": _run(coulomb(100))}
    runs |= {f"n{n}": _run(with_segments(table_1(), n)) for n in _SIZES}
    runs |= {f"t{t}": _run(table, t) for t in _DURATIONS_S}
    times = medians_s(runs, _ROUNDS)
    by_n = [times[f"n{n}"] for n in _SIZES]
    by_time = [times[f"t{t}"] for t in _DURATIONS_S]
    work = "pull-pull pair, Table I, Experiment 2 at 1 kHz, one core"
    return [
        Figure(
            "model.mesh.n100.realtime_factor",
            _DURATION_S / times["table"],
            "simulated s per s",
            f"{work}, stiction, 100 segments",
            ">= 300",
        ),
        Figure(
            "model.mesh.n100.coulomb.realtime_factor",
            _DURATION_S / times["coulomb"],
            "simulated s per s",
            f"{work}, Coulomb friction, 100 segments",
        ),
        Figure(
            "model.mesh.scaling_exponent_n",
            scaling_exponent(_SIZES, by_n),
            "",
            f"{work}; {', '.join(map(str, _SIZES))} segments",
            "<= 1.1",
        ),
        Figure(
            "model.mesh.scaling_exponent_time",
            scaling_exponent(_DURATIONS_S, by_time),
            "",
            f"{work}, 100 segments; {', '.join(map(str, _DURATIONS_S))} s",
            "<= 1.1",
        ),
    ]


def _mesh_free() -> list[Figure]:
    """Compare where the whole pair slides (Experiment 2) and where only fronts move (1)."""
    runs: dict[str, Callable[[], object]] = {}
    for solver, model in (("mesh", coulomb(100)), ("mesh_free", coulomb(None))):
        runs[f"{solver}.2"] = _run(model, _LONG_S)
        runs[f"{solver}.1"] = _run_locked(model, _LONG_S)
    times = medians_s(runs, _ROUNDS)
    return [
        Figure(
            f"model.mesh_free.speedup_over_n100{suffix}",
            times[f"mesh.{name}"] / times[f"mesh_free.{name}"],
            "x",
            f"Table I with Coulomb friction, Experiment {name} ({what}), {_LONG_S:g} s at 1 kHz, "
            f"one core; mesh-free: {_LONG_S / times[f'mesh_free.{name}']:.0f} x real time",
            goal,
        )
        for name, suffix, what, goal in (
            ("2", "", "the whole pair slides most of the time", ">= 5, aim 20"),
            ("1", ".experiment_1", "load locked, only fronts move", ""),
        )
    ]


def _run_locked(model: Model, duration_s: float) -> Callable[[], object]:
    time_s = sample_times(duration_s, _RATE_HZ)
    torque = ramps_with_dwells(time_s, PEAK_TORQUE_NM, SLOPE_NM_PER_S, DWELL_S)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=np.zeros_like(torque))
    return functools.partial(simulate, model, Mode.TORQUE_POSITION, inputs)


def _dense() -> Figure:
    """Compare on a stretch in which the pair slides as a whole, and check that both agree."""
    model = coulomb(100)
    time_s = sample_times(_LONG_S, _RATE_HZ)
    angle = 0.1 * time_s
    inputs = Inputs(time_s, motor_torque_nm=np.zeros_like(angle), load_angle_rad=angle)
    mesh = functools.partial(simulate, model, Mode.TORQUE_POSITION, inputs)
    late = slice(-_DENSE_STEPS, None)
    dense = functools.partial(
        load_torque_while_sliding, model.transmission, np.zeros(_DENSE_STEPS), angle[late]
    )
    difference = float(np.abs(dense() - mesh().load_torque_nm[late]).max())
    if difference > 1e-9:
        raise RuntimeError(f"dense solve and mesh differ by {difference:g} N m")
    times = medians_s({"dense": dense, "mesh": mesh}, 5)
    dense_s, mesh_s = times["dense"] / _DENSE_STEPS, times["mesh"] / time_s.size
    return Figure(
        "model.dense_solve.slowdown_n100",
        dense_s / mesh_s,
        "x",
        f"one dense solve a step (numpy) of the paper's equations, {1e6 * dense_s:.0f} us, against "
        f"the mesh's {1e6 * mesh_s:.2f} us; pair, 100 segments, sliding as a whole, so without the "
        f"search for the last moving nodes; both agree to {difference:.0e} N m",
    )
