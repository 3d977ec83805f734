"""Several drives and other nodes in one recording, all on one clock."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import can
import numpy as np
import pytest
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.errors import BadInput
from bowden.recording.foreign_file import read_foreign
from bowden.recording.read import read_recording

from .shared_wire import Sender, SharedWire, bench

# Force: 16 bits, big endian (Motorola), signed, 0.01 N, at bytes 1 and 2; Temperature: 8 bits.
DBC = """VERSION ""
NS_ :
BS_:
BU_: Gauge
BO_ 1234 Reading: 4 Gauge
 SG_ Temperature : 0|8@1+ (0.5,-40) [-40|80] "degC" Vector__XXX
 SG_ Force : 15|16@0- (0.01,0) [-300|300] "N" Vector__XXX
"""

EDS = """[FileInfo]
FileName=imu.eds
[DeviceInfo]
VendorName=someone
[MandatoryObjects]
SupportedObjects=0
[OptionalObjects]
SupportedObjects=0
[ManufacturerObjects]
SupportedObjects=0
[6000]
ParameterName=rate
ObjectType=0x7
DataType=0x0003
AccessType=ro
PDOMapping=1
[6001]
ParameterName=temperature
ObjectType=0x7
DataType=0x0005
AccessType=ro
PDOMapping=1
[1800]
ParameterName=tpdo1 communication
ObjectType=0x9
SubNumber=2
[1800sub0]
ParameterName=count
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=1
[1800sub1]
ParameterName=cob id
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x180
[1A00]
ParameterName=tpdo1 mapping
ObjectType=0x9
SubNumber=3
[1A00sub0]
ParameterName=count
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=2
[1A00sub1]
ParameterName=first
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=0x60010008
[1A00sub2]
ParameterName=second
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=0x60000010
"""

YAML = """strain gauge:
  dbc: gauge.dbc
  channels:
    handle_force_n: {message: Reading, signal: Force, unit: N}
    room_temperature_c: {message: Reading, signal: Temperature}
imu:
  eds: imu.eds
  node: 32
  channels:
    forearm_rate_rad_per_s: {object: '6000h', scale: 0.001}
"""


@pytest.fixture
def description(tmp_path: Path) -> Path:
    (tmp_path / "gauge.dbc").write_text(DBC)
    (tmp_path / "imu.eds").write_text(EDS)
    path = tmp_path / "bench.yaml"
    path.write_text(YAML)
    return path


def force_n(time_s: float | np.ndarray) -> np.ndarray:
    return 20.0 * np.sin(2 * np.pi * time_s)


def others(silent_from_s: float = np.inf, silent_to_s: float = np.inf) -> Sender:
    """Send as gauge (100 Hz) and IMU (200 Hz) do; the gauge is silent for a while."""
    sent = [0, 0]

    def send(time_s: float) -> Iterator[can.Message]:
        if time_s >= sent[0] / 100:
            sent[0] += 1
            if not silent_from_s <= time_s < silent_to_s:
                data = struct.pack(">BhB", 130, round(100 * float(force_n(time_s))), 0)
                yield frame(1234, data, time_s)
        if time_s >= sent[1] / 200:
            sent[1] += 1
            yield frame(0x1A0, struct.pack("<Bh", 99, round(1000 * (time_s - 5.0))), time_s)

    return send


def frame(cob_id: int, data: bytes, time_s: float) -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, timestamp=time_s)


Connect = Callable[[SharedWire], Connection]


@pytest.fixture
def connect() -> Iterator[Connect]:
    with ExitStack() as open_ones:
        yield lambda wire: open_ones.enter_context(
            Connection(wire, clock=lambda: wire.time_s, threaded=False)
        )


def test_other_nodes_become_channels_on_the_drive_s_clock(
    description: Path, tmp_path: Path, connect: Connect
) -> None:
    wire = SharedWire([bench(16)], others())
    path = tmp_path / "run.blf"
    drive = Drive(connect(wire))
    wire.recv(0)
    started_s = wire.time_s
    capture = record(drive, path, 2.0, foreign=read_foreign(description))
    assert capture.side.findings == []
    # What the capture says needs neither DBC nor EDS any more.
    for name in ("gauge.dbc", "imu.eds", "bench.yaml"):
        (tmp_path / name).unlink()
    recording = read_recording(path)
    assert recording.time_s.size > 1900
    # The rate is the wire's own time: it places the recording, to half a sample of the wire (5 ms
    # between two frames lie on a straight line).
    wire_s = recording["forearm_rate_rad_per_s"] + 5.0
    np.testing.assert_allclose(np.diff(wire_s), np.diff(recording.time_s), atol=2e-3)
    assert wire_s[0] > started_s
    # Linear interpolation of a 1 Hz sine sampled at 100 Hz errs by at most A (w h)^2 / 8; the
    # signal's step is 0.01 N and the rate's own 1 ms is worth A w 1 ms.
    bound = 20 * (2 * np.pi * 0.01) ** 2 / 8 + 0.01 + 20 * 2 * np.pi * 1e-3
    np.testing.assert_allclose(recording["handle_force_n"], force_n(wire_s), atol=bound)
    assert set(recording["room_temperature_c"]) == {25.0}


def test_where_another_node_is_silent_nothing_is_interpolated(
    description: Path, tmp_path: Path, connect: Connect
) -> None:
    wire = SharedWire([bench(16)], others(silent_from_s=1.0, silent_to_s=1.5))
    path = tmp_path / "run.blf"
    capture = record(Drive(connect(wire)), path, 2.0, foreign=read_foreign(description))
    (finding,) = capture.side.findings
    assert finding.startswith("strain gauge: 50 frames missing")
    recording = read_recording(path)
    (gap,) = recording.gaps
    assert gap[1] == pytest.approx(0.51, abs=0.012)
    assert "50 frames missing" in recording.metadata["findings"]
    assert recording.metadata["frames_lost"] == "0"


def test_a_node_that_never_sends_costs_no_sample(
    description: Path, tmp_path: Path, connect: Connect
) -> None:
    wire = SharedWire([bench(16)])
    capture = record(
        Drive(connect(wire)), tmp_path / "run.blf", 0.5, foreign=read_foreign(description)
    )
    assert len(capture.side.findings) == 2
    assert capture.decoded.number.size == capture.side.samples


def test_two_drives_on_one_clock(tmp_path: Path, connect: Connect) -> None:
    """The second drive's clock runs 500 ppm fast; both operators move alike, so must the angles."""
    wire = SharedWire([bench(16), bench(17)], fast_by_ppm=500.0)
    connection = connect(wire)
    drives = [Drive(connection, 16), Drive(connection, 17)]
    connection.listen(2.0)  # so long the clocks drift apart: 1 ms
    path = tmp_path / "run.blf"
    capture = record(drives, path, 3.0)
    assert [side.node_id for side in capture.side.others] == [17]
    assert capture.decoded.frames_lost == 0
    recording = read_recording(path)
    assert recording.metadata["other_nodes"] == "17"
    # The second rig is up to 2.5 ms ahead of the first, at up to 2.2 rad/s.
    np.testing.assert_allclose(
        recording["node17_load_angle_rad"], recording.load_angle_rad, atol=2.2 * 2.6e-3 + 1e-3
    )
    # That clock is further off than crystals allow, and that is said.
    assert any("node 17" in one and "faster" in one for one in capture.side.findings)


def test_two_drives_are_both_enabled_and_both_left_safe(tmp_path: Path, connect: Connect) -> None:
    benches = [bench(16, motion="locked"), bench(17, motion="locked")]
    wire = SharedWire(benches)
    connection = connect(wire)
    drives = [Drive(connection, 16), Drive(connection, 17)]
    path = tmp_path / "run.blf"
    record(drives, path, 0.5, run=Run(ModeOfOperation.TORQUE, torque_nm=0.05))
    assert not any(one.actuators.bridge_enabled for one in benches)
    recording = read_recording(path)
    for name in ("motor_torque_nm", "node17_motor_torque_nm"):
        assert recording[name].max() == pytest.approx(0.05, abs=5e-3)


@pytest.mark.parametrize(
    ("file", "before", "after", "told"),
    [
        ("bench.yaml", "Force, unit: N", "Farce, unit: N", "did you mean Force"),
        ("bench.yaml", "Force, unit: N", "Force, unit: kN", "unit 'N' in the DBC"),
        ("bench.yaml", "handle_force_n", "load_torque_nm", "a name that is taken"),
        ("bench.yaml", "handle_force_n", "Handle force", "small letters"),
        ("bench.yaml", "'6000h'", "'6005h'", "6000h:0"),
        ("bench.yaml", "  node: 32\n", "", "needs node"),
        ("bench.yaml", "eds: imu.eds", "eds: no.eds", "no.eds"),
        ("bench.yaml", "dbc: gauge.dbc", "file: gauge.dbc", "unknown key"),
        ("gauge.dbc", "15|16@0-", "7|16@0-", "overlapping"),
        ("gauge.dbc", "15|16@0-", "31|16@0-", "does not fit"),
        ("gauge.dbc", "BO_ 1234", "BO_ twelve", "gauge.dbc"),
        ("imu.eds", "DataType=0x0003", "DataType=soon", "imu.eds"),
    ],
)
def test_contradictions_are_reported(
    description: Path, file: str, before: str, after: str, told: str
) -> None:
    path = description.parent / file
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after, 1))
    with pytest.raises(BadInput, match=told.replace("|", r"\|")):
        read_foreign(description)
