"""The zero of the angles as the host sees it: reported, refused, set."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from bowden.cli.main import main
from bowden.drive.checks import check_reference
from bowden.drive.client import Drive
from bowden.drive.fault_report import fault_report
from bowden.drive.homing import angle_reference, home_at_index, home_here, learn_index
from bowden.drive.meanings import AngleReference, Homing, ModeOfOperation
from bowden.drive.power import Run, powered
from bowden.errors import DriveFailed
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.virtual_bus import VirtualBus

from tools.lent_rig import lent_rig

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


def test_the_index_pulses_give_the_zero_again_that_was_learned(rig: Make) -> None:
    drive, bus = rig(motion="sine", starts="now")
    bus.advance(0.7)
    home_here(drive)
    since = bus.bench.rig.sensors.load_encoder_counts
    learned = learn_index(drive)
    # the rig's pulse is where its encoder reads 0; setting the zero takes 10 ms of 18 counts
    assert abs(learned.load + since) <= 18
    target: Any = bus.bench.target
    target._identity.reset = target._lib.RESET_CAUSE_BROWN_OUT
    target.reset()
    bus.advance(0.1)
    assert angle_reference(drive) is AngleReference.LOST
    drive.write("index_position.motor", learned.motor)
    drive.write("index_position.load", learned.load)
    home_at_index(drive)
    assert angle_reference(drive) is AngleReference.INDEXED
    read_rad = drive.read("load_angle")
    moved = bus.bench.rig.sensors.load_encoder_counts + learned.load
    assert read_rad == pytest.approx(moved * 6.283185307 / 10_000, abs=0.005)  # 5 ms of an answer


def test_a_load_that_nobody_moves_is_not_homed_and_keeps_its_zero(rig: Make) -> None:
    drive, _ = rig(motion="still")
    with pytest.raises(DriveFailed, match=r"no index pulse of the motor and the load .* 2 s"):
        home_at_index(drive, timeout_s=2.0)
    assert angle_reference(drive) is AngleReference.POWER_ON
    assert drive.read_raw("homing") == Homing.NONE


def test_index_pulses_are_not_learned_without_a_zero(rig: Make) -> None:
    drive, _ = after_a_reset_in_motion(rig)
    with pytest.raises(DriveFailed, match="set it first"):
        learn_index(drive)


def test_the_command_learns_and_finds_the_zero(capsys: pytest.CaptureFixture[str]) -> None:
    with lent_rig(Rig(operator=Operator(motion="sine", starts="now"))) as bus:
        bus.advance(0.3)
        assert main(["home"]) == 0
        capsys.readouterr()
        assert main(["home", "--learn-index", "--json"]) == 0
        learned = json.loads(capsys.readouterr().out)
        assert (learned["reference"], learned["known"]) == ("homed", True)
        assert set(learned["index_position"]) == {"motor", "load"}
        assert main(["home", "--index", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert (found["reference"], found["known"]) == ("indexed", True)


def test_the_command_fails_when_nobody_moves_the_load(capsys: pytest.CaptureFixture[str]) -> None:
    with lent_rig():
        assert main(["home", "--index", "--timeout", "1"]) == 3
        assert "no index pulse of the motor and the load encoder" in capsys.readouterr().err
        assert main(["home", "--index", "--timeout", "nan"]) == 2
