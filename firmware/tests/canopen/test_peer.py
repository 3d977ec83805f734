"""The `canopen` package as the peer: its SDO client, PDO and NMT classes against our node.

Lock-step and in process: what the client sends is answered before `send_message` returns.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import canopen
import pytest

GENERATED = Path(__file__).resolve().parents[3] / "shared" / "generated"
EDS = GENERATED / "bowden.eds"
WITH_UNITS = GENERATED / "bowden-si.eds"


class DirectNetwork(canopen.Network):
    def __init__(self, node: Any) -> None:
        super().__init__()
        self.drive = node

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert not remote
        self.drive.send(can_id, bytes(data))
        self.pump()
        if can_id == 0x610:  # segments of a block upload go out with time
            self.settle()

    def settle(self) -> None:
        for _ in range(200):
            self.drive.tick()
            self.pump()

    def pump(self) -> None:
        for cob_id, data in self.drive.frames():
            self.notify(cob_id, bytearray(data), self.drive.now_us * 1e-6)


@pytest.fixture
def remote(node: Any) -> canopen.RemoteNode:
    network = DirectNetwork(node)
    return network.add_node(16, str(EDS))


def test_reads_numbers_text_and_records(remote: canopen.RemoteNode) -> None:
    assert remote.sdo["device_type"].raw == 0x20192
    assert remote.sdo["device_name"].raw == "bowden drive"  # segmented
    assert remote.sdo["identity"]["product_code"].raw == 0x0B0DE4
    assert remote.sdo["segment_length"][40].raw == 100_000
    assert remote.sdo["target_torque"].raw == 0


def test_reads_back_every_default_of_the_eds(remote: canopen.RemoteNode) -> None:
    compared = 0
    for variable in _variables(remote.object_dictionary):
        if variable.index == 0x1003 and variable.subindex > 0:
            continue
        data = remote.sdo.upload(variable.index, variable.subindex)
        is_domain = variable.data_type == canopen.objectdictionary.DOMAIN
        default = bytes(148) if is_domain else variable.default
        assert variable.decode_raw(data) == default, variable.name
        compared += 1
    assert compared > 200


def _variables(dictionary: canopen.ObjectDictionary) -> list[Any]:
    found: list[Any] = []
    for obj in dictionary.values():
        found += [obj] if isinstance(obj, canopen.objectdictionary.ODVariable) else obj.values()
    return found


def test_writes_expedited_and_segmented(remote: canopen.RemoteNode, node: Any) -> None:
    remote.sdo["tunnel_stiffness"].raw = 1_234_567
    assert node.values.tunnel_stiffness_unm_per_rad == 1_234_567
    remote.sdo.download(0x2121, 0, (77).to_bytes(4, "little"), force_segment=True)
    assert node.values.tunnel_stiffness_unm_per_rad == 77
    remote.sdo["target_torque"].raw = -8_388_607
    assert node.values.target_torque_unm == -8_388_607


def test_with_the_other_eds_values_are_in_si(node: Any) -> None:
    drive = DirectNetwork(node).add_node(16, str(WITH_UNITS))
    drive.sdo["tunnel_stiffness"].phys = 0.75  # N m/rad
    assert node.values.tunnel_stiffness_unm_per_rad == 750_000
    node.values.load_angle_urad = -1_234_567
    assert drive.sdo["load_angle"].phys == pytest.approx(-1.234567)
    assert drive.sdo["load_angle"].od.unit == "rad"
    assert drive.sdo["segment_length"][40].phys == pytest.approx(0.1)
    assert drive.sdo["quick_stop_time"].phys == pytest.approx(0.05)


def test_block_transfers_both_ways(remote: canopen.RemoteNode, node: Any) -> None:
    with remote.sdo.open(0x1008, 0, "rb", block_transfer=True) as stream:
        assert stream.read() == b"bowden drive"
    value = (77).to_bytes(4, "little")
    with remote.sdo.open(0x2121, 0, "wb", size=4, block_transfer=True) as stream:
        stream.write(value)
    assert node.values.tunnel_stiffness_unm_per_rad == 77


def test_aborts_arrive_as_such(remote: canopen.RemoteNode) -> None:
    with pytest.raises(canopen.SdoAbortedError) as caught:
        remote.sdo["motor_pulley_radius"].raw = 0
    assert caught.value.code == 0x06090032
    with pytest.raises(canopen.SdoAbortedError) as caught:
        remote.sdo.upload(0x1234, 0)
    assert caught.value.code == 0x06020000


def test_nmt_and_heartbeat(remote: canopen.RemoteNode, node: Any) -> None:
    remote.nmt.state = "OPERATIONAL"
    assert node.lib.node_state(node.node) == 5
    for _ in range(400):
        node.tick()
        remote.network.pump()
    assert remote.nmt.state == "OPERATIONAL"
    remote.nmt.state = "PRE-OPERATIONAL"
    assert node.lib.node_state(node.node) == 0x7F


def test_remaps_a_tpdo_with_its_own_procedure(remote: canopen.RemoteNode, node: Any) -> None:
    remote.tpdo.read()
    tpdo = remote.tpdo[3]
    assert [v.name for v in tpdo.map] == ["sample_counter_low", "load_angle", "load_torque"]
    tpdo.clear()
    tpdo.add_variable("sample_counter_low")
    tpdo.add_variable("conduit_temperature")
    tpdo.event_timer = 5
    tpdo.save()
    node.values.conduit_temperature_mdegc = -12_345
    remote.nmt.state = "OPERATIONAL"
    node.tick()
    remote.network.pump()
    assert tpdo["conduit_temperature"].raw == -12_345


def test_emergency_is_understood(remote: canopen.RemoteNode, node: Any) -> None:
    node.lib.node_error_set(node.node, 0x8130, 0x11, 42)
    node.tick()
    remote.network.pump()
    (error,) = remote.emcy.active
    assert (error.code, error.register, error.data) == (0x8130, 0x11, bytes([42, 0, 0, 0, 0]))
    node.lib.node_error_clear_all(node.node)
    node.run(20_000)
