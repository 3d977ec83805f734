"""The error-reduction tunnel, eq. (7), against the equation."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from firmware.tests.native import ffi, lib

angles = st.integers(-(2**31 - 1), 2**31 - 1)
tunnels = st.tuples(
    st.integers(0, 10_000_000), st.integers(0, 100_000_000), st.integers(0, 8_000_000)
)


def torque(parameters: tuple[int, int, int], angle_urad: int) -> int:
    tunnel = ffi.new("tunnel_t *", lib.tunnel_of(*parameters))
    return int(lib.tunnel_torque_unm(tunnel, angle_urad))


def test_the_tunnel_of_the_paper() -> None:
    table = {0: 0, 50_000: 0, 50_002: -1, 150_000: -50_000, 450_000: -200_000, 700_000: -200_000}
    for angle_urad, expected in table.items():
        assert torque((50_000, 500_000, 200_000), angle_urad) == expected


@given(tunnels, angles)
def test_it_is_the_equation_rounded_once(parameters: tuple[int, int, int], angle: int) -> None:
    half_width, stiffness, limit = parameters
    outside = max(0, abs(angle) - half_width)
    exact = min(Fraction(limit), Fraction(outside) * stiffness / 1_000_000)
    # half a unit of rounding, and the ratio's 2^-31 of at most 8 N m
    assert abs(abs(torque(parameters, angle)) - exact) <= Fraction(1, 2) + Fraction(1, 100)


@given(tunnels, angles)
def test_it_is_exactly_odd_and_restoring(parameters: tuple[int, int, int], angle: int) -> None:
    found = torque(parameters, angle)
    assert torque(parameters, -angle) == -found
    assert found * angle <= 0
    assert abs(found) <= parameters[2]
