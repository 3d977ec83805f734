"""The friction observer on samples of its own equation (O2), whose x, e, d and o are known.

How well it does on cables that are unlike that equation is measured by hil_tests/render and
hil_tests/test_estimator.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware.tests.native import ffi, lib

ONE = 65536
TICKS_PER_S = 4000
STRETCH_NM = 1_500_000  # B
COUNT_NM = 65_345
CONFIGURED = 0.15 * (2 / 3) ** 0.5  # two factors, each even within 15 %: sqrt(2) 0.15/sqrt(3)
CHANGES = 0.15 / 3**0.5  # in use, by as much as one of them
PRIOR = (CONFIGURED**2 + CHANGES**2) ** 0.5


def observer(stretch_nm: int = STRETCH_NM, deviation: float = CONFIGURED) -> Any:
    return ffi.new(
        "friction_observer_t *",
        lib.friction_observer_of(stretch_nm, COUNT_NM, TICKS_PER_S, round(1e6 * deviation)),
    )


def step(  # noqa: PLR0917
    one: Any, side: int, arc_nm: int, gap_nm: int, innovation_nm: int, slack: bool = False
) -> None:
    seen = {
        "side": side,
        "slack": slack,
        "load_arc_nm": arc_nm,
        "gap_nm": gap_nm,
        "innovation_nm": innovation_nm,
    }
    lib.friction_observer_step(one, ffi.new("friction_observed_t *", seen))


def mean(one: Any) -> float:
    return float(lib.friction_observer_mean_q16(one)) / ONE


def sure(one: Any) -> float:
    return float(lib.friction_observer_sure_q16(one)) / ONE


def strokes(
    seconds: float, wall: float, slow: bool = False
) -> Iterator[tuple[int, int, float, float]]:
    """Side, load arc (nm), gap over B, speed in B a second: strokes of +-50 mm through a wall."""
    frequency = 0.25 if slow else 0.6
    for k in range(round(seconds * TICKS_PER_S)):
        phase = 2.0 * np.pi * frequency * k / TICKS_PER_S
        arc_nm, speed = 50e6 * np.sin(phase), 50e6 * 2.0 * np.pi * frequency * np.cos(phase)
        side = 1 if speed > 0 else -1
        # (O1) with f = F: the gap of the compensated pair, and what the wall's torque stretches
        yield side, round(arc_nm), side - wall * np.sin(phase), speed / STRETCH_NM


def teach(
    one: Any,
    x: float,
    e: float,
    d_s: float,
    *,
    seconds: float = 6.0,
    wall: float = 2.0,
    sign: int = 1,
    offset: float = 0.0,
) -> None:
    for side, arc_nm, gap, speed in strokes(seconds, wall):
        innovation = -side * x + e * gap + d_s * speed + offset
        step(
            one,
            sign * side,
            sign * arc_nm,
            sign * round(gap * STRETCH_NM),
            sign * round(innovation * STRETCH_NM),
        )


@pytest.mark.parametrize("x", [-0.2, 0.0, 0.2])
@pytest.mark.parametrize("e", [-0.1, 0.1])
@pytest.mark.parametrize("d_s", [0.0, 2e-3])
def test_friction_is_told_from_compliance_and_lateness(x: float, e: float, d_s: float) -> None:
    one = observer()
    teach(one, x, e, d_s)
    # the priors pull the three towards zero by less than the deviation that is left
    assert mean(one) == pytest.approx(1.0 + x, abs=0.06)
    # the half of more friction, all of less
    believed = 1.0 + (mean(one) - 1.0) / (2.0 if mean(one) > 1.0 else 1.0)
    assert believed - 0.2 < sure(one) < believed - 0.04


def test_what_is_sure_pushes_on_no_rig() -> None:
    """mu, pretension and EA each wrong by up to 15 %, in free strokes, which leave the most open.
    One deviation would push on 14 of 150 such rigs, two push on none."""
    random = np.random.default_rng(3)
    for mu, pretension, stiffness in random.uniform(0.85, 1.15, (40, 3)):
        x, e = 1.0 / (mu * pretension) - 1.0, stiffness - 1.0  # the model is wrong, not the pair
        one = observer()
        teach(one, x, e, 0.0, seconds=2.0, wall=0.0)
        assert sure(one) < 1.0 + x


@pytest.mark.parametrize("offset", [-1.0, -0.5, 0.5, 1.0])
@pytest.mark.parametrize("x", [-0.2, 0.0, 0.2])
def test_what_stays_the_same_both_ways_is_no_friction(x: float, offset: float) -> None:
    """Torque that the cables held when the model started, or a motor torque that is off: up to a
    whole B, for which the friction must not be taken at any time."""
    one = observer()
    teach(one, x, 0.0, 0.0, offset=offset)
    assert mean(one) == pytest.approx(1.0 + x, abs=0.02)


def test_until_the_first_reversal_an_offset_may_be_anything() -> None:
    one = observer()
    teach(one, 0.0, 0.0, 0.0, seconds=0.4)  # less than a quarter of the first stroke's period
    assert sure(one) < 0.9


def test_what_was_not_excited_stays_uncertain() -> None:
    one = observer()
    assert (mean(one), sure(one)) == pytest.approx((1.0, 1.0 - 2.0 * PRIOR), abs=1e-3)
    for tick in range(4 * TICKS_PER_S):  # moves, but the pair does not slide; slides, but rests
        step(one, 0, 10_000 * tick, 0, 1_000_000)
    for _ in range(4 * TICKS_PER_S):
        step(one, 1, 160_000_000, 0, 1_000_000)
    assert (mean(one), sure(one)) == pytest.approx((1.0, 1.0 - 2.0 * PRIOR), abs=1e-3)
    for tick in range(30 * TICKS_PER_S):  # slides, but a cable is slack: friction may change unseen
        step(one, 1, 160_000_000 + 10_000 * tick, 0, 1_000_000, slack=True)
    assert (mean(one), sure(one)) == pytest.approx((1.0, 1.0 - 2.0 * PRIOR), abs=2e-3)
    without_wall, with_wall = observer(), observer()
    teach(without_wall, 0.0, 0.0, 0.0, wall=0.0)
    teach(with_wall, 0.0, 0.0, 0.0)
    # with nothing but friction in the cables, friction and compliance look alike
    assert 1.0 - 2.0 * PRIOR < sure(without_wall) < sure(with_wall) - 0.04


@pytest.mark.parametrize("at_s", [1.9, 2.7, 3.6])
def test_a_friction_that_drops_is_followed_before_it_is_pushed(at_s: float) -> None:
    """A clamp slips in mid stroke and takes 30 % of the pretension. What is surely friction has
    to be less than it is again within 1/4 s of sliding: four windows to see it, and what of these
    are the filter's own time."""
    one = observer()
    pushed_s = 0.0
    for tick, (side, arc_nm, gap, speed) in enumerate(strokes(4.5, 0.0)):
        x = 0.0 if tick < at_s * TICKS_PER_S else -0.3
        innovation = -side * x + 5e-4 * speed
        step(one, side, arc_nm, round(gap * STRETCH_NM), round(innovation * STRETCH_NM))
        pushed_s += (sure(one) > 1.0 + x) / TICKS_PER_S if tick % 8 == 0 else 0.0
    assert 8 * pushed_s < 0.25
    assert 1.0 - 0.3 - 0.2 < sure(one) < 0.7


def test_a_friction_that_is_known_better_is_compensated_further() -> None:
    """In free strokes only x - e is seen: what is sure rests on the prior."""
    usual, calibrated = observer(), observer(deviation=0.03)
    assert sure(calibrated) == pytest.approx(1.0 - 2.0 * (0.03**2 + CHANGES**2) ** 0.5, abs=1e-3)
    for one in (usual, calibrated):
        teach(one, 0.0, 0.0, 0.0, seconds=4.0, wall=0.0)
    assert sure(usual) + 0.02 < sure(calibrated) < 1.0


def test_what_the_samples_differ_by_widens_the_deviation() -> None:
    """The same strokes with a residual that no number of (O2) explains: play at the handle."""
    calm, disturbed = observer(), observer()
    for tick, (side, arc_nm, gap, _) in enumerate(strokes(4.0, 2.0)):
        gap_nm = round(gap * STRETCH_NM)
        play_nm = round(0.3 * STRETCH_NM * np.sign(np.sin(40.0 * tick / TICKS_PER_S)))
        step(calm, side, arc_nm, gap_nm, 0)
        step(disturbed, side, arc_nm, gap_nm, play_nm)
    assert mean(calm) - sure(calm) < 0.12
    assert mean(disturbed) - sure(disturbed) > 1.3 * (mean(calm) - sure(calm))


def test_a_stiff_pair_says_little_in_counts_of_an_encoder() -> None:
    one = observer(COUNT_NM // 2)
    rng = np.random.default_rng(1)
    for tick in range(4 * TICKS_PER_S):
        noise = round(float(rng.uniform(-COUNT_NM, COUNT_NM)))
        step(one, 1, 20_000 * tick, COUNT_NM // 2, noise)
    assert mean(one) == pytest.approx(1.0, abs=0.1)
    assert sure(one) < mean(one) - 0.1


def test_it_goes_on_from_a_friction_that_was_learned() -> None:
    one = observer()
    lib.friction_observer_expect(one, round(0.8 * ONE))
    assert mean(one) == pytest.approx(0.8, abs=1e-4)


@given(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.floats(0.0, 3e-3))
@settings(max_examples=20, deadline=None)
def test_a_mirrored_motion_teaches_the_same_to_the_bit(x: float, e: float, d_s: float) -> None:
    there, back = observer(), observer()
    teach(there, x, e, d_s, seconds=1.0, offset=0.4)
    teach(back, x, e, d_s, seconds=1.0, offset=0.4, sign=-1)
    # of the four numbers the offset alone is mirrored, and with it what it shares with the others
    mirror = [1, 1, 1, -1]
    pairs = [(i, j) for i in range(4) for j in range(i, 4)]
    assert list(there.mean_q24) == [m * x for m, x in zip(mirror, back.mean_q24, strict=True)]
    assert list(there.covariance_q30) == [
        mirror[i] * mirror[j] * x for (i, j), x in zip(pairs, back.covariance_q30, strict=True)
    ]


@given(
    st.integers(0, 2**31 - 1),
    st.lists(
        st.tuples(
            st.sampled_from([-1, 0, 1]),
            *(st.integers(-(2**31) + 1, 2**31 - 1) for _ in range(3)),
        ),
        max_size=30,
    ),
)
@settings(max_examples=60, deadline=None)
def test_whatever_is_measured_the_friction_stays_in_its_bounds(
    stretch_nm: int, series: list[tuple[int, int, int, int]]
) -> None:
    one = observer(stretch_nm)
    for side, arc_nm, gap_nm, innovation_nm in series:
        for _ in range(70):
            step(one, side, arc_nm, gap_nm, innovation_nm)
        assert 0.25 <= sure(one) <= mean(one) <= 1.25
        assert all(one.covariance_q30[i] > 0 for i in (0, 4, 7, 9))
