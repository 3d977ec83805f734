"""How answers about hidden effects are scored: ties, rates, probabilities, phases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil_tests.benchmarks.diagnosis_score import Answer, Rate, Result, rates, reliability, times


def scored(kind: str, truth: tuple[str, ...], verdict: str, *named: str) -> Result:
    answer = Answer(verdict, named, named)
    return Result(1, "continuum", kind, {name: {} for name in truth}, 10.0, answer)


def test_a_tie_counts_only_if_the_truth_is_in_it_and_it_is_small() -> None:
    truth = ("load_cell_gain",)
    assert scored("single", truth, "ambiguous", "torque_constant_error", "load_cell_gain").first
    assert not scored("single", truth, "ambiguous", "wear", "cogging").first
    assert not scored("single", truth, "ambiguous", "a", "b", "c", "load_cell_gain").first
    assert not scored("single", truth, "named", "wear", "load_cell_gain").first
    assert scored("single", truth, "named", "wear", "load_cell_gain").second


def test_always_viscous_gets_what_it_deserves() -> None:
    results = [
        scored("single", ("viscous_friction",), "named", "viscous_friction"),
        scored("single", ("wear",), "named", "viscous_friction"),
        scored("complete", (), "named", "viscous_friction"),
        scored("unlisted", ("friction_flicker",), "named", "viscous_friction"),
        scored("pair", ("wear", "viscous_friction"), "named", "viscous_friction"),
    ]
    found = rates(results)
    assert found["single: named first"] == Rate(1, 2)
    assert found["complete: false alarm"] == Rate(1, 1)
    assert found["unlisted: recognised"] == Rate(0, 1)
    assert found["pair: both named"] == Rate(0, 1)
    assert found["pair: at least one"] == Rate(1, 1)


def test_a_stated_probability_is_held_against_how_often_it_is_right() -> None:
    def case(kind: str, truth: tuple[str, ...], **odds: float) -> Result:
        given = {name.replace("_and_", " + "): share for name, share in odds.items()}
        answer = Answer("named", truth, odds=given)
        return Result(1, "continuum", kind, {name: {} for name in truth}, 10.0, answer)

    found = reliability(
        [
            case("pair", ("cogging", "wear"), wear_and_cogging=0.97, wear=0.03),
            case("single", ("wear",), wear=0.7, unlisted=0.3),
            case("complete", (), nothing=0.9, wear=0.1),
            case("unlisted", ("wave",), wear=0.99, unlisted=0.01),
            case("several", ("wear", "cogging"), unlisted=1.0 + 1e-15),  # a sum of shares, rounded
        ]
    )
    assert [(round(mean, 3), rate.hits, rate.trials) for mean, rate in found] == [
        (0.065, 0, 2),
        (0.3, 0, 1),
        (0.7, 1, 1),
        (0.9, 1, 1),
        (0.987, 1, 3),
    ]


@pytest.mark.parametrize(
    ("explanation", "right"),
    [
        ({"frictional_lag", "wear"}, True),
        ({"frictional_lag", "wear", "presliding_compliance"}, True),
        ({"frictional_lag", "wear", "cogging"}, False),
        ({"wear", "presliding_compliance"}, False),
        ({"frictional_lag"}, False),
    ],
)
def test_what_the_rig_does_with_a_lag_is_right_beside_it(
    explanation: set[str], right: bool
) -> None:
    """Its friction unloads over 50 um of slip while it lags, which is a presliding compliance."""
    one = scored("pair", ("frictional_lag", "wear"), "named")
    assert one.is_right(frozenset(explanation)) is right
    other = scored("pair", ("cogging", "wear"), "named")
    assert not other.is_right(frozenset({"cogging", "wear", "presliding_compliance"}))


def test_wilson_interval_of_a_textbook_case() -> None:
    low, high = Rate(8, 10).interval
    assert (low, high) == pytest.approx((0.490, 0.943), abs=1e-3)  # Wilson 1927, z = 1.96


def test_a_phase_counts_modulo_a_turn() -> None:
    given = {"cogging": {"phase_rad": (0.1, -0.1, 0.3), "amplitude_nm": (1.0, 0.9, 1.1)}}
    truth = {"cogging": {"phase_rad": 2.0 * np.pi + 0.05, "amplitude_nm": 1.2}}
    answer = Answer("named", ("cogging",), parameters=given)
    assert Result(1, "continuum", "single", truth, 9.0, answer).covered == [True, False]


def test_times_are_told_by_kind() -> None:
    def took(kind: str, seconds: float, learning_s: float = math.nan) -> Result:
        answer = Answer("complete", (), seconds=seconds, learning_s=learning_s)
        return Result(1, "continuum", kind, {}, 0.0, answer)

    ours = [took("complete", 5.0), took("pair", 30.0), took("pair", 50.0, 20.0)]
    assert dict(times([ours])) == {
        "median time, complete, s": [5.0],
        "median time, pair, s": [40.0],
        "slowest, s": [50.0],
        "median time to learn a law, s": [20.0],
    }
