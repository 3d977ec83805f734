"""The mesh's compiled kernels against other ways to the same answer.

Against an independent solver of the same chain of sliders, written plainly for this test (dense
matrices, one segment changed at a time, tiny steps); against the implicit kernels with their rate
terms set to nothing; and against themselves without the compiler.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Mode
from bowden.model.mesh.solver import simulate_mesh
from bowden.model.mesh_free.solver import simulate_mesh_free

from .rigs import FloatArray, printed, through, times

TP, PT, PP = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION


def motions(kind: str) -> tuple[Mode, FloatArray, FloatArray]:
    """Runs that partly move, move as a whole, part at a neutral node and go slack."""
    turn = np.arange(1200) * 2 * np.pi / 600
    load = np.deg2rad(20) * np.sin(turn)
    return {
        "free motor": (TP, 0 * load, load),
        "both at once": (TP, 0.15 * np.sin(2.3 * turn), load),
        "locked load": (TP, 0.7 * np.sin(turn), 0 * load),
        "both positions": (PP, 5.2 * load + 0.15 * np.sin(3.1 * turn), load),
        "load torque": (PT, 5.2 * load, 0.5 * np.sin(2.1 * turn)),
    }[kind]


KINDS = ("free motor", "both at once", "locked load", "both positions", "load torque")


@pytest.mark.parametrize("kind", KINDS)
def test_two_kernels_of_different_kind_agree(kind: str) -> None:
    """Event by event, and one implicit Newton step a sample, with a viscous term of nothing.

    The implicit chain has no virgin slopes: it is a^2/12 short of pretension, 4.7e-4 at N = 20.
    Just after a reversal, where tension has a vertical tangent, single samples show ten times that.
    """
    mode, x, y = motions(kind)
    pair = printed(20)
    law = replace(pair.friction, mu_v_s_per_m=1e-12, memory_s=0.0)
    by_events = simulate_mesh(pair, mode, times(x), x, y)
    implicit = simulate_mesh(replace(pair, friction=law), mode, times(x), x, y)
    for name in ("motor_tension_a_n", "load_tension_a_n", "motor_tension_b_n", "load_tension_b_n"):
        a, b = getattr(by_events, name), getattr(implicit, name)
        assert np.sqrt(np.mean((a - b) ** 2)) < 1e-3 * np.abs(a).max()
        np.testing.assert_allclose(a, b, atol=1e-2 * np.abs(a).max())


class PlainChain:
    """One cable as a chain of Coulomb sliders, solved by relaxation: slow, and with no cleverness.

    A segment whose tensions differ by more than friction holds gives way until they do not.
    """

    def __init__(self, segments: int, tension: float, wrap: float, compliance: float) -> None:
        self.ratio = np.exp(wrap)
        half = np.tanh(wrap / 2) / wrap * compliance if wrap > 0 else compliance / 2
        self.stiffness = 1 / np.concatenate([[half], np.full(segments - 1, 2 * half), [half]])
        self.tension = np.full(segments + 1, tension)

    def move(self, pull_0: float, pull_1: float) -> None:
        """Displace both ends outwards and let every segment give way until all hold."""
        t, k = self.tension, self.stiffness
        t[0] += k[0] * pull_0
        t[-1] += k[-1] * pull_1
        for _ in range(20_000):
            worst = 0.0
            for j in range(t.size - 1):
                for low, high in ((j, j + 1), (j + 1, j)):
                    excess = t[high] - t[low] * self.ratio
                    if excess > 0:
                        slip = excess / (k[high] + k[low] * self.ratio)
                        t[high] -= k[high] * slip
                        t[low] += k[low] * slip
                        worst = max(worst, excess)
            if worst < 1e-11 * t.max():
                return
        raise AssertionError("the plain chain did not settle")


@pytest.mark.parametrize(
    ("segments", "steps", "error_n"),
    [(1, 150, 0.05), (2, 150, 0.05), (2, 600, 0.0125), (5, 150, 0.02)],
)
def test_positions_against_a_plain_chain(segments: int, steps: int, error_n: float) -> None:
    """Both ends driven apart, together and alike.

    The plain chain takes a step at once: where a neutral node wanders within it, the order of slips
    matters. That error is of first order in the step, which pulls 0.1 N at 150 steps a line.
    """
    pull_0 = through(0, 1.5e-3, -1e-3, 0.5e-3, 2e-3, -1e-3, steps=steps)
    pull_1 = through(0, 0.5e-3, 1.5e-3, -1.5e-3, 1e-3, 1e-3, steps=steps)
    wrap, compliance = 1.5 / segments, 2.0 / 4000 / segments
    chain = PlainChain(segments, 10.0, wrap, compliance)
    expected = [chain.tension[[0, -1]].copy()]
    for step_0, step_1 in zip(np.diff(pull_0), np.diff(pull_1), strict=True):
        chain.move(step_0, step_1)
        expected.append(chain.tension[[0, -1]].copy())
    # An initial profile given point by point has no virgin slopes either.
    pair = printed(
        segments,
        initial_position_m=np.array([0.0, 2.0]),
        initial_tension_n=np.array([10.0, 10.0]),
    )
    found = simulate_mesh(pair, PP, times(pull_0), pull_0 / 0.020, -pull_1 / 0.104)
    ends = np.stack([found.motor_tension_a_n, found.load_tension_a_n], axis=1)
    np.testing.assert_allclose(ends, expected, atol=error_n)


def test_compiled_and_plain_python_give_the_same_numbers() -> None:
    """The same functions with the compiler switched off, in a process of their own."""
    script = """
import json
import numpy as np
from bowden.model import FrictionLaw, Mode, Transmission
from bowden.model.mesh.solver import simulate_mesh
out = []
for mu_s, mu_v in ((0.21, 0.0), (0.63, 0.0), (0.21, 0.3)):
    law = FrictionLaw(0.21, mu_s, 0.05, mu_v_s_per_m=mu_v)
    pair = Transmission(4000.0, np.array([1.0, 1.0]), np.array([0.0, 3.0]), 10.0, 0.02, 0.104,
                        law, segments=6)
    t = np.arange(120) * 2e-3
    torque, load = 0.3 * np.sin(40 * t), 0.2 * np.sin(25 * t)
    found = simulate_mesh(pair, Mode.TORQUE_POSITION, t, torque, load)
    out += [found.motor_angle_rad.tolist(), found.load_torque_nm.tolist()]
print(json.dumps(out))
"""
    runs = [
        json.loads(
            subprocess.run(
                [sys.executable, "-c", script],
                env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
                capture_output=True,
                check=True,
                text=True,
            ).stdout
        )
        for disabled in ("0", "1")
    ]
    # The compiler may contract a product and a sum: rounding, some hundred steps of it.
    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-9, atol=1e-11)


def test_a_run_leaves_no_state_behind() -> None:
    """The same run twice is the same to the bit."""
    mode, x, y = motions("both at once")
    pair = printed(20)
    first = simulate_mesh(pair, mode, times(x), x, y)
    simulate_mesh(pair, PP, times(x), x, y)
    again = simulate_mesh(pair, mode, times(x), x, y)
    assert np.array_equal(first.load_torque_nm, again.load_torque_nm)


def test_the_mesh_tends_to_the_mesh_free_solution() -> None:
    mode, x, y = motions("free motor")
    pair = printed(
        piece_length_m=np.array([0.7, 0.5, 0.8]),
        piece_curvature_per_m=np.array([2.0, 0.0, 6.0]),
    )
    exact = simulate_mesh_free(pair, mode, times(x), x, y).load_torque_nm

    def gap(segments: int) -> float:
        mesh = replace(pair, segments=segments)
        found = simulate_mesh(mesh, mode, times(x), x, y).load_torque_nm
        return float(np.sqrt(np.mean((found - exact) ** 2)))

    # Where the load torque has a vertical tangent the order is 3/2: a factor of 8 for one of 4.
    assert gap(400) < gap(100) / 8
    assert gap(400) < 1e-4
