"""Commissioning of the winding on the flashed ELF: measured, entered, and then controlled by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.commission.job import Facts, Job
from bowden.commission.state import StepFinding
from bowden.commission.winding import read_trace, winding_of
from bowden.commission.with_motor import find_winding
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run, powered
from bowden.errors import BadInput
from bowden.model import table_1
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Operator, OperatorMotion
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.board_bench import NEEDS_ELF, rig_with
from hil_tests.emulated.bridge import Motor
from hil_tests.targets.emulated import EmulatedTarget

MOTORS = [Motor(), Motor(2.0, 0.4e-3), Motor(1.0, 3e-3), Motor(0.3, 0.1e-3)]


def drive_of(motor: Motor, operator: OperatorMotion) -> tuple[Drive, Bench]:
    bench = Bench(
        SimulatedRig(rig_with(Operator(motion=operator), None), 0), EmulatedTarget(motor=motor)
    )
    bus = VirtualBus(bench)
    connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
    connection.listen(0.1)
    return Drive(connection), bench


@NEEDS_ELF
@pytest.mark.parametrize("operator", ["locked", "free"])
@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: f"{m.resistance_ohm}-{m.inductance_h}")
def test_the_winding_is_found_and_gives_the_gains(motor: Motor, operator: OperatorMotion) -> None:
    drive, bench = drive_of(motor, operator)
    start = bench.rig.sensors.motor_encoder_counts
    trace = read_trace(drive)
    assert trace is not None
    assert abs(bench.rig.sensors.motor_encoder_counts - start) <= 10  # it hardly moves: 2 deg
    assert np.abs(trace[0]).max() < 4e6  # at 0.1 mH it rises by 1.2 A in a sample
    winding = winding_of(*trace)
    assert winding.resistance.holds(motor.resistance_ohm)
    assert winding.inductance.value == pytest.approx(motor.inductance_h, rel=0.02)
    assert winding.resistance.high < 1.2 * winding.resistance.value


class Agreeing:
    """An operator who lets every step begin."""

    def ask(self, title: str, moves: str, todo: str) -> None:
        assert all((title, moves, todo))

    def mend(self, fault: str, todo: str) -> None:
        raise AssertionError(fault, todo)

    def tell(self, finding: StepFinding) -> None:
        raise AssertionError(finding)


def job_of(drive: Drive, folder: Path) -> Job:
    facts = Facts(angle_rad=1.0, angle_tolerance_rad=0.01, weights_kg=(1.0, 2.0), lever_m=0.1)
    return Job(drive, table_1(), folder, Agreeing(), facts)


def kp_v_per_a(bench: Bench) -> float:
    """Proportional gain of the current loop, from the chip's memory; 1 kHz needs 2 pi f L."""
    target = bench.target
    assert isinstance(target, EmulatedTarget)
    return target.chip.word("gains", 0) / 65536


@NEEDS_ELF
def test_commissioning_corrects_the_drive_and_its_current_loop(tmp_path: Path) -> None:
    drive, bench = drive_of(Motor(1.0, 3e-3), "locked")
    assert kp_v_per_a(bench) == pytest.approx(2 * np.pi * 1000 * 0.3e-3, rel=1e-3)
    findings = find_winding(job_of(drive, tmp_path))
    assert [finding.verdict for finding in findings] == ["corrected", "corrected"]
    assert drive.read("motor_resistance") == pytest.approx(1.0, rel=0.15)
    assert drive.read("motor_inductance") == pytest.approx(3e-3, rel=0.02)
    drive.connection.listen(0.1)  # the drive takes its configuration
    assert kp_v_per_a(bench) == pytest.approx(2 * np.pi * 1000 * 3e-3, rel=0.02)
    with powered(drive, Run(ModeOfOperation.TORQUE, torque_nm=0.06)):
        drive.connection.listen(0.1)
        assert bench.actuators.motor_current_ua == pytest.approx(1e6, abs=30_000)
    again = find_winding(job_of(drive, tmp_path))
    assert [finding.verdict for finding in again] == ["as stated", "as stated"]


@NEEDS_ELF
def test_a_motor_that_is_not_connected_is_refused() -> None:
    drive, _ = drive_of(Motor(1e5, 1e-3), "locked")
    trace = read_trace(drive)
    assert trace is not None
    with pytest.raises(BadInput, match=r"winding|resistance"):
        winding_of(*trace)


def test_a_board_without_a_winding_says_so(tmp_path: Path) -> None:
    """The native drive: its simulated amplifier has no winding."""
    bench = Bench(SimulatedRig(), make_target("native"))
    bus = VirtualBus(bench)
    drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
    assert read_trace(drive) is None
    assert not bench.actuators.bridge_enabled
    (finding,) = find_winding(job_of(drive, tmp_path))
    assert finding.found.startswith("not measured")
    with powered(drive, Run(ModeOfOperation.WINDING)):
        drive.connection.listen(0.1)
        assert bench.actuators.motor_current_ua == 0
