"""Dahl, LuGre and modified Bouc-Wen: their equations, and the limit in which each is Coulomb.

References: closed forms, and the unscaled differential equations integrated by scipy.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from bowden.model.errors import ModelError
from bowden.model.friction.bouc_wen import BoucWen, Branch, bouc_wen_step
from bowden.model.friction.dahl import Dahl, dahl_step
from bowden.model.friction.lugre import LuGre, lugre_step
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

Law = Dahl | LuGre | BoucWen
Stepped = tuple[float, float, float]


def stepper(law: Law, step_s: float = 1e-3) -> Callable[[float, float], Stepped]:
    """(state, slip) -> friction over Fc, derivative, new state."""
    if isinstance(law, Dahl):
        return lambda zeta, slip: dahl_step(zeta, slip, law.numbers)
    if isinstance(law, LuGre):
        return lambda zeta, slip: lugre_step(zeta, slip, step_s, law.numbers)
    return lambda zeta, slip: bouc_wen_step(zeta, slip, 0.0, law.numbers)


LAWS: dict[str, Callable[[float], Law]] = {
    "Dahl, exponent 0": lambda x: Dahl(x, 0.0),
    "Dahl, exponent 1/2": lambda x: Dahl(x, 0.5),
    "Dahl": Dahl,
    "Dahl, exponent 2": lambda x: Dahl(x, 2.0),
    "LuGre": LuGre,
    "Bouc-Wen": BoucWen,
    "Bouc-Wen, sharp": lambda x: BoucWen(x, Branch(2.0, 3.0), Branch(2.0, 3.0)),
}
states, slips = st.floats(-0.999, 0.999), st.floats(-3e-3, 3e-3)


@pytest.mark.parametrize("name", LAWS)
def test_coulomb_is_the_limit_of_short_presliding(name: str) -> None:
    """After 1 mm of slip in either direction friction is +-Fc, the closer the shorter x_p."""
    errors = []
    for presliding in (1e-4, 1e-5, 1e-6):
        step = stepper(LAWS[name](presliding))
        worst = 0.0
        for start in (-1.0, -0.3, 0.0, 0.8, 1.0):
            for slip in (1e-3, -1e-3):
                worst = max(worst, abs(step(start, slip)[0] - np.sign(slip)))
        errors.append(worst)
    # exponent 2 approaches like x_p/x, the others exponentially or at once
    assert errors[2] < 1.1e-3
    assert errors[2] <= errors[1] <= errors[0]


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=40, deadline=None)
@given(zeta=states, slip=slips)
def test_a_step_is_the_sum_of_its_halves_and_bounded(name: str, zeta: float, slip: float) -> None:
    step = stepper(LAWS[name](2e-4))
    once = step(zeta, slip)[2]
    twice = step(step(zeta, slip / 2)[2], slip / 2)[2]
    # Bouc-Wen is integrated to 1e-4, the others in closed form
    assert twice == pytest.approx(once, abs=2e-4 if "Bouc" in name else 1e-9)
    assert -1.0 <= once <= 1.0
    assert np.sign(slip) * (once - zeta) >= -1e-12  # friction grows against the motion


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=40, deadline=None)
@given(zeta=st.floats(-0.9, 0.9), slip=slips)
def test_the_derivative_that_the_solver_uses(name: str, zeta: float, slip: float) -> None:
    step = stepper(LAWS[name](1e-3))
    small = 1e-5 if "Bouc" in name else 1e-8
    if abs(slip) < 2 * small or (name.endswith("0") and abs(zeta + slip / 1e-3) > 0.999):
        return  # the kinks: rest, and the end of the elastic part
    numeric = (step(zeta, slip + small)[0] - step(zeta, slip - small)[0]) / (2 * small)
    # of 1/x_p = 1000: difference quotients are good to small/x_p, and Bouc-Wen's integrator changes
    # its step, by 1e-5, at some slips
    tolerance = 20.0 if "Bouc" in name else 2.0
    assert step(zeta, slip)[1] == pytest.approx(numeric, rel=2e-3, abs=tolerance)


@pytest.mark.parametrize("name", LAWS)
def test_a_closed_cycle_of_slip_dissipates(name: str) -> None:
    step = stepper(LAWS[name](2e-4))
    x = 5e-4 * np.sin(np.linspace(0, 6 * np.pi, 600))
    zeta, work = 0.0, 0.0
    for i in range(1, len(x)):
        friction, _, zeta = step(zeta, x[i] - x[i - 1])
        work += friction * (x[i] - x[i - 1]) * (i >= 400)
    assert work > 0


def test_dahl_is_an_exponential() -> None:
    law = Dahl(1e-4)
    for slip in (1e-6, 5e-5, 3e-4):
        assert dahl_step(0.0, slip, law.numbers)[0] == pytest.approx(-np.expm1(-slip / 1e-4))
        back = dahl_step(1.0, -slip, law.numbers)[0]
        assert back == pytest.approx(2 * np.exp(-slip / 1e-4) - 1)


def test_dahl_with_exponent_zero_is_a_spring_that_slides() -> None:
    numbers = Dahl(1e-4, 0.0).numbers
    assert dahl_step(0.0, 4e-5, numbers)[0] == pytest.approx(0.4)
    assert dahl_step(0.0, 9e-4, numbers)[:2] == (1.0, 0.0)


def test_lugre_sliding_steadily_is_stribeck_and_viscous() -> None:
    law = LuGre(1e-5, 1.8, 0.02, 1e-3, 0.5)
    for speed in (0.001, 0.02, -0.1):
        zeta = 0.0
        for _ in range(100):
            friction, _, zeta = lugre_step(zeta, speed * 1e-2, 1e-2, law.numbers)
        expected = np.sign(speed) * (1 + 0.8 * np.exp(-((speed / 0.02) ** 2))) + 0.5 * speed
        assert friction == pytest.approx(expected, rel=1e-9)


def test_lugre_against_its_differential_equation() -> None:
    """Unscaled: sigma_0 = Fc/x_p, and so on, for Fc = 3 N at a varying speed."""
    law = LuGre(2e-4, 1.5, 0.01, 2e-3, 0.7)
    normal, sigma_0 = 3.0, 3.0 / 2e-4

    def speed(t: float) -> float:
        return 0.02 * np.sin(40 * t)

    def bristle(t: float, z: list[float]) -> list[float]:
        v = speed(t)
        g = normal * (1 + 0.5 * np.exp(-((v / 0.01) ** 2)))
        return [v - sigma_0 * abs(v) * z[0] / g]

    times = np.linspace(0, 0.5, 20001)
    exact = solve_ivp(bristle, (0, 0.5), [0.0], t_eval=times, rtol=1e-9, atol=1e-12).y[0]
    zeta, found = 0.0, [0.0]
    for t in 0.5 * (times[1:] + times[:-1]):
        h = times[1] - times[0]
        _, _, zeta = lugre_step(zeta, speed(float(t)) * h, h, law.numbers)
        found.append(zeta * normal / sigma_0)
    # a speed held over 25 us: second order in 40 rad/s * 25 us
    np.testing.assert_allclose(found, exact, atol=1e-3 * np.max(np.abs(exact)))


@pytest.mark.parametrize(("sigma", "n"), [(0.5, 1.0), (1.0, 1.5), (2.0, 2.0), (3.0, 1.2)])
def test_bouc_wen_against_its_differential_equation(sigma: float, n: float) -> None:
    rho = 5000.0
    law = BoucWen(1 / rho, Branch(sigma, n), Branch(sigma, n))
    x = np.concatenate((np.linspace(0, 4e-4, 40), np.linspace(4e-4, -3e-4, 70)))

    def shape(_: float, w: list[float], way: float) -> list[float]:
        z = w[0]
        slow = sigma * np.sign(way) * abs(z) ** (n - 1) * z - (sigma - 1) * abs(z) ** n
        return [rho * (1 - slow)]

    zeta, exact = 0.0, 0.0
    for a, b in pairwise(x):
        _, _, zeta = bouc_wen_step(zeta, b - a, b, law.numbers)
        way = float(np.sign(b - a))
        span = (a, b) if b != a else (a, a + 1e-15)
        out = solve_ivp(shape, span, [exact], args=(way,), rtol=1e-8, atol=1e-10)
        exact = float(out.y[0, -1])
        assert zeta == pytest.approx(exact, abs=1e-4)  # Runge-Kutta in steps of x_p/4


def test_asymmetric_bouc_wen_slides_at_its_own_limit_each_way() -> None:
    law = BoucWen(1e-5, Branch(limit=1.2), Branch(limit=0.9), alpha_per_m=2.0, nu=0.05)
    ahead, _, state = bouc_wen_step(0.0, 1e-2, 1e-2, law.numbers)
    assert ahead == pytest.approx(1.2 + 0.02 + 0.05)
    back, _, _ = bouc_wen_step(state, -1e-2, 0.0, law.numbers)
    assert back == pytest.approx(-0.9 + 0.05)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Dahl(0.0), "presliding_m"),
        (lambda: Dahl(1e-4, -1.0), "exponent"),
        (lambda: LuGre(1e-4, 0.9), "stiction_ratio"),
        (lambda: LuGre(1e-4, viscous_s_per_m=float("nan")), "viscous_s_per_m"),
        (lambda: BoucWen(1e-4, Branch(sigma=0.4)), "forward.sigma"),
        (lambda: BoucWen(1e-4, backward=Branch(limit=0.0)), "backward.limit"),
    ],
)
def test_impossible_parameters_are_refused(make: Callable[[], Law], word: str) -> None:
    with pytest.raises(ModelError, match=word):
        make()
