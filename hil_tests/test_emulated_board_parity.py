"""ELF and native build are the same drive, bit for bit; `make bench` does this for 60 s each."""

from __future__ import annotations

import can
import pytest
from bowden_rig.rig.sensors import Sensors

from hil_tests.board_bench import NEEDS_ELF
from hil_tests.board_parity import EXPERIMENTS, Experiment, compare

pytestmark = NEEDS_ELF

DURATION_S = 3.0


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: f"experiment {e.name[0]}")
def test_every_tick_and_every_frame_are_the_same(experiment: Experiment) -> None:
    found = compare(experiment, DURATION_S)
    assert found.difference == ""
    assert found.ticks > 4000 * DURATION_S
    assert found.frames > 3 * 1000 * DURATION_S  # three TPDOs a millisecond
    assert found.largest_torque_nm > 0.1  # and the motor did work


def test_frames_keep_their_order_on_a_busy_bus() -> None:
    """Another node's frames, weaker than ours, fill every gap."""
    weak = can.Message(arbitration_id=0x7FF, is_extended_id=False, data=b"\0" * 8)
    found = compare(EXPERIMENTS[2], 0.3, babbler=weak)
    assert found.difference == ""
    assert found.frames > 900


def test_the_same_run_gives_the_same_bits() -> None:
    first, second = (compare(EXPERIMENTS[1], 0.3).digest for _ in range(2))
    assert first == second


@pytest.mark.parametrize(
    "field", ["time_us", "motor_encoder_counts", "load_encoder_counts", "load_cell_counts"]
)
def test_a_difference_of_one_count_is_found(field: str) -> None:
    """The comparison is a comparison: one sensor of the native drive is off by one."""

    def off_by_one(sensors: Sensors) -> Sensors:
        return sensors._replace(**{field: getattr(sensors, field) + 1})

    assert compare(EXPERIMENTS[1], 0.1, off_by_one).difference != ""
