"""A CANopen master that is not ours runs the drive with docs/examples/ros2_bus.yml."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

from bowden.drive.client import Drive
from bowden.drive.dictionary import TABLE
from bowden_rig.virtual_bus import VirtualBus
from ruamel.yaml import YAML

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
BUS = Path(__file__).parents[3] / "docs" / "examples" / "ros2_bus.yml"


class Master:
    """Does what the bus configuration tells a master to do, and no more."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        content = YAML(typ="safe").load(BUS.read_text(encoding="utf-8"))
        self.master, self.wrist = content["master"], content["wrist"]
        assert self.wrist["node_id"] == drive.node_id

    def boot(self) -> None:
        write = self.drive.write_raw
        write("producer_heartbeat", self.wrist["heartbeat_producer"])
        for number, pdo in self.wrist["tpdo"].items():
            name = f"tpdo{number}_communication"
            cob_id = self.drive.read_raw(f"{name}.cob_id")
            write(f"{name}.cob_id", cob_id | 1 << 31)
            write(f"{name}.event_timer", pdo["event_timer"])
            write(f"{name}.cob_id", cob_id & ~(1 << 31))
        for one in self.wrist["sdo"]:
            entry = TABLE.at(one["index"], one["sub_index"])
            assert entry is not None
            write(entry.name, one["value"])
        self.drive.nmt("OPERATIONAL")

    def rpdo(self, controlword: int, mode: int, torque_unm: int = 0) -> None:
        data = struct.pack("<Hb", controlword, mode) + torque_unm.to_bytes(3, "little", signed=True)
        self.drive.connection.send(0x200 + self.drive.node_id, data)

    def run(self, duration_s: float) -> None:
        """Advance virtual time with the master's heartbeat."""
        connection = self.drive.connection
        end_s = connection.clock() + duration_s
        while connection.clock() < end_s:
            connection.send(0x700 + self.master["node_id"], b"\x05")
            connection.listen(self.master["heartbeat_producer"] / 1e3)


def test_the_tunnel_runs_and_opens_without_the_master(rig: MakeRig) -> None:
    drive, bus = rig()
    master = Master(drive)
    master.boot()
    for controlword in (0x06, 0x07, 0x0F):
        master.rpdo(controlword, -1)
        master.run(0.1)
    assert bus.bench.actuators.bridge_enabled
    assert drive.read_raw("mode_of_operation_display") == -1
    assert drive.read_raw("tpdo1_communication.event_timer") == 10
    master.run(1.5)  # longer than the heartbeat's time: it is heard
    assert bus.bench.actuators.bridge_enabled
    bus.advance(1.2)  # the master is gone
    assert not bus.bench.actuators.bridge_enabled


def test_torque_and_a_stop(rig: MakeRig) -> None:
    drive, bus = rig(motion="locked")
    master = Master(drive)
    master.boot()
    for controlword in (0x06, 0x07, 0x0F):
        master.rpdo(controlword, -2)
        master.run(0.1)
    master.rpdo(0x0F, -2, torque_unm=50_000)
    master.run(0.3)
    assert abs(drive.read("motor_torque") - 0.05) < 5e-3
    master.rpdo(0x02, -2)  # quick stop
    master.run(0.2)
    assert not bus.bench.actuators.bridge_enabled
