"""The drive through its wire alone: what holds on every target, a real board included.

The bridge stays off, except where a test needs motion. Each test begins with a drive that has just
booted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.connection import SHARED_MACHINE, Connection, TimeLimits
from bowden.drive.dictionary import HASH
from bowden.recording.read import read_recording

from hil_tests.lockstep_host import (
    CONTROLWORD,
    MODE,
    NMT_PRE_OPERATIONAL,
    NMT_RESET_NODE,
    NMT_START,
    LockstepHost,
    SdoAbort,
    Wire,
    samples,
)

Host = LockstepHost[Wire]

STATE = 0x6F
SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED = 0x40, 0x21, 0x23, 0x27
MOTOR_PULLEY_RADIUS = 0x2100  # u32, nm, 1 mm to 500 mm
TORQUE = -2
HEARTBEAT_S = 0.05
SAMPLES = 0x180  # TPDO 1


def number(host: Host, index: int, sub: int = 0) -> int:
    return int.from_bytes(host.read(index, sub), "little")


def test_boot_up_is_the_first_frame(host: Host) -> None:
    first = host.frames[0]
    assert (first.arbitration_id, bytes(first.data)) == (0x700 + host.node_id, b"\x00")


def test_heartbeat_says_pre_operational_and_nothing_else_is_sent(host: Host) -> None:
    heard = host.collect(0x700 + host.node_id, 20, within_s=1.1)
    assert {f.arbitration_id for f in heard} == {0x700 + host.node_id}
    assert {bytes(f.data) for f in heard} == {b"\x7f"}


def test_heartbeat_keeps_its_period_by_the_clock_of_the_drive(host: Host) -> None:
    host.nmt(NMT_START)
    host.collect(SAMPLES + host.node_id, 1, within_s=0.1)
    heard = host.collect(SAMPLES + host.node_id, 1000, within_s=1.1)
    beats, last_beat_s, time_s = [], None, 0.0
    for frame in heard:
        if frame.arbitration_id == SAMPLES + host.node_id:
            time_s = 1e-6 * int.from_bytes(frame.data[4:8], "little")
        elif frame.arbitration_id == 0x700 + host.node_id:
            if last_beat_s is not None:
                beats.append(time_s - last_beat_s)
            last_beat_s = time_s if time_s else None
    # the sample before a heartbeat is up to 1 ms older than it
    assert beats == pytest.approx([HEARTBEAT_S] * len(beats), abs=1.001e-3)
    assert len(beats) >= 18


def test_identity_and_dictionary_are_those_of_this_host(host: Host) -> None:
    assert number(host, 0x1000) == 0x20192  # CiA 402, servo drive
    assert number(host, 0x1018, 2) == 0x000B0DE4
    assert number(host, 0x2000) == HASH, "flash the firmware of this checkout"


def test_refused_request_names_the_abort(host: Host) -> None:
    with pytest.raises(SdoAbort, match="06020000h"):
        host.read(0x5FFF)


@pytest.mark.parametrize(
    ("value", "size", "abort"),
    [
        (999_999, 4, "06090032h"),  # too low
        (500_000_001, 4, "06090031h"),  # too high
        (1, 2, "06070013h"),  # too short
    ],
)
def test_value_beyond_its_limits_is_refused_and_changes_nothing(
    host: Host, value: int, size: int, abort: str
) -> None:
    before = number(host, MOTOR_PULLEY_RADIUS)
    with pytest.raises(SdoAbort, match=abort):
        host.write(MOTOR_PULLEY_RADIUS, 0, value, size)
    assert number(host, MOTOR_PULLEY_RADIUS) == before


def test_state_machine_up_to_switched_on_and_back_without_torque(host: Host) -> None:
    host.nmt(NMT_START)
    for controlword, state in ((6, READY), (7, SWITCHED_ON), (6, READY), (0, SWITCH_ON_DISABLED)):
        host.write(CONTROLWORD, 0, controlword, 2)
        host.await_state(STATE, state)
    torque = samples(host.frames, host.node_id).motor_torque_nm
    assert torque.size > 0
    assert np.max(np.abs(torque)) < 5e-3  # the bridge is off: offset and noise of the sense, 80 mA


def test_samples_come_at_one_kilohertz_without_a_gap(host: Host) -> None:
    host.nmt(NMT_START)
    host.collect(SAMPLES + host.node_id, 2000, within_s=2.1)
    got = samples(host.frames, host.node_id)
    assert len(got.counter) >= 1999  # the last one may still lack a frame
    assert set(np.diff(got.counter) & 0xFFFF) == {1}
    assert np.allclose(np.diff(got.device_time_s), 1e-3, atol=1e-9)
    host.nmt(NMT_PRE_OPERATIONAL)
    host.statusword()  # its answer comes after the last sample
    host.listen(0.05)
    assert not samples(host.listen(0.3), host.node_id).counter.size


def test_recording_is_complete(host: Host, tmp_path: Path) -> None:
    # By the wall clock the rig's process shares this machine, which may be busy.
    limits = SHARED_MACHINE if host.bus.grace_s > 0.0 else TimeLimits()
    connection = Connection(
        host.bus,  # type: ignore[arg-type]
        clock=lambda: host.bus.time_s,
        threaded=False,
        limits=limits,
    )
    capture = record(Drive(connection, host.node_id), tmp_path / "run.blf", 1.0)
    assert capture.decoded.losses.total == 0
    recording = read_recording(tmp_path / "run.blf")
    assert np.ptp(recording.time_s) == pytest.approx(1.0, abs=0.02)
    assert np.all(np.diff(recording.time_s) > 0.0)
    assert np.all(np.isfinite(recording.load_torque_nm))


def test_reset_node_boots_again_and_forgets_nmt(host: Host) -> None:
    host.nmt(NMT_START)
    host.listen(0.05)
    host.nmt(NMT_RESET_NODE)
    host.await_boot(2.0)
    host.listen(0.01)
    assert not samples(host.listen(0.2), host.node_id).counter.size


@pytest.mark.needs("motion")
def test_bridge_on_with_no_torque_and_off_again(host: Host) -> None:
    host.write(MODE, 0, TORQUE, 1)
    host.enable(TORQUE)
    host.listen(0.1)
    assert host.statusword() & STATE == ENABLED
    host.disable()
    assert host.statusword() & STATE == SWITCH_ON_DISABLED
