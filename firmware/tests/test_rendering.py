"""Whatever a lab configures and whatever the sensors say: the compensation keeps the limits of the
motor, is mirror-symmetric, and what it tells of itself is what runs.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from firmware.tests.native import Drive, lib

LAWS = range(lib.COMPENSATION_LAW_COUNT)
TICKS_PER_S = 4000

configurations = st.fixed_dictionaries(
    {
        "compensation_law": st.sampled_from(list(LAWS)),
        "compensation_use_load_cell": st.integers(0, 1),
        "compensation_fallback_step_unm": st.integers(1, 1_000_000),
        "compensation_clean_time_ms": st.integers(10, 60_000),
        "compensation_friction_share_ppm": st.integers(0, 1_000_000),
        "compensation_standstill_band_unm": st.integers(0, 8_000_000),
        "compensation_integral_gain_mhz": st.integers(0, 1_000_000),
        "compensation_slack_floor_un": st.integers(0, 100_000_000),
        "motor_inertia_gmm2": st.integers(0, 10_000_000),
        "adaptation_enabled": st.integers(0, 1),
        "adapted_friction_factor_ppm": st.integers(500_000, 1_500_000),
        "adapted_pretension_factor_ppm": st.integers(500_000, 1_500_000),
        # A few micronewton stretch no cable by a nanometre: the pair is slack from the start.
        "cable_pretension_un": st.integers(0, 10) | st.integers(0, 40_000_000),
        "friction_dynamic_ppm": st.integers(0, 600_000),
        "motor_torque_limit_unm": st.integers(0, 8_000_000),
        "motor_torque_slew_unm_per_s": st.integers(1000, 1_000_000_000),
        "tunnel_torque_limit_unm": st.integers(0, 8_000_000),
        "tunnel_stiffness_unm_per_rad": st.integers(0, 100_000_000),
    }
)
readings = st.lists(
    st.tuples(
        st.integers(-20_000, 20_000),  # motor encoder
        st.integers(-10_000, 10_000),  # load encoder
        st.integers(-60_000_000, 60_000_000),  # motor current
        st.integers(-60_000, 60_000),  # load cell
        st.sampled_from([0, 0, 0, 1 << 2]),  # load cell broken
    ),
    min_size=5,
    max_size=40,
)


def configured(configuration: dict[str, int]) -> Drive:
    drive = Drive()
    for name, value in configuration.items():
        setattr(drive.values, name, value)
    drive.values.friction_static_ppm = drive.values.friction_dynamic_ppm
    return drive


def feed(drive: Drive, reading: tuple[int, int, int, int, int], sign: int = 1) -> None:
    sensors: Any = drive.sensors
    sensors.motor_encoder_counts = sign * reading[0]
    sensors.load_encoder_counts = sign * reading[1]
    sensors.motor_current_ua = sign * reading[2]
    sensors.load_cell_counts = sign * reading[3]
    sensors.faults = reading[4] if drive.values.compensation_law else 0


@given(configuration=configurations, series=readings)
@settings(max_examples=150, deadline=None)
def test_limit_and_slew_hold_whatever_is_configured_and_read(
    configuration: dict[str, int], series: list[tuple[int, int, int, int, int]]
) -> None:
    drive = configured(configuration)
    assert drive.enable().bridge_enabled
    values = drive.values
    step = values.motor_torque_slew_unm_per_s // TICKS_PER_S + 1
    last = values.motor_torque_command_unm
    for reading in series:
        feed(drive, reading)
        for _ in range(5):
            assert drive.tick().bridge_enabled
            command = values.motor_torque_command_unm
            assert abs(command) <= values.motor_torque_limit_unm
            assert abs(command - last) <= step
            last = command
        assert values.compensation_active_law in (0, 1, values.compensation_law)


# The pair is slack at the start: both cables become taut at the very same place.
SLACK_PAIR = {
    "compensation_law": 0,
    "cable_pretension_un": 4,
    "friction_dynamic_ppm": 0,
    "adapted_friction_factor_ppm": 500_000,
    "adapted_pretension_factor_ppm": 500_000,
}
NUDGE_THEN_MOVE = [*[(0, 0, 0, 0, 0)] * 14, (0, 0, 9, 0, 0), (0, 1, 0, 0, 0)]


@given(configuration=configurations, series=readings)
@example(configuration=SLACK_PAIR, series=NUDGE_THEN_MOVE)
@settings(max_examples=60, deadline=None)
def test_a_mirrored_motion_gives_the_mirrored_torque_to_the_last_bit(
    configuration: dict[str, int], series: list[tuple[int, int, int, int, int]]
) -> None:
    drives = configured(configuration), configured(configuration)
    for drive in drives:
        drive.enable()
    for reading in series:
        for drive, sign in zip(drives, (1, -1), strict=True):
            feed(drive, reading, sign)
            drive.tick(3)
        one, other = (drive.values for drive in drives)
        assert one.motor_torque_command_unm == -other.motor_torque_command_unm
        assert one.estimated_load_torque_unm == -other.estimated_load_torque_unm
        assert one.compensation_level == other.compensation_level


@pytest.mark.parametrize("law", LAWS)
def test_at_rest_without_a_wish_every_law_asks_for_nothing(law: int) -> None:
    drive = configured({"compensation_law": law})
    drive.enable()
    for _ in range(400):
        assert drive.tick().motor_current_ua == 0
    assert drive.values.compensation_active_law == law


@pytest.mark.parametrize("law", LAWS)
def test_switching_the_bridge_off_and_on_starts_from_no_torque(law: int) -> None:
    """The torque of the last run must not come back as a jump."""
    drive = configured({"compensation_law": law, "mode_of_operation": -2})
    drive.values.target_torque_unm = 150_000
    drive.enable()
    drive.tick(2000)
    drive.control(0x00, 5)
    assert drive.values.motor_torque_command_unm == 0
    slew = math.ceil(20e6 / TICKS_PER_S)
    last = 0
    for controlword in (0x06, 0x07, *[0x0F] * 200):
        drive.control(controlword)
        assert abs(drive.values.motor_torque_command_unm - last) <= slew
        last = drive.values.motor_torque_command_unm
