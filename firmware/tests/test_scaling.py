"""Converter codes to physical units, against exact fractions and the sensors' data sheets."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from firmware.tests.pure_c import load

ffi, lib = load("scaling")


def rounded(value: Fraction) -> int:
    """To nearest, halves away from zero."""
    sign = 1 if value >= 0 else -1
    return sign * int(abs(value) + Fraction(1, 2))


def scale(codes: list[int]) -> tuple[int, int, int, int]:
    """The same codes on all four inputs."""
    total = sum(codes)
    window = ffi.new("scaling_window_t *", [len(codes), total, total, total, total])
    result = ffi.new("scaling_result_t *")
    assert lib.scaling_window(window, result)
    return (
        result.motor_current_ua,
        result.load_cell_counts,
        result.bus_voltage_mv,
        result.conduit_temperature_mdegc,
    )


@given(st.lists(st.integers(0, 4095), min_size=1, max_size=16))
def test_means_are_exact_and_rounded_once(codes: list[int]) -> None:
    mean = Fraction(sum(codes), len(codes))
    temperature_mv = mean * 3300 / 4096
    assert scale(codes) == (
        rounded((mean - 2048) * 8000),
        rounded((mean - 2048) * 16),
        rounded(mean * 10),
        rounded(temperature_mv * 100) - 50_000,
    )


def test_landmarks() -> None:
    assert scale([2048] * 5)[:3] == (0, 0, 20_480)
    assert scale([4095] * 5)[0] == 16_376_000  # 16.4 A
    # 750 mV is 25 degC (TMP36 data sheet); the code nearest to it is 931, 0.8 mV of resolution
    assert abs(scale([931] * 5)[3] - 25_000) < 100


def test_an_empty_window_is_no_measurement() -> None:
    window, result = ffi.new("scaling_window_t *"), ffi.new("scaling_result_t *", [1, 2, 3, 4])
    assert not lib.scaling_window(window, result)
    assert result.bus_voltage_mv == 3
