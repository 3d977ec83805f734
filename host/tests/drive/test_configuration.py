"""Configuration: only what differs is written, all is read back, and none of it stays half."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run, powered
from bowden.errors import BadInput, DriveFailed
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]


WANTED = {"cable_pretension": 12.5, "segment_curvature.7": 2.0, "motor_pulley_radius": 0.020}


def test_difference_write_and_read_back(rig: MakeRig) -> None:
    drive, _ = rig()
    changes = difference(drive, WANTED)
    assert [(c.name, c.before, c.wanted, c.unit) for c in changes] == [
        ("cable_pretension", 10.0, 12.5, "N"),
        ("segment_curvature.7", pytest.approx(3.571429), 2.0, "1/m"),
    ]
    assert drive.read("cable_pretension") == 10.0  # nothing is written by looking
    write(drive, changes)
    assert difference(drive, WANTED) == []
    assert drive.read("segment_curvature.7") == pytest.approx(2.0)


def test_what_is_no_configuration_is_refused(rig: MakeRig) -> None:
    drive, _ = rig()
    for name in ("torque_constant", "target_torque", "statusword"):
        with pytest.raises(BadInput, match=f"{name}: .*role"):
            difference(drive, {name: 0.0})
    with pytest.raises(BadInput, match="no_such_entry"):
        difference(drive, {"no_such_entry": 0.0})


def test_a_configuration_that_cannot_run_is_taken_back(rig: MakeRig) -> None:
    drive, _ = rig()
    wanted = {"cable_pretension": 12.5, "friction_static": 0.1}  # mu_s below mu_d
    with pytest.raises(DriveFailed, match=r"cannot run.*friction.*the old configuration is back"):
        write(drive, difference(drive, wanted))
    assert drive.read("cable_pretension") == 10.0
    assert drive.read("friction_static") == pytest.approx(0.63)
    assert drive.read_raw("configuration_error") == 0


def test_a_value_that_is_not_kept_is_found_by_reading_back(
    rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive, _ = rig()
    changes = difference(drive, WANTED)
    really_write = drive.write_raw

    def forget(name: str, raw: int) -> None:
        if name != "segment_curvature.7":
            really_write(name, raw)

    monkeypatch.setattr(drive, "write_raw", forget)
    with pytest.raises(
        DriveFailed, match=r"keeps segment_curvature\.7 at 3\.571429 1/m instead of 2 1/m; the old"
    ):
        write(drive, changes)
    assert drive.read("cable_pretension") == 10.0


def test_an_interrupted_write_is_taken_back(rig: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    drive, _ = rig()
    changes = difference(drive, WANTED)
    really_write = drive.write_raw

    def interrupted(name: str, raw: int) -> None:
        really_write(name, raw)
        if name == "segment_curvature.7":
            monkeypatch.setattr(drive, "write_raw", really_write)
            raise KeyboardInterrupt

    monkeypatch.setattr(drive, "write_raw", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(drive, changes)
    assert difference(drive, WANTED) == changes


def test_while_the_bridge_is_on_nothing_is_written(rig: MakeRig) -> None:
    drive, _ = rig(motion="still")
    with powered(drive, Run(ModeOfOperation.TUNNEL)):
        with pytest.raises(DriveFailed, match=r"cable_pretension.*0800 0022h.*stop the drive"):
            write(drive, difference(drive, WANTED))
        assert drive.read("cable_pretension") == 10.0
