"""Fixed point against exact arithmetic: rationals for the bits, mpmath-free decimals for exp."""

from __future__ import annotations

import math
from decimal import Decimal, getcontext
from fractions import Fraction
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from firmware.tests.native import ffi, lib

INT32_MAX = 2**31 - 1
int32 = st.integers(-INT32_MAX, INT32_MAX)
uint64 = st.integers(0, 2**64 - 1)
Q24 = 2**24
Q31 = 2**31


def half_away(value: Fraction) -> int:
    """The one rounding rule."""
    magnitude = int(abs(value) + Fraction(1, 2))
    return magnitude if value >= 0 else -magnitude


def saturated(value: int) -> tuple[int, int]:
    """The one saturation rule: result and how often it counts."""
    if abs(value) <= INT32_MAX:
        return value, 0
    return (INT32_MAX if value > 0 else -INT32_MAX), 1


def value_of(ratio: Any) -> Fraction:
    return Fraction(ratio.mantissa) / Fraction(2) ** ratio.shift


def counted(function: Any, *arguments: Any) -> tuple[int, int]:
    counter = ffi.new("uint32_t *", 0)
    return function(*arguments, counter), counter[0]


@given(int32, int32)
def test_sum_and_difference_are_exact_or_saturated(a: int, b: int) -> None:
    assert counted(lib.fixed_add, a, b) == saturated(a + b)
    assert counted(lib.fixed_subtract, a, b) == saturated(a - b)


def test_the_counter_is_sticky_and_does_not_wrap() -> None:
    counter = ffi.new("uint32_t *", 2**32 - 2)
    for _ in range(3):
        lib.fixed_add(INT32_MAX, 1, counter)
    assert counter[0] == 2**32 - 1


@given(uint64, st.integers(1, 2**64 - 1))
@example(2**64 - 1, 1)
@example(1, 2**64 - 1)
@example(2**31 - 1, 2**31)
def test_a_quotient_keeps_31_significant_bits(numerator: int, denominator: int) -> None:
    ratio = lib.ratio_of(numerator, denominator)
    exact = Fraction(numerator, denominator)
    if numerator == 0:
        assert ratio.mantissa == 0
        return
    assert 2**30 <= ratio.mantissa < 2**31
    # Half a unit of the last bit, and what a denominator beyond 32 bits loses.
    assert abs(value_of(ratio) - exact) <= exact * Fraction(3, 2) / 2**31


@given(int32, uint64, st.integers(1, 2**64 - 1))
@example(INT32_MAX, 1, 2)
@example(-1, 1, 2)
@example(-INT32_MAX, 2**63, 1)
@example(1, 2**30, 1)
@example(2, 2**30 - 1, 1)
@example(-3, 2**30, 3)
def test_scaling_is_the_exact_product_rounded_once(
    quantity: int, numerator: int, denominator: int
) -> None:
    ratio = lib.ratio_of(numerator, denominator)
    exact = value_of(ratio) * quantity
    if value_of(ratio) >= 2**30:
        exact *= 2**32  # documented: saturates whatever is not 0
    assert counted(lib.fixed_scale, quantity, ratio) == saturated(half_away(exact))


@given(int32, uint64, st.integers(1, 2**64 - 1))
def test_scaling_is_odd(quantity: int, numerator: int, denominator: int) -> None:
    ratio = lib.ratio_of(numerator, denominator)
    there, back = (counted(lib.fixed_scale, sign * quantity, ratio)[0] for sign in (1, -1))
    assert there == -back


@given(
    *[st.integers(1, 2**64 - 1)] * 2,
    *[st.integers(1, 2**64 - 1)] * 2,
)
def test_ratio_arithmetic_is_good_to_30_bits(n1: int, d1: int, n2: int, d2: int) -> None:
    a, b = lib.ratio_of(n1, d1), lib.ratio_of(n2, d2)
    for found, exact in (
        (lib.ratio_add(a, b), value_of(a) + value_of(b)),
        (lib.ratio_multiply(a, b), value_of(a) * value_of(b)),
        (lib.ratio_reciprocal(a), 1 / value_of(a)),
    ):
        assert abs(value_of(found) - exact) <= exact / 2**30


def test_the_reciprocal_of_nothing_is_nothing() -> None:
    assert lib.ratio_reciprocal(lib.ratio_of(0, 1)).mantissa == 0


@pytest.fixture(scope="module", autouse=True)
def _decimals() -> None:
    getcontext().prec = 40


@given(st.integers(0, 255 * Q24))
@example(0)
@example(1)
@example(11629080)  # ln 2
@example(11629081)
def test_exp_is_right_to_two_units(x_q24: int) -> None:
    exact = (-Decimal(x_q24) / Q24).exp() * Q31
    assert abs(Decimal(lib.fixed_exp_minus(x_q24)) - exact) <= 2


@given(st.integers(0, 16 * Q24 - 1))
@example(0)
@example(Q24 // 2)  # where the series ends
@example(11629079)
def test_exp_and_its_mean_fall(x_q24: int) -> None:
    assert lib.fixed_exp_minus(x_q24 + 1) <= lib.fixed_exp_minus(x_q24)
    # The mean's slope is -1/2 .. 0 of a step of 128 units; its error is at most 4 either way.
    assert lib.fixed_exp_minus_mean(x_q24 + 16) <= lib.fixed_exp_minus_mean(x_q24) + 8


def test_exp_falls_across_every_whole_power_of_two() -> None:
    """The seams of the range reduction, 64 arguments around each multiple of ln 2."""
    for whole in range(1, 46):
        seam = int(Decimal(whole) * Decimal(2).ln() * Q24)
        values = [lib.fixed_exp_minus(x) for x in range(seam - 32, seam + 32)]
        assert all(later <= earlier for earlier, later in pairwise(values))


def test_no_exponential_exceeds_one() -> None:
    """A gain above one at zero would let a cable gain tension from rounding."""
    assert lib.fixed_exp_minus(0) == Q31
    assert lib.fixed_exp_minus_mean(0) == Q31
    for x_q24 in range(1, 4096):
        assert lib.fixed_exp_minus(x_q24) < Q31
        assert lib.fixed_exp_minus_mean(x_q24) < Q31


@given(st.integers(1, 255 * Q24))
@example(Q24 // 2)
@example(Q24 // 2 + 1)
def test_the_mean_of_exp_is_right_to_four_units(x_q24: int) -> None:
    x = Decimal(x_q24) / Q24
    exact = (1 - (-x).exp()) / x * Q31
    assert abs(Decimal(lib.fixed_exp_minus_mean(x_q24)) - exact) <= 4


@given(
    st.integers(-(2**31), INT32_MAX), st.integers(1_000_000, 500_000_000), st.integers(16, 2**20)
)
def test_an_encoder_is_exact_to_a_nanometre(counts: int, radius_nm: int, per_turn: int) -> None:
    """2 pi from Machin's formula would be overkill: 40 digits of it are enough."""
    two_pi = Fraction("6.283185307179586476925286766559005768394")
    exact = Fraction(counts) * two_pi * radius_nm / per_turn
    assume(abs(exact) < INT32_MAX)
    ratio = lib.encoder_arc_nm_per_count(radius_nm, per_turn)
    found, saturations = counted(lib.fixed_scale, counts, ratio)
    # half a nanometre of rounding, 1.5 * 2^-31 of 2.1 m of the factor, and what 2 pi lacks
    assert abs(found - exact) <= 2 + Fraction(1, 6)
    assert saturations == 0


@given(uint64, st.integers(1, 32))
@example(2**64 - 1, 32)
@example((2**32 - 1) ** 2, 32)
@example((2**32 - 1) ** 2 - 1, 32)
@example(0, 1)
def test_the_root_is_rounded_down_within_its_bits(square: int, bits: int) -> None:
    assert lib.fixed_root(square, bits) == min(math.isqrt(square), 2**bits - 1)
    small = square % 4**bits
    assert lib.fixed_root(small, bits) == math.isqrt(small)
