"""The bridge is on only inside `powered`, and never outlives the host."""

from __future__ import annotations

from collections.abc import Callable

import can
import numpy as np
import pytest
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run, power_state, powered, safe_stop
from bowden.drive.torque_profile import TorqueProfile, torque_sender
from bowden.errors import DriveFailed
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]


TUNNEL = Run(ModeOfOperation.TUNNEL)
_ONCE = TorqueProfile(np.array([0.0, 1.0]), np.zeros(2), "none")
PROFILE = Run(ModeOfOperation.TORQUE, profile=_ONCE)


def test_the_bridge_is_on_inside_the_block_and_off_after_it(rig: MakeRig) -> None:
    drive, bus = rig()
    with powered(drive, TUNNEL):
        assert bus.bench.actuators.bridge_enabled
        assert drive.read_raw("mode_of_operation_display") == -1
    assert not bus.bench.actuators.bridge_enabled
    drive.connection.listen(0.2)
    assert drive.nmt_state == "PRE-OPERATIONAL"
    assert drive.read_raw("consumer_heartbeat.1") == 0  # as it was


def test_torque_comes_and_goes_with_the_slew_rate(rig: MakeRig) -> None:
    drive, bus = rig(motion="locked")
    drive.write("motor_torque_slew", 1.0)
    with powered(drive, Run(ModeOfOperation.TORQUE, torque_nm=0.1)):
        drive.connection.listen(0.3)
        # Current sensing and amplifier settle within a few mN m.
        assert drive.read("motor_torque") == pytest.approx(0.1, abs=5e-3)
    assert not bus.bench.actuators.bridge_enabled


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit, DriveFailed])
def test_whatever_ends_the_block_the_bridge_is_off(
    rig: MakeRig, error: type[BaseException]
) -> None:
    drive, bus = rig()
    with pytest.raises(error), powered(drive, TUNNEL):  # noqa: PT012
        assert bus.bench.actuators.bridge_enabled
        raise error("stop")
    assert not bus.bench.actuators.bridge_enabled


def test_a_host_that_ends_stops_the_drive(rig: MakeRig) -> None:
    drive, bus = rig()
    with pytest.raises(DriveFailed), powered(drive, TUNNEL):  # noqa: PT012
        drive.connection.stop_heartbeat()  # as if killed: nothing is sent any more
        bus.advance(0.4)  # command_deadline is 0.5 s
        assert bus.bench.actuators.bridge_enabled
        bus.advance(0.2)
        assert not bus.bench.actuators.bridge_enabled
        drive.connection.listen(0.1)
        assert drive.emergencies == [0x8131]
        raise DriveFailed("the test is over")


def test_a_late_rpdo_stops_a_drive_whose_host_heartbeat_goes_on(rig: MakeRig) -> None:
    drive, bus = rig(motion="locked")
    with powered(drive, PROFILE):
        torque_sender(drive)(0.05)
        drive.connection.listen(0.24)  # rpdo1_communication.event_timer is 250 ms then
        assert bus.bench.actuators.bridge_enabled
        drive.connection.listen(0.02)
        assert not bus.bench.actuators.bridge_enabled
    assert drive.emergencies == [0x8250]
    assert drive.read_raw("rpdo1_communication.event_timer") == 0  # as it was


def test_torques_by_rpdo_are_guarded_while_they_are_sent(rig: MakeRig) -> None:
    """A program on the host that hangs and repeats its last frame is no sign of life."""
    drive, bus = rig(motion="locked")
    sent: list[can.Message] = []
    send = bus.send

    def note(message: can.Message, timeout: float | None = None) -> None:
        sent.append(message)
        send(message, timeout)

    bus.send = note  # type: ignore[method-assign]
    with powered(drive, PROFILE):
        send_torque = torque_sender(drive)
        for _ in range(3):
            send_torque(0.05)
            drive.connection.listen(0.02)
        frames = [message for message in sent if message.arbitration_id == 0x210]
        assert [len(frame.data) for frame in frames] == [8, 8, 8]
        assert drive.read_raw("target_torque") == 50_000
        for _ in range(14):
            send(frames[-1])
            drive.connection.listen(0.02)
        assert not bus.bench.actuators.bridge_enabled
    assert 0x8250 in drive.emergencies  # late: none of them counted
    assert drive.read_raw("rpdo1_mapping.count") == 3  # as it was


def test_a_running_host_keeps_the_drive_running(rig: MakeRig) -> None:
    drive, bus = rig(motion="still")
    with powered(drive, TUNNEL):
        drive.connection.listen(2.0)
        assert bus.bench.actuators.bridge_enabled
    assert drive.emergencies == []


def test_a_fault_of_the_past_is_reset(rig: MakeRig) -> None:
    drive, bus = rig(motion="still")
    with pytest.raises(DriveFailed), powered(drive, TUNNEL):  # noqa: PT012
        drive.connection.stop_heartbeat()
        drive.connection.listen(1.5)
        raise DriveFailed("the test is over")
    with powered(drive, TUNNEL):
        assert bus.bench.actuators.bridge_enabled


def test_a_configuration_that_cannot_run_is_named(rig: MakeRig) -> None:
    drive, bus = rig()
    drive.write("friction_static", 0.1)  # below mu_d
    with (
        pytest.raises(DriveFailed, match=r"cannot run with its friction_(static|dynamic)"),
        powered(drive, TUNNEL),
    ):
        pass
    assert not bus.bench.actuators.bridge_enabled


def test_a_drive_that_does_not_confirm_is_reported(rig: MakeRig) -> None:
    dead: list[bool] = []
    drive, bus = rig(drop=lambda _: bool(dead))
    with (
        pytest.raises(DriveFailed, match="has not confirmed that its bridge is off"),
        powered(drive, TUNNEL),
    ):
        dead.append(True)
    # The drive still receives: leaving operational has turned it off.
    bus.advance(0.01)
    assert not bus.bench.actuators.bridge_enabled


def test_a_stop_is_sent_before_an_answer_is_awaited(rig: MakeRig) -> None:
    dead: list[bool] = []
    drive, bus = rig(drop=lambda _: bool(dead))
    with pytest.raises(DriveFailed), powered(drive, TUNNEL):  # noqa: PT012
        dead.append(True)
        drive.connection.listen(0.4)
        end = bus.time_s
        raise DriveFailed("vanished")
    truth = bus.bench.truth()
    last_on_s = truth.time_s[truth.bridge_enabled][-1]
    assert last_on_s < end + 0.1


@pytest.mark.parametrize("controlwords", [(), (0x06,), (0x06, 0x07)])
def test_stopping_ends_at_switch_on_disabled_from_wherever(
    rig: MakeRig, controlwords: tuple[int, ...]
) -> None:
    drive, _ = rig()
    for controlword in controlwords:
        drive.write_raw("controlword", controlword)
        drive.connection.listen(0.01)
    safe_stop(drive)
    assert power_state(drive.read_raw("statusword")) == "switch on disabled"


def test_a_drive_that_another_program_runs_is_left_to_it(rig: MakeRig) -> None:
    drive, bus = rig()
    with powered(drive, TUNNEL):
        with pytest.raises(DriveFailed, match="another program runs it"), powered(drive, TUNNEL):
            pytest.fail("the second program got the drive")
        assert bus.bench.actuators.bridge_enabled
