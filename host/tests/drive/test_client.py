"""Access to a drive: values by name, and an error with the cause when nothing answers."""

from __future__ import annotations

import threading
from collections.abc import Callable

import can
import pytest
from bowden.drive import client
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.dictionary import HASH
from bowden.drive.scan import scan
from bowden.errors import BadInput, DriveFailed
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
MakeSilent = Callable[..., tuple[Connection, can.BusABC]]


def frame(cob_id: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def test_values_come_by_name_and_in_si_units(rig: MakeRig) -> None:
    drive, _ = rig()
    drive.check_dictionary()
    assert drive.read_text("device_name") == "bowden drive"
    assert drive.read_raw("dictionary_hash") == HASH
    # Defaults of Table I of the paper.
    assert drive.read("motor_pulley_radius") == pytest.approx(0.020)
    assert drive.read("cable_axial_stiffness") == pytest.approx(4000.0)
    drive.write("cable_pretension", 12.5)
    assert drive.read("cable_pretension") == pytest.approx(12.5)


def test_a_value_out_of_range_is_refused_before_it_is_sent(rig: MakeRig) -> None:
    drive, bus = rig()
    with pytest.raises(BadInput, match=r"cable_pretension: found 1000\.0; accepted: 0 \.\. 100 N"):
        drive.write("cable_pretension", 1000.0)
    assert not bus.bench.to_drive


def test_a_refusal_by_the_drive_says_why(rig: MakeRig) -> None:
    drive, _ = rig()
    with pytest.raises(DriveFailed, match=r"node 16 refuses device_type.*0601 0002h.*read-only"):
        drive.write_raw("device_type", 1)


def test_reads_are_repeated_and_commands_are_not(rig: MakeRig) -> None:
    lost = iter([True, True])  # the first two answers never come
    drive, bus = rig(drop=lambda frame: frame.arbitration_id == 0x590 and next(lost, False))
    assert drive.read("cable_pretension") == pytest.approx(10.0)
    assert len(bus.dropped) == 2

    lost = iter([True])
    drive, bus = rig(drop=lambda frame: frame.arbitration_id == 0x590 and next(lost, False))
    with pytest.raises(DriveFailed, match=r"is there .*but does not answer"):
        drive.write_raw("controlword", 6)
    assert len(bus.dropped) == 1


def test_a_configuration_value_is_written_again_only_where_it_is_not_there(rig: MakeRig) -> None:
    lost = iter([True])  # the answer to the write: the value is there
    drive, bus = rig(drop=lambda frame: frame.arbitration_id == 0x590 and next(lost, False))
    drive.write("cable_pretension", 12.0)
    assert drive.read("cable_pretension") == pytest.approx(12.0)
    writes = [
        frame
        for frame in bus.bench.traffic
        if frame.arbitration_id == 0x610 and frame.data[0] >> 5 == 1
    ]
    assert len(writes) == 1


def test_another_dictionary_is_refused(rig: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    drive, _ = rig()
    monkeypatch.setattr(client, "HASH", 0x12345678)
    with pytest.raises(DriveFailed, match=rf"{HASH:08X}h.*12345678h.*--force"):
        drive.check_dictionary()


def test_a_silent_bus_is_reported(silent: MakeSilent) -> None:
    connection, _ = silent()
    with pytest.raises(DriveFailed, match=r"node 16 does not answer and the bus is silent"):
        Drive(connection).read("cable_pretension")


def test_a_wrong_node_id_is_reported_with_the_ids_that_are_there(rig: MakeRig) -> None:
    drive, _ = rig()
    with pytest.raises(DriveFailed, match=r"node 20 is not there; heard from node 16: .*--node"):
        Drive(drive.connection, 20).check_dictionary()


def test_a_stopped_node_is_reported(rig: MakeRig) -> None:
    drive, _ = rig()
    drive.nmt("STOPPED")
    with pytest.raises(DriveFailed, match="NMT stopped"):
        drive.read("cable_pretension")


def test_error_frames_are_reported(silent: MakeSilent) -> None:
    connection, _ = silent(frames=[can.Message(is_error_frame=True)])
    with pytest.raises(DriveFailed, match="the bus reports errors: check bit rate"):
        Drive(connection).read("cable_pretension")


def test_an_adapter_that_cannot_send_is_reported(silent: MakeSilent) -> None:
    connection, _ = silent(sends_fail=True)
    with pytest.raises(DriveFailed, match=r"cannot send .transmit buffer full"):
        Drive(connection).read("cable_pretension")


@pytest.mark.parametrize("node_id", [0, 127, 128, -1])
def test_node_ids_that_canopen_does_not_have_are_refused(silent: MakeSilent, node_id: int) -> None:
    connection, _ = silent()
    with pytest.raises(BadInput, match="--node"):
        Drive(connection, node_id)


def test_malformed_frames_are_ignored(silent: MakeSilent) -> None:
    frames = [frame(cob_id, bytes(n)) for cob_id in (0x590, 0x710, 0x90, 0) for n in range(9)]
    connection, _ = silent(frames=frames)
    drive = Drive(connection)
    connection.listen(0.1)
    assert drive.nmt_state in ("UNKNOWN", "BOOTING")
    assert drive.emergencies == []


def test_scan_finds_the_drive_and_only_the_drive(rig: MakeRig) -> None:
    drive, bus = rig()
    # The host's own heartbeat and echoes of its requests are no nodes.
    bus.send(frame(0x77F, b"\x05"))
    (node,) = scan(drive.connection)
    assert node.node_id == 16
    assert node.name == "bowden drive"
    assert node.dictionary_matches is True
    assert node.nmt_state == "PRE-OPERATIONAL"


def test_scan_is_paced_and_done_in_seconds(silent: MakeSilent) -> None:
    connection, bus = silent()
    assert scan(connection) == []
    assert len(bus.sent) == 126
    # 8 bytes at 1 Mbit/s take 0.13 ms; a request every 5 ms leaves the bus to the others.
    assert 0.6 < bus.time_s < 3


def test_the_reading_thread_gives_every_frame_in_order_to_tap_and_caller() -> None:
    near, far = can.Bus("t", interface="virtual"), can.Bus("t", interface="virtual")
    tapped: list[can.Message] = []
    done = threading.Event()

    def tap(message: can.Message) -> None:
        tapped.append(message)
        if len(tapped) == 500:
            done.set()

    with Connection(near) as connection:
        connection.set_tap(tap)
        for n in range(500):
            far.send(frame(0x190, n.to_bytes(2, "little")))
        done.wait()
        received = [connection.receive(10) for _ in range(500)]
        connection.set_tap(None)
    far.shutdown()
    assert received == tapped
    assert [int.from_bytes(m.data, "little") for m in tapped] == list(range(500))


def test_a_reader_that_fails_is_reported_at_every_later_call() -> None:
    class Broken(can.BusABC):
        def __init__(self) -> None:
            super().__init__(channel="broken")

        def recv(self, timeout: float | None = None) -> can.Message | None:  # noqa: ARG002
            raise can.CanOperationError("unplugged")

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            pass

    with Connection(Broken()) as connection:
        for _ in range(2):
            with pytest.raises(DriveFailed, match="unplugged"):
                connection.receive(10)


def test_what_the_reading_thread_has_is_handled_at_one_go() -> None:
    near, far = can.Bus("u", interface="virtual"), can.Bus("u", interface="virtual")
    done = threading.Event()
    seen: list[bytes] = []

    def tap(message: can.Message) -> None:
        if message.data[0] == 199:
            done.set()

    with Connection(near) as connection:
        connection.set_tap(tap)
        connection.observers.append(lambda message: seen.append(bytes(message.data)))
        for n in range(200):
            far.send(frame(0x190, bytes([n])))
        done.wait()
        while len(seen) < 200:  # the last one is in the queue by then, or the next to come
            connection.handle_for(1e-3)
        connection.set_tap(None)
    far.shutdown()
    assert seen == [bytes([n]) for n in range(200)]
