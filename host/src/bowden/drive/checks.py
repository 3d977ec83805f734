"""The checks of `bowden doctor`: from the bus to the signs, each with what to do when it fails.

Every check only reads; the bridge is not touched. `cli.doctor` shows the findings. A check that
could not be made is reported as such and never counted as passed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bowden.drive.bus_load import BusLoad
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.culprit import refused_configuration
from bowden.drive.dictionary import BITRATE, HASH, lookup
from bowden.drive.faults import describe_address, describe_emergency
from bowden.drive.homing import UNKNOWN, angle_reference
from bowden.drive.meanings import ConfigurationOriginOutcome, ResetCause
from bowden.drive.power import BRIDGE_ON, is_fault, power_state
from bowden.errors import DriveFailed
from bowden.recording.recording import Recording

State = Literal["ok", "warning", "failed", "not checked"]

LISTEN_S = 0.5
#: Above this share of the bit rate, frames of low priority come late.
BUSY_SHARE = 0.7
#: Undervoltage is a fault of the drive; this only names a supply that is not there at all.
_NO_SUPPLY_V = 1.0
#: A recorder may wait so long for processor time; by then a full bus has filled the buffer.
LEAST_BUFFER_S = 1.0
_FULL_BUS_FRAMES_PER_S = 8000.0  # 1 Mbit/s, eight bytes each
_SAMPLES = 20
_SAMPLE_EVERY_S = 0.01
#: Of motion by which signs can be told: far above encoder steps and the cables' stretch.
LEAST_MOTION_RAD = 0.2


@dataclass(frozen=True)
class CheckResult:
    """What one check found.

    Parameters
    ----------
    check : str
        What was checked, in one or two words.
    state : str
        ``"ok"``, ``"warning"``, ``"failed"`` or ``"not checked"``.
    found : str
        What is there.
    todo : str
        What to do next; empty when nothing needs doing.
    """

    check: str
    state: State
    found: str
    todo: str = ""


def check_drive(drive: Drive) -> Iterator[CheckResult]:
    """Yield the findings from the bus inwards; stop at the first that makes the others moot."""
    yield check_bus(drive)
    node = check_node(drive)
    yield node
    if node.state == "failed":
        return
    for check in _OF_THE_DRIVE:
        try:
            yield check(drive)
        except DriveFailed as failure:
            name = check.__name__.removeprefix("check_").replace("_", " ")
            yield CheckResult(name, "failed", str(failure), "flash the firmware of this version")


def check_adapter(connection: Connection) -> CheckResult:
    """Say what the bus is; a socket that holds few frames loses some on a busy machine."""
    told = ", ".join(f"{key} {value}" for key, value in connection.adapter.items())
    held = connection.receive_buffer_frames
    if held is None or held >= LEAST_BUFFER_S * _FULL_BUS_FRAMES_PER_S:
        return CheckResult("adapter", "ok", told)
    return CheckResult(
        "adapter",
        "warning",
        f"{told}; the system holds only {held / _FULL_BUS_FRAMES_PER_S:.2f} s of a full bus: a "
        "busy machine loses frames",
        "sudo sysctl -w net.core.rmem_max=67108864",
    )


def check_bus(drive: Drive) -> CheckResult:
    """Count frames: error frames mean a wrong bit rate or wiring; much traffic delays samples."""
    connection = drive.connection
    errors_before = connection.error_frames
    load = BusLoad(connection)
    end = connection.clock() + LISTEN_S
    while (left := end - connection.clock()) > 0:
        if (frame := connection.receive(max(left, 1e-3))) is not None:
            load.count(frame)
    rate_hz, share = load.take()
    found = f"{rate_hz:.0f} frames/s, {share:.0%} of {load.bitrate / 1e6:g} Mbit/s"
    if errors := connection.error_frames - errors_before:
        return CheckResult(
            "bus",
            "failed",
            f"{errors} error frames in {LISTEN_S:g} s",
            f"set the bit rate (-b {BITRATE}), check wiring and both 120 ohm terminations",
        )
    if share > BUSY_SHARE:
        return CheckResult(
            "bus", "warning", found, "take other senders off the bus or slow them down"
        )
    return CheckResult("bus", "ok", found)


def check_node(drive: Drive) -> CheckResult:
    """Read the device's name; when nothing answers, report what was received instead."""
    try:
        name = drive.read_text("device_name")
    except DriveFailed as failure:
        return CheckResult(
            "node", "failed", str(failure), "run `bowden scan`; check --node and power"
        )
    state = drive.next_nmt_state().lower()
    if state == "unknown":
        return CheckResult(
            "node",
            "warning",
            f"node {drive.node_id} ({name}) answers but sends no heartbeat",
            "bowden od write producer_heartbeat=0.05",
        )
    others = [str(node) for node in drive.connection.nodes_heard if node != drive.node_id]
    also = f"; also on the bus: {', '.join(others)}" if others else ""
    return CheckResult("node", "ok", f"node {drive.node_id} ({name}), NMT {state}{also}")


def check_dictionary(drive: Drive) -> CheckResult:
    """Compare the hash of the object dictionary with this bowden's."""
    there = drive.read_raw("dictionary_hash")
    if there != HASH:
        return CheckResult(
            "dictionary",
            "failed",
            f"the drive has {there:08X}h, this bowden {HASH:08X}h",
            "flash the firmware of this version (make flash), or install the bowden of the drive's",
        )
    return CheckResult("dictionary", "ok", f"{there:08X}h on both sides")


def check_firmware(drive: Drive) -> CheckResult:
    """Report the version, the cause of the start, and crashes."""
    version = drive.read_text("software_version")
    cause = ResetCause(drive.read_raw("reset_cause"))
    crashes = drive.read_raw("crash_record.crashes")
    found = f"{version}, started by {cause.doc}"
    if crashes:
        todo = "report it with the output of `bowden info`"
        return CheckResult(
            "firmware", "warning", f"{found}; {crashes} crashes since power-on", todo
        )
    if cause in (ResetCause.WATCHDOG, ResetCause.WINDOW_WATCHDOG):
        return CheckResult("firmware", "warning", found, "report it: the firmware hung")
    if cause is ResetCause.BROWN_OUT:
        return CheckResult("firmware", "warning", found, "check the logic supply")
    return CheckResult("firmware", "ok", found)


def check_configuration(drive: Drive) -> CheckResult:
    """Check that the drive can run with its configuration, and report where that came from."""
    if culprit := refused_configuration(drive):
        return CheckResult(
            "configuration",
            "failed",
            f"cannot run with its {culprit}",
            "bowden configure MODEL.yaml",
        )
    origin = ConfigurationOriginOutcome(drive.read_raw("configuration_origin.outcome"))
    if origin is ConfigurationOriginOutcome.DEFAULTS:
        todo = "bowden configure MODEL.yaml --store: it still has the paper's rig"
        return CheckResult("configuration", "warning", origin.doc, todo)
    if origin not in (ConfigurationOriginOutcome.COMPLETE, ConfigurationOriginOutcome.MIGRATED):
        entry = drive.read_raw("configuration_origin.first_entry")
        first = f", the first {describe_address(entry)}" if entry else ""
        todo = "compare with a file (bowden config diff FILE), then bowden config store"
        return CheckResult("configuration", "warning", f"{origin.doc}{first}", todo)
    return CheckResult("configuration", "ok", origin.doc)


def check_faults(drive: Drive) -> CheckResult:
    """Report the present fault, or the past ones."""
    status = drive.read_raw("statusword")
    if is_fault(status):
        code = drive.read_raw("error_code")
        return CheckResult(
            "faults",
            "failed",
            describe_emergency(code),
            "remove its cause; bowden record resets it",
        )
    count = drive.read_raw("error_history.count")
    if count:
        latest = describe_emergency(drive.read_raw("error_history.1") & 0xFFFF)
        todo = "bowden info lists them; empty with: bowden od write error_history.count=0"
        return CheckResult("faults", "warning", f"none now; {count} past, the last: {latest}", todo)
    return CheckResult("faults", "ok", f"none, now or before; {power_state(status)}")


def check_reference(drive: Drive) -> CheckResult:
    """Report where the angles count from: without a zero the tunnel is refused."""
    found = angle_reference(drive)
    if found in UNKNOWN:
        todo = "move the load to its zero, then: bowden home"
        return CheckResult("zero", "failed", f"{found.doc}; the tunnel is refused", todo)
    return CheckResult("zero", "ok", found.doc)


def check_supply(drive: Drive) -> CheckResult:
    """Read the bus voltage."""
    volts = drive.read("bus_voltage")
    if volts < _NO_SUPPLY_V:
        return CheckResult("supply", "failed", f"{volts:.1f} V", "connect the motor supply")
    return CheckResult("supply", "ok", f"{volts:.1f} V")


def check_sensors(drive: Drive) -> CheckResult:
    """Read encoders and load cell for a moment: a converter that runs has some noise."""
    names = ("motor_angle", "load_angle", "load_torque", "motor_current")
    rows = []
    for _ in range(_SAMPLES):
        rows.append([drive.read_raw(name) for name in names])
        drive.connection.listen(_SAMPLE_EVERY_S)
    spread = np.ptp(np.array(rows), axis=0)
    values = ", ".join(
        f"{name.replace('_', ' ')} {lookup(name).to_value(raw):.4g} {lookup(name).unit}"
        for name, raw in zip(names, rows[-1], strict=True)
    )
    if spread[2] == 0:
        return CheckResult(
            "sensors",
            "warning",
            f"{values}; the load cell gave one value {_SAMPLES} times",
            "check the load cell's amplifier and wires",
        )
    return CheckResult("sensors", "ok", values)


def check_signs(recording: Recording, ratio: float) -> list[CheckResult]:
    """Judge the signs from a recording in which the load was moved by hand, the bridge off.

    The cables tie both pulleys: the motor turns the same way, by the ratio of the radii, less the
    cables' stretch. With the motor off the cables only resist: the work that they do on the load is
    negative (PHYSICS: load torque is by the cables on the load).

    Parameters
    ----------
    recording : Recording
        With both angles and the load torque.
    ratio : float
        Load pulley's radius over the motor's.
    """
    load, motor = recording.load_angle_rad, recording.motor_angle_rad
    moved = float(np.ptp(load))
    if moved < LEAST_MOTION_RAD:
        todo = f"move the load by hand by more than {LEAST_MOTION_RAD:g} rad, both ways"
        return [CheckResult("signs", "not checked", f"the load moved by {moved:.3f} rad", todo)]
    steps = np.diff(load), np.diff(motor)
    together = float(np.sum(steps[0] * steps[1]))
    slope = float(np.polyfit(load - load.mean(), motor - motor.mean(), 1)[0])
    found = f"motor over load: {slope:+.3f}, the radii say {ratio:+.3f}"
    if together <= 0:
        todo = "swap A and B of one encoder: the ends count in opposite directions"
        angles = CheckResult("encoder signs", "failed", found, todo)
    elif not 0.8 * ratio < slope < 1.2 * ratio:
        todo = (
            "check encoder resolutions and pulley radii (bowden od read '*_resolution' '*_radius')"
        )
        angles = CheckResult("encoder signs", "warning", found, todo)
    else:
        angles = CheckResult("encoder signs", "ok", found)
    torque = recording.load_torque_nm
    work_j = float(np.sum(0.5 * (torque[1:] + torque[:-1]) * steps[0]))
    found = f"the cables did {work_j:+.3g} J on the load with the motor off"
    if work_j >= 0:
        todo = "negate load_cell_gain: bowden od write load_cell_gain=..."
        cell = CheckResult("load cell sign", "failed", found, todo)
    else:
        cell = CheckResult("load cell sign", "ok", found)
    return [angles, cell]


def bridge_is_on(drive: Drive) -> bool:
    """Return whether the motor may carry current."""
    return power_state(drive.read_raw("statusword")) in BRIDGE_ON


_OF_THE_DRIVE: tuple[Callable[[Drive], CheckResult], ...] = (
    check_dictionary,
    check_firmware,
    check_configuration,
    check_faults,
    check_reference,
    check_supply,
    check_sensors,
)
