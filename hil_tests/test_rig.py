"""The rig around its mechanics: the operator at the handle, the sensors, changed parameters."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import packed
from bowden_rig.rig.operator import intended, reduced
from bowden_rig.rig.parameters import Operator, Rig, Sensing, changed
from bowden_rig.rig.rig import Actuators, SimulatedRig
from bowden_rig.rig.sensors import FAULT_LOAD_CELL, SensorBoard

ENABLED = Actuators(bridge_enabled=True)
QUIET = Sensing(load_cell_noise_nm=0.0, current_noise_a=0.0)


def test_operator_reaches_forty_degrees_against_the_friction() -> None:
    rig = SimulatedRig()
    counts = [rig.step(ENABLED).load_encoder_counts for _ in range(4 * 4000)]
    reached_deg = 360.0 / 10000 * np.array(counts[8000:])
    assert 40.0 <= reached_deg.max() < 41.6
    assert -41.6 < reached_deg.min() <= -40.0


def test_operator_waits_for_the_bridge_and_stops_with_it() -> None:
    rig = SimulatedRig()
    waiting = [rig.step(Actuators()).load_encoder_counts for _ in range(4000)]
    assert set(waiting) == {0}
    for _ in range(6000):
        rig.step(ENABLED)
    for _ in range(6000):
        rig.step(Actuators())
    at_rest = [rig.step(Actuators()).load_encoder_counts for _ in range(400)]
    assert np.ptp(at_rest) <= 1
    assert abs(rig.plant.scalars[at.LOAD_SPEED]) < 1e-3


@pytest.mark.parametrize("second_share", [0.0, 0.4])
def test_the_operator_moves_without_jumps(second_share: float) -> None:
    operator = Operator(second_share=second_share)
    motion, s, period = packed(reduced(operator)), np.zeros(at.SCALARS), 250e-6
    path = [intended(motion, s, k < 14000, period) for k in range(20000)]
    angle, speed = np.array(path).T
    largest_rad_per_s = 1.2 * math.radians(41.6) * math.pi + 1.5 * math.radians(41.6)
    assert np.max(np.abs(np.diff(angle))) < largest_rad_per_s * period
    # speed is the derivative of the angle: second-order agreement with a central difference
    central = (angle[2:] - angle[:-2]) / (2.0 * period)
    assert np.max(np.abs(central - speed[1:-1])) < 2e-3
    assert path[-1] == (0.0, 0.0)


def test_strokes_with_a_second_sine_are_not_alike() -> None:
    motion, s = packed(reduced(Operator(second_share=0.4))), np.zeros(at.SCALARS)
    angle = np.array([intended(motion, s, True, 1e-3)[0] for _ in range(20000)])
    ends = angle[1:-1][np.diff(np.sign(np.diff(angle))) != 0]
    assert np.ptp(np.abs(ends)) > 0.3 * np.abs(angle).max()


@pytest.mark.parametrize("motion", ["still", "locked"])
def test_held_handle_stays_where_it_is(motion: str) -> None:
    rig = SimulatedRig(Rig(operator=Operator(motion=motion)))  # type: ignore[arg-type]
    counts = [
        rig.step(Actuators(motor_current_ua=4_000_000, bridge_enabled=True)).load_encoder_counts
        for _ in range(2000)
    ]
    assert max(map(abs, counts)) <= 1


def test_open_bridge_carries_no_current() -> None:
    rig = SimulatedRig(Rig(sensing=QUIET))
    for _ in range(8):
        running = rig.step(Actuators(motor_current_ua=2_000_000, bridge_enabled=True))
    assert running.motor_current_ua == pytest.approx(2_000_000, rel=1e-2)
    opened = rig.step(Actuators(motor_current_ua=2_000_000, bridge_enabled=False))
    assert opened.motor_current_ua == 0


def test_amplifier_lags_by_its_bandwidth() -> None:
    rig = SimulatedRig(Rig(sensing=QUIET))
    first = rig.step(Actuators(motor_current_ua=1_000_000, bridge_enabled=True))
    # mean over one period of 1 - exp(-t / tau), tau = 1 / (2 pi 1000): 0.496; the substeps that
    # are averaged are their ends, which reads half a substep (1/24 of the period) more
    tau, period = 1.0 / (2.0 * math.pi * 1000.0), 250e-6
    mean = 1.0 - tau / period * (1.0 - math.exp(-period / tau))
    assert first.motor_current_ua == pytest.approx(1e6 * mean, abs=0.05e6)


def scalars(motor_angle: float = 0.0, load_angle: float = 0.0, torque: float = 0.0) -> np.ndarray:
    s = np.zeros(at.SCALARS)
    s[at.MOTOR_ANGLE], s[at.LOAD_ANGLE], s[at.CELL_TORQUE_MEAN] = motor_angle, load_angle, torque
    return s


def test_encoders_count_their_turns() -> None:
    board = SensorBoard(QUIET, 0, 0)
    read = board.read(scalars(2.0 * math.pi * 3.25, -2.0 * math.pi * 0.5), 0)
    assert (read.motor_encoder_counts, read.load_encoder_counts) == (6500, -5000)
    # a count is the middle of its step
    assert board.read(scalars(0.49 * math.pi / 1000), 0).motor_encoder_counts == 0
    assert board.read(scalars(0.51 * math.pi / 500), 0).motor_encoder_counts == 1


def test_load_cell_noise_has_the_stated_spread_and_the_seed_repeats_it() -> None:
    def readings(seed: int) -> list[int]:
        board = SensorBoard(Sensing(load_cell_noise_nm=2e-3), seed, 0)
        return [board.read(scalars(torque=1.0), 0).load_cell_counts for _ in range(4000)]

    first = readings(1)
    assert first == readings(1)
    assert first != readings(2)
    assert np.mean(first) == pytest.approx(5000.0, abs=4 * 10.0 / math.sqrt(4000))  # 4 sigma
    assert np.std(first) == pytest.approx(10.0, rel=4 / math.sqrt(2 * 4000))


def test_railed_load_cell_raises_the_board_fault() -> None:
    board = SensorBoard(QUIET, 0, 0)
    assert board.read(scalars(torque=24.9), 0).faults == 0
    railed = board.read(scalars(torque=-30.0), 0)
    assert (railed.faults, railed.load_cell_counts) == (FAULT_LOAD_CELL, -125000)


def test_hidden_load_cell_errors_and_delay_show_in_the_reading() -> None:
    sensing = replace(
        QUIET,
        load_cell_gain_error=0.02,
        load_cell_offset_nm=0.1,
        load_cell_drift_nm_per_s=0.01,
        load_cell_delay_ticks=2,
    )
    board = SensorBoard(sensing, 0, 1_000_000)
    seen = [
        board.read(scalars(torque=1.0), 1_000_000 + 10_000_000 * k).load_cell_counts
        for k in range(4)
    ]
    assert seen == [0, 0, round(1.12 / 200e-6), round(1.22 / 200e-6)]


def test_board_clock_wraps_at_32_bits() -> None:
    rig = SimulatedRig(start_time_us=(1 << 32) - 250)
    assert rig.sensors.time_us == (1 << 32) - 250
    assert rig.step(Actuators()).time_us == 0


def test_changed_sets_one_number_and_keeps_the_rest() -> None:
    rig = changed(Rig(), "cable.viscous_s_per_m=0.3")
    assert rig.cable.viscous_s_per_m == 0.3
    assert rig == replace(Rig(), cable=replace(Rig().cable, viscous_s_per_m=0.3))


@pytest.mark.parametrize(
    "assignment",
    [
        "cable.friction",
        "cable.friction=much",
        "cable.friction=nan",
        "cable.friction=-0.1",
        "cable.axial_stiffness_n=0",
        "cable.path=3",
        "conduit.friction=0.1",
        "friction=0.1",
        "sensing.load_cell_delay_ticks=1.5",
        "sensing.load_cell_delay_ticks=-1",
        "motor.inertia_kg_m2=inf",
    ],
)
def test_changed_refuses_what_is_no_rig(assignment: str) -> None:
    with pytest.raises(ValueError, match=r"found .*; accepted: "):
        changed(Rig(), assignment)
