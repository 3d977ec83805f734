"""The search on landscapes that are drawn, so that the lowest place is known without a simulator.

A recording's real covariance weighs residuals that are a given function of one number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.descend import descend
from bowden.estimation.likelihood import Scales
from bowden.estimation.parameters import parameters_of
from bowden.estimation.problem import Problem
from bowden.estimation.scan import among_steps, down_the_stairs
from bowden.estimation.search import solve
from bowden.model import Mode, Trajectory, parse_model
from bowden.workers import Workers
from numpy.typing import NDArray

from ..rigs import TABLE_1, experiment_2

_Floats = NDArray[np.float64]

MODE = Mode.TORQUE_POSITION
MODEL = parse_model(TABLE_1)
NUMBER = "rig.cable.pretension_n"
STICKING = parse_model(
    TABLE_1.replace("coulomb", "stiction").replace(
        "mu_d: {value: 0.21, tolerance: 10 %}", "mu_d: 0.21, mu_s: {value: 0.4, tolerance: 10 %}"
    )
)


@dataclass(frozen=True)
class Landscape(Problem):
    """A problem whose residuals are `heights`, independent of each other, in standard deviations.

    Two of them; the argument is the number's distance from the file's value in prior sigma.
    """

    heights: Callable[[float], tuple[float, float]]
    noise: Covariance

    def heights_at(self, away: _Floats) -> tuple[float, float]:
        """By the distance of each number from the file's value: the first alone counts."""
        return self.heights(float(away[0]))

    def residuals_at(
        self,
        points: Sequence[_Floats],
        noises: Sequence[Covariance],
        known: Sequence[Mapping[int, _Floats]] | None = None,
        near: Sequence[Trajectory | None] | None = None,
    ) -> list[list[_Floats] | None]:
        """Noise of the size that it has, and the heights in two directions that are random."""
        del noises, known, near
        sigma = np.sqrt(self.noise.own)
        drawn = np.random.default_rng(0).normal(size=(sigma.size, 3))
        usual, *patterns = np.linalg.qr(drawn)[0].T * sigma
        found: list[list[_Floats] | None] = []
        for x in points:
            high = self.heights_at((x - self.start()) / self.unit)
            shift = sum(h * p for h, p in zip(high, patterns, strict=True))
            found.append([usual * np.sqrt(sigma.size) + shift])
        return found

    def answered(
        self, x: _Floats, noises: Sequence[Covariance]
    ) -> tuple[list[Trajectory | None], list[_Floats]] | None:
        answers, residuals = self.answers(x), self.residuals(x, noises)
        return None if answers is None or residuals is None else (answers, residuals)

    def noises(self, x: _Floats) -> list[Covariance]:
        """The same everywhere: only the sensors'."""
        del x
        return [self.noise]


@pytest.fixture(scope="module")
def draw() -> Callable[[Callable[[float], tuple[float, float]]], Landscape]:
    """Return what makes a problem of heights."""
    true = experiment_2(MODEL, seconds=3.0)
    rng = np.random.default_rng(1)
    noisy = true.load_torque_nm + rng.normal(0.0, 1e-3, true.time_s.size)
    data = Data.of(true.with_channels({}, load_torque_nm=noisy), 0, MODEL, MODE)
    whole = covariance(data, MODEL)
    noise = replace(
        whole,
        offset=np.zeros_like(whole.offset),
        inputs=np.zeros_like(whole.inputs),
    )
    parameters = parameters_of(MODEL, [NUMBER])
    return lambda heights: Landscape((data,), parameters, (), (None,), Workers(1), heights, noise)


def found(problem: Landscape) -> float:
    """Where the search ends, in prior sigma from the file's value."""
    return float((solve(problem).x[0] - problem.start()[0]) / problem.unit[0])


def cost(problem: Landscape, at: float) -> float:
    first, second = problem.heights(at)
    return 0.5 * (first**2 + second**2 + at**2)


@pytest.mark.parametrize("seed", range(8))
def test_the_deepest_of_many_valleys_is_found(draw: Callable[..., Landscape], seed: int) -> None:
    rng = np.random.default_rng(seed)
    bottom, width = rng.uniform(-1.0, 1.0), rng.uniform(0.1, 0.3)
    period, depth = rng.uniform(0.05, 0.25), rng.uniform(2.0, 6.0)
    problem = draw(
        lambda u: ((u - bottom) / width, depth * float(np.sin(np.pi * (u - bottom) / period)))
    )
    lowest = min(cost(problem, float(at)) for at in np.linspace(-2.0, 2.0, 20_001))
    # A descent ends where a step gains less than 0.02; the grid is finer than that.
    assert cost(problem, found(problem)) < lowest + 0.1


def staircase(u: float) -> tuple[float, float]:
    """Level but for one step down, to a floor an eighth of a sigma wide: no slope leads there."""
    return (0.0 if abs(u - 1.33) < 0.0625 else 12.0), 0.0


@pytest.mark.parametrize(("path", "is_found"), [("friction.mu_s", True), (NUMBER, False)])
def test_a_breakaway_is_looked_for_where_no_slope_leads(
    draw: Callable[..., Landscape], path: str, is_found: bool
) -> None:
    """Whatever else has a prior is not: its likelihood has slopes."""
    problem = replace(draw(staircase), parameters=parameters_of(STICKING, [path]))
    assert (cost(problem, found(problem)) < 2.0) is is_found


@pytest.mark.parametrize(
    ("path", "from_s", "is_lower"),
    # The lower floor is from 1.2675 to 1.3925; there the prior is likeliest where it begins.
    [("friction.mu_s", 0.0, True), ("friction.mu_s", 1.27, False), (NUMBER, 0.0, False)],
)
def test_the_stairs_lead_down_from_where_another_breakaway_does_better(
    draw: Callable[..., Landscape], path: str, from_s: float, is_lower: bool
) -> None:
    problem = replace(draw(staircase), parameters=parameters_of(STICKING, [path]))
    at = problem.start() + from_s * problem.unit
    here = descend(problem, at, [problem.noise], Scales((0.0, 0.0)), rounds=0)
    assert here is not None
    lower = down_the_stairs(problem, here)
    assert (lower is not None) is is_lower
    if lower is not None:
        assert float((lower[0] - problem.start()[0]) / problem.unit[0]) == pytest.approx(
            1.33, abs=0.07
        )


@pytest.mark.parametrize("is_held", [True, False])
def test_where_fits_are_compared_no_slope_moves_a_breakaway(
    draw: Callable[..., Landscape], *, is_held: bool
) -> None:
    """From step to step the likelihood has no slope, and what is taken for one leads elsewhere."""
    problem = replace(
        draw(lambda u: ((u - 0.9) / 0.2, 0.0)),
        parameters=parameters_of(STICKING, ["friction.mu_s"]),
        holds_stepped=is_held,
    )
    there = descend(problem, problem.start(), [problem.noise], Scales((0.0, 0.0)))
    assert there is not None
    moved = float((there.x[0] - problem.start()[0]) / problem.unit[0])
    assert moved == (0.0 if is_held else pytest.approx(0.9, abs=0.1))


@dataclass(frozen=True)
class Plane(Landscape):
    """A landscape over the breakaway and the pretension: a floor lies low where both fit."""

    def heights_at(self, away: _Floats) -> tuple[float, float]:
        """On the floor the pretension is wanted elsewhere: as it is, it is as bad as off it."""
        u, v = away
        return (0.0, 30.0 * (v - 0.5)) if abs(u - 1.33) < 0.0625 else (12.0, 30.0 * v)


def over(plane: type[Landscape], like: Landscape, *, first: str = "friction.mu_s") -> Landscape:
    """A landscape over that number and the pretension, breakaways held as in the diagnosis."""
    parameters, held = parameters_of(STICKING, [first, NUMBER]), {"holds_stepped": True}
    heights = like.heights, like.noise
    return plane(like.data, parameters, (), like.blocks, like.pool, *heights, **held)


def test_a_lower_step_is_found_though_other_numbers_fit_there(
    draw: Callable[..., Landscape],
) -> None:
    problem = over(Plane, draw(staircase))
    here = descend(problem, problem.start(), [problem.noise], Scales((0.0, 0.0)))
    assert here is not None
    lower = down_the_stairs(problem, here)
    assert lower is not None
    # The step's half width; a thirtieth of a sigma is what the pretension is known to.
    away = (lower - problem.start()) / problem.unit
    assert away == pytest.approx([1.33, 0.5], abs=0.07)
    assert down_the_stairs(problem, replace(here, slopes=None)) is None


@dataclass(frozen=True)
class Ramp(Landscape):
    """On the floor the pretension is wanted two sigma higher a sigma of the breakaway."""

    def heights_at(self, away: _Floats) -> tuple[float, float]:
        """High off the floor; there the pretension alone counts."""
        u, v = away
        return staircase(float(u))[0], 30.0 * (v - 2.0 * (u - 1.33))


def test_numbers_are_as_uncertain_as_a_step_is_wide(draw: Callable[..., Landscape]) -> None:
    problem = over(Ramp, draw(staircase))
    there = problem.start() + np.array([1.33, 0.0]) * problem.unit
    best = descend(problem, there, [problem.noise], Scales((0.0, 0.0)))
    assert best is not None
    found = among_steps(problem, best) / np.outer(problem.unit, problem.unit)
    # Anywhere on the floor is about as likely: an even spread over an eighth of a sigma. The scan's
    # values lie 0.008 apart; the prior is a sixth likelier at one end than at the other.
    spread = 0.125 / np.sqrt(12.0)
    follows = spread * np.array([1.0, 2.0])
    assert found == pytest.approx(np.outer(follows, follows), rel=0.15)
    assert not among_steps(replace(problem, holds_stepped=False), best).any()


@dataclass(frozen=True)
class Slopes(Landscape):
    """Two numbers, each with a slope of its own; `asked` keeps the places that are looked at."""

    asked: list[_Floats] = field(default_factory=list, kw_only=True)

    def heights_at(self, away: _Floats) -> tuple[float, float]:
        """Of the first by a slope of 5, of the second by one that `heights` has at 1."""
        self.asked.append(away)
        return 5.0 * float(away[0]), self.heights(1.0)[0] * float(away[1])


@pytest.mark.parametrize(("slope", "is_asked"), [(0.1, False), (1.0, True)])
def test_no_derivative_is_taken_of_what_the_data_do_not_tell(
    draw: Callable[..., Landscape], slope: float, *, is_asked: bool
) -> None:
    """A tenth a prior sigma: the data say 0.005 of it, the prior 0.5."""
    problem = over(Slopes, draw(lambda u: (slope * u, 0.0)), first="friction.mu_d")
    noises, scales = [problem.noise], Scales((0.0, 0.0))
    best = descend(problem, problem.start(), noises, scales)
    assert best is not None
    problem.asked.clear()
    again = descend(problem, best.x, noises, scales, begun=replace(best, settled=False))
    assert again is not None
    reach = np.max(np.abs(problem.asked - (best.x - problem.start()) / problem.unit), axis=0)
    assert reach[0] == pytest.approx(0.1, rel=0.1)  # half of its sigma, a fifth
    assert bool(reach[1] > 0.1) is is_asked
    # What is not asked anew stands: the landscape is even, the prior nearly.
    assert again.hessian == pytest.approx(best.hessian, rel=1e-4)


@pytest.mark.parametrize(
    ("first", "second", "is_settled"), [(0.17, 0.17, True), (0.28, 0.0, False), (0.0, 0.28, False)]
)
def test_a_search_ends_where_no_number_moves_by_a_fifth_of_its_sigma(
    draw: Callable[..., Landscape], first: float, second: float, *, is_settled: bool
) -> None:
    """Two that gain 0.0145 each end it, though 0.02 in all does not; one that gains 0.04 does."""
    problem = over(Slopes, draw(lambda u: (3.0 * u, 0.0)), first="friction.mu_d")
    noises, scales = [problem.noise], Scales((0.0, 0.0))
    best = descend(problem, problem.start(), noises, scales)
    assert best is not None
    sigma = np.sqrt(np.diag(problem.covariance(best.hessian)))
    away = best.x + np.array([first, second]) * sigma
    ended = descend(problem, away, noises, scales, rounds=1, begun=replace(best, settled=False))
    assert ended is not None
    assert ended.settled is is_settled
    assert ended.x == pytest.approx(best.x, abs=0.01 * float(sigma.min()))


@dataclass(frozen=True)
class Curved(Landscape):
    """A valley in two numbers, v = u^2, as steep as `heights` has it at 1; it falls to u = 0.8."""

    def heights_at(self, away: _Floats) -> tuple[float, float]:
        u, v = float(away[0]), float(away[1])
        return self.heights(1.0)[0] * (v - u**2), 10.0 * (u - 0.8)


@pytest.mark.parametrize("steep", [10.0, 100.0, 1000.0])
def test_a_search_follows_a_valley_that_is_curved(
    draw: Callable[..., Landscape], steep: float
) -> None:
    problem = over(Curved, draw(lambda u: (steep * u, 0.0)), first="friction.mu_d")
    best = descend(problem, problem.start(), [problem.noise], Scales((0.0, 0.0)))
    assert best is not None
    u, v = (best.x - problem.start()) / problem.unit
    # The prior of the second draws it back: 100 (u - 0.8) + 2 u^3 = 0 on the floor, u = 0.790. A
    # search ends where a step gains 0.02, which is 0.02 along the floor.
    assert u == pytest.approx(0.79, abs=0.02)
    assert v == pytest.approx(u**2, abs=0.03)
    assert best.settled


@pytest.mark.parametrize("from_s", [-1.0, 0.0, 1.0])
def test_an_interval_is_that_of_the_valley_whatever_its_floor(
    draw: Callable[..., Landscape], from_s: float
) -> None:
    """Over the floor's ripples slopes are three times as steep as the valley's sides."""
    width = 0.3
    problem = draw(
        lambda u: ((u - from_s) / width + 0.03 * float(np.sin((u - from_s) / 0.00255)), 0.0)
    )
    best = solve(problem)
    sigma = float(np.sqrt(problem.covariance(best.hessian)[0, 0])) / problem.unit[0]
    # The ripple changes half a sigma's rise, 0.5, by 0.03 at most; the prior's sigma is 1.
    assert sigma == pytest.approx((width**-2 + 1.0) ** -0.5, rel=0.06)


def test_a_fit_that_goes_on_from_an_optimum_uses_the_derivatives_found_there(
    draw: Callable[..., Landscape],
) -> None:
    asked: list[float] = []

    def bowl(u: float) -> tuple[float, float]:
        asked.append(u)
        return (u - 0.5) / 0.2, 0.0

    problem = draw(bowl)
    noises, scales = [problem.noise], Scales((0.0, 0.0))
    best = descend(problem, problem.start(), noises, scales)
    assert best is not None
    assert best.settled
    least = float(best.x[0] - problem.start()[0])
    least /= float(problem.unit[0])
    asked.clear()
    again = descend(problem, best.x, noises, best.scales, begun=best)
    assert again is not None
    # Derivatives are taken half a sigma either way, 0.1; a step from the least place is none.
    assert max(abs(u - least) for u in asked) < 0.01
    asked.clear()
    anew = descend(problem, best.x, noises, best.scales, begun=replace(best, settled=False))
    assert anew is not None
    assert max(abs(u - least) for u in asked) > 0.09
    assert again.x == pytest.approx(anew.x, abs=1e-3 * problem.unit[0])
    assert again.hessian == pytest.approx(anew.hessian, rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_a_search_in_parts_ends_where_one_does_though_steps_promise_too_much(
    draw: Callable[..., Landscape], seed: int
) -> None:
    """What an earlier step was not kept for says nothing of the next: here only the first are."""
    rng = np.random.default_rng(seed)
    bottom, width = rng.uniform(0.5, 1.0), rng.uniform(0.05, 0.2)

    def high(u: float) -> tuple[float, float]:
        return 5.0 * float(np.arctan((u - bottom) / width)), 0.0  # levels off: steps overshoot

    problem = draw(high)
    noises, none = [problem.noise], Scales((0.0, 0.0))
    first = descend(problem, problem.start(), noises, none, rounds=1)
    best = first
    for _ in range(20):
        assert best is not None
        best = descend(problem, best.x, noises, none, rounds=1, begun=best)
    whole = descend(problem, problem.start(), noises, none, rounds=20)
    assert first is not None
    assert best is not None
    assert whole is not None
    assert (first.settled, best.settled, whole.settled) == (False, True, True)
    # A step that gains less than 0.02 ends either; the sigma there is width / 5.
    at = [float((one.x[0] - problem.start()[0]) / problem.unit[0]) for one in (best, whole)]
    assert at == pytest.approx([bottom, bottom], abs=0.2 * width)


def test_a_fit_ends_only_where_the_model_answers_by_itself(
    draw: Callable[..., Landscape], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside a known answer more is found than from none, and a file of that would not run."""
    problem = draw(lambda u: ((u - 0.9) / 0.2, 0.0))
    first, unit = problem.start()[0], problem.unit[0]

    def ends(start: float) -> float | None:
        x = problem.start() + start * problem.unit
        best = descend(problem, x, [problem.noise], Scales((0.0, 0.0)))
        return None if best is None else float((best.x[0] - first) / unit)

    def answers(self: Landscape, x: _Floats) -> list[Trajectory | None] | None:
        return None if (x[0] - first) / unit > 0.5 else [None for _ in self.data]

    assert ends(0.0) == pytest.approx(0.9, abs=0.1)  # the prior, and what a last step may gain
    monkeypatch.setattr(Landscape, "answers", answers)
    end = ends(0.0)
    assert end is not None
    assert 0.0 < end <= 0.5
    assert ends(0.7) is None
