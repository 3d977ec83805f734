"""The flashed ELF measures and drives: encoders, converter, bridge and the current in the motor."""

from __future__ import annotations

import math

import can
import numpy as np
import pytest
from bowden_rig.rig.parameters import Operator

from hil_tests.board_bench import ENABLED, NEEDS_ELF, Board, running, start_node
from hil_tests.lockstep_host import CONTROLWORD
from hil_tests.targets import board_map
from hil_tests.targets.emulated import temperature_code

pytestmark = NEEDS_ELF

MOTOR_ENCODER, LOAD_ENCODER = 0x2020, 0x2021
LOAD_TORQUE, MOTOR_CURRENT, BUS_VOLTAGE, TEMPERATURE = 0x2025, 0x2026, 0x2027, 0x2028
TIM1_CR1, TIM1_CNT, TIM1_BDTR = 0x40010000, 0x40010024, 0x40010044
COUNTS_DOWN = 1 << 4
ADC_EXCEPTION = 16 + 18
TORQUE_CONSTANT_NM_PER_A = 0.060
CODE_A = board_map.CURRENT_UA_PER_CODE * 1e-6
SENSORS = (
    *("time_us", "motor_encoder_counts", "load_encoder_counts", "motor_current_ua"),
    *("load_cell_counts", "bus_voltage_mv", "conduit_temperature_mdegc", "faults"),
)


@pytest.mark.parametrize("direction", [1, -1])
def test_encoders_count_on_past_sixteen_bits(direction: int) -> None:
    board = Board()
    board.run(0.02)
    chip, ends = board.chip, (direction * 150_000, direction * 90_000)
    steps = 400
    start_us = chip.time_us
    for i in range(1, steps + 1):
        chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, ends[0] * i // steps)
        chip.set_encoder(board_map.LOAD_ENCODER_TIMER, ends[1] * i // steps)
        chip.run_until(start_us + 250.0 * i)
    board.chip.run_until(chip.time_us + 500)
    assert latched(board, "motor_encoder_counts") == ends[0]
    assert latched(board, "load_encoder_counts") == ends[1]


def latched(board: Board, field: str) -> int:
    """Field of the firmware's board_sensors_t (board.h), from its memory."""
    value = board.chip.word("sensors", SENSORS.index(field))
    return value - (1 << 32) if value >> 31 else value


def test_analogue_inputs_reach_the_dictionary() -> None:
    board = Board()
    board.run(0.02)
    rig = board.bench.rig.sensors
    assert board.signed(BUS_VOLTAGE) == pytest.approx(rig.bus_voltage_mv, abs=10)  # one code
    # one code of 3300 mV / 4096 is 81 mdegC
    assert board.signed(TEMPERATURE) == pytest.approx(rig.conduit_temperature_mdegc, abs=81)
    # one code is 3.2 mN m; the rig's sensor noise of 0.5 mN m three times
    true_unm = rig.load_cell_counts * 200
    assert board.signed(LOAD_TORQUE) == pytest.approx(true_unm, abs=3200 + 1500)
    assert board.signed(MOTOR_CURRENT) == pytest.approx(0, abs=board_map.CURRENT_UA_PER_CODE)


def test_the_mean_of_five_samples_resolves_less_than_a_code() -> None:
    """A load cell between two codes: the noise dithers, the mean of many ticks tells."""
    board = Board()
    board.run(0.1)
    chip = board.chip
    means = []
    for code in (2048.0, 2048.25, 2048.5):
        chip.set_adc(board_map.ADC_LOAD_CELL, code, board_map.LOAD_CELL_NOISE_CODES)
        counts = []
        for _ in range(400):
            chip.run_until(chip.time_us + 250.0)
            counts.append(latched(board, "load_cell_counts"))
        means.append(np.mean(counts) / board_map.LOAD_CELL_COUNTS_PER_CODE)
    # 2000 samples of half a code of noise: 0.011 codes, three times
    assert means == pytest.approx([0.0, 0.25, 0.5], abs=0.035)


def test_temperature_below_zero() -> None:
    board = Board()
    board.run(0.02)
    board.chip.set_adc(board_map.ADC_TEMPERATURE, temperature_code(-20_000), 0.5)
    board.chip.run_until(board.chip.time_us + 600)
    assert latched(board, "conduit_temperature_mdegc") == pytest.approx(-20_000, abs=81)


def test_the_bridge_is_on_in_operation_enabled_only() -> None:
    board = Board()
    board.run(0.02)
    assert not board.chip.bridge().enabled
    start_node(board)
    for controlword in (6, 7):
        board.host.write(CONTROLWORD, 0, controlword, 2)
        board.run(0.01)
        assert not board.chip.bridge().enabled
    board.enable()
    assert board.state() == ENABLED
    bridge = board.chip.bridge()
    assert bridge.enabled
    assert bridge.frequency_hz == pytest.approx(20_000)
    assert bridge.dead_time_s == pytest.approx(0.5e-6)
    assert board.chip.peripheral(TIM1_BDTR) & 0x300 == 0x100  # a stray write cannot change it
    for leave in (0x06, 0x00):
        board.enable()
        board.host.write(CONTROLWORD, 0, leave, 2)
        board.run(0.001)
        assert not board.chip.bridge().enabled


@pytest.mark.parametrize("torque_nm", [0.3, -0.3])
def test_the_motor_gets_the_current_that_the_torque_needs(torque_nm: float) -> None:
    board = Board(operator=Operator(motion="locked"))
    board.run(0.02)
    board.enable(torque_nm)
    board.run(0.3)
    board.chip.bridge()
    board.run(0.1)
    current = board.chip.bridge()
    # what flows through the motor, not what the firmware assumes; half a code is what it can see
    assert current.mean_current_a == pytest.approx(torque_nm / TORQUE_CONSTANT_NM_PER_A, abs=CODE_A)
    # at standstill the winding's resistance alone takes the voltage, dead time besides
    assert math.copysign(1, current.duty_a - current.duty_b) == math.copysign(1, torque_nm)
    assert board.emergencies() == []


def test_quick_stop_takes_the_current_down_before_the_bridge() -> None:
    board = Board(operator=Operator(motion="locked"))
    board.run(0.02)
    board.enable(0.3)
    board.run(0.1)
    board.host.write(CONTROLWORD, 0, 0x02, 2)
    # quick_stop_time is 50 ms, during which the bridge works
    board.run(0.045)
    assert board.chip.bridge().enabled
    board.run(0.01)
    bridge = board.chip.bridge()
    assert not bridge.enabled
    assert abs(bridge.current_a) < CODE_A


def test_an_rpdo_that_was_moved_to_another_identifier_is_received() -> None:
    """The hardware filters follow the configuration."""
    board = Board()
    board.run(0.02)
    moved = 0x333
    board.host.write(0x1400, 1, 0x80000210, 4)
    board.host.write(0x1400, 1, 0x80000000 | moved, 4)
    board.host.write(0x1400, 1, moved, 4)
    start_node(board)
    board.host.bus.send(
        can.Message(arbitration_id=moved, is_extended_id=False, data=b"\x06\x00\xfe\x00\x00\x00")
    )
    board.run(0.01)
    assert board.host.statusword() & 0x6F == 0x21


def test_the_filters_keep_foreign_frames_out() -> None:
    """Another node's SDO and PDOs, extended and remote frames cost no interrupt."""
    board = Board()
    board.run(0.02)
    handled = board.chip.account(16 + 20).activations
    foreign = [can.Message(arbitration_id=i, is_extended_id=False) for i in (0x611, 0x181, 0x211)]
    foreign.append(can.Message(arbitration_id=0x610, is_extended_id=True))
    foreign.append(can.Message(arbitration_id=0x610, is_extended_id=False, is_remote_frame=True))
    for message in foreign:
        board.host.bus.send(message)
    board.run(0.02)
    assert board.chip.account(16 + 20).activations == handled
    board.host.statusword()
    assert board.chip.account(16 + 20).activations == handled + 1


def test_samples_are_taken_in_the_middle_of_the_high_sides_conduction() -> None:
    """Once a period, where the ripple of the current crosses its mean: TIM1 at 0, counting up."""
    board = running()
    chip, seen, phases = board.chip, board.chip.account(ADC_EXCEPTION).activations, []
    start_us = chip.time_us
    while chip.time_us < start_us + 1000.0:
        chip.run_until(chip.time_us + 0.1)
        if chip.account(ADC_EXCEPTION).activations > seen:
            seen = chip.account(ADC_EXCEPTION).activations
            phases.append((chip.peripheral(TIM1_CR1) & COUNTS_DOWN, chip.peripheral(TIM1_CNT)))
    assert len(phases) in {19, 20, 21}  # 20 kHz
    # four conversions of 28 + 12 cycles at 21 MHz after the trigger: 7.62 us of 168 MHz; then the
    # interrupt, up to a tick's latch at a higher priority, and the step of 0.1 us
    assert {down for down, _ in phases} == {0}
    assert all(1280 <= count < 1280 + 500 for _, count in phases)
