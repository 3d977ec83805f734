"""The zero of the angles as the host sees it: reported, refused, set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from bowden.drive.checks import check_reference
from bowden.drive.client import Drive
from bowden.drive.fault_report import fault_report
from bowden.drive.homing import angle_reference, home_here
from bowden.drive.meanings import AngleReference, ModeOfOperation
from bowden.drive.power import Run, powered
from bowden.errors import DriveFailed
from bowden_rig.virtual_bus import VirtualBus

Make = Callable[..., tuple[Drive, VirtualBus]]


def after_a_reset_in_motion(rig: Make) -> tuple[Drive, VirtualBus]:
    drive, bus = rig(motion="still")
    target: Any = bus.bench.target
    target._identity.reset = target._lib.RESET_CAUSE_WATCHDOG
    target.reset()
    bus.advance(0.15)
    return drive, bus


def test_power_on_is_a_zero(rig: Make) -> None:
    drive, bus = rig(motion="still")
    bus.advance(0.01)
    assert angle_reference(drive) is AngleReference.POWER_ON
    assert check_reference(drive).state == "ok"


def test_a_lost_zero_is_reported_and_the_tunnel_refused_in_words(rig: Make) -> None:
    drive, _ = after_a_reset_in_motion(rig)
    finding = check_reference(drive)
    assert (finding.state, finding.todo) == (
        "failed",
        "move the load to its zero, then: bowden home",
    )
    assert "unknown" in fault_report(drive).angle_reference
    with (
        pytest.raises(DriveFailed, match="zero of the angles is unknown"),
        powered(drive, Run(ModeOfOperation.TUNNEL)),
    ):
        pass


def test_home_makes_it_known(rig: Make) -> None:
    drive, _ = after_a_reset_in_motion(rig)
    home_here(drive)
    assert angle_reference(drive) is AngleReference.HOMED
    assert drive.read("load_angle") == 0
    with (
        powered(drive, Run(ModeOfOperation.TUNNEL)),
        pytest.raises(DriveFailed, match="bridge off only"),
    ):
        home_here(drive)
