"""The compiled loop of rig and drive does what the bench does, bit for bit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.rig import state as at
from bowden_rig.rig.parameters import Cable, Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

from hil_tests import native_loop
from hil_tests.lockstep_host import LockstepHost

TUNNEL = -1
TORQUE = -2
SHARPER = Rig(cable=Cable(static_ratio=1.5, stribeck_speed_m_per_s=0.01, dwell_gain=0.3))


def enabled(rig: Rig, mode: int) -> LockstepHost[VirtualBus]:
    host = LockstepHost(VirtualBus(Bench(SimulatedRig(rig, seed=3), make_target("native"), True)))
    host.await_boot()
    host.enable(mode)
    return host


@pytest.mark.parametrize("rig", [Rig(), SHARPER])
def test_loop_repeats_the_bench_bit_for_bit(rig: Rig) -> None:
    slow, fast = enabled(rig, TUNNEL), enabled(rig, TUNNEL)
    bench, start = slow.bus.bench, slow.bus.bench.ticks
    slow.listen(2.0)  # longer than a block of noise
    record = native_loop.run(
        fast.bus.bench, 2 * TICKS_PER_S, watch=("load_torque_unm", "statusword")
    )
    truth = bench.truth()
    assert np.array_equal(record.rig[:, at.LOAD_ANGLE], truth.load_angle_rad[start:])
    assert np.array_equal(record.rig[:, at.LOAD_TORQUE], truth.load_torque_nm[start:])
    assert np.all(record.bridge_enabled)
    assert fast.bus.bench.rig.sensors == bench.rig.sensors
    assert fast.bus.bench.actuators == bench.actuators
    # both go on alike over the bus, from the entries that were watched
    for index, column in ((0x2025, 0), (0x6041, 1)):
        here, there = slow.read(index), fast.read(index)
        assert here == there
        recorded = int(record.drive[-1, column])
        # SDO takes a few ticks more, so that the torque has moved on, by less than 0.1 N m
        assert abs(int.from_bytes(there, "little", signed=column == 0) - recorded) < 1e5
    for host in (slow, fast):
        host.bus.shutdown()


def test_hand_and_command_are_those_given() -> None:
    still = replace(Rig(), operator=Operator(motion="still"))
    host = enabled(still, TORQUE)
    ticks = TICKS_PER_S // 2
    time_s = np.arange(ticks) / TICKS_PER_S
    operator = np.column_stack([0.1 * np.sin(6.0 * time_s), 0.6 * np.cos(6.0 * time_s)])
    record = native_loop.run(host.bus.bench, ticks, operator, np.full(ticks, 0.05))
    # 40 us of motor time constant against half a second; the current sense's noise is not in it
    assert record.rig[-1, at.MOTOR_TORQUE] == pytest.approx(0.05, rel=1e-3)
    assert record.rig[-1, at.INTENDED_ANGLE] == operator[-1, 0]
    # the operator's spring gives by the cables' friction, 3.7 N m / 200 N m/rad, and by its damper
    assert record.rig[-1, at.LOAD_ANGLE] == pytest.approx(0.1 * math.sin(3.0), abs=0.02)
    host.bus.shutdown()
