"""Layer setting services (CiA 305) against the LSS master of the `canopen` package.

Two nodes on one bus, in lock-step: what the master sends is answered before `send_message` returns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import canopen
import canopen.lss as peer
import pytest

PRODUCT, REVISION = 0x0B0DE4, 0x00010000
SERIALS = (0x1234_5678, 0x9ABC_DEF1)
OLD_ID, NEW_ID = 16, 42
OD_DONE, HARDWARE = 0, 0x06060000


class Bus(canopen.Network):
    """Nodes that hear the master and each other."""

    def __init__(self, nodes: list[Any]) -> None:
        super().__init__()
        self.nodes = nodes
        self.lss.RESPONSE_TIMEOUT = 1e-3  # an answer is there at once or never
        self.stored: list[int] = []
        self.abort = OD_DONE

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert not remote
        for node in self.nodes:
            node.send(can_id, bytes(data))
            self.store(node)
        self.pump()

    def store(self, node: Any) -> None:
        """What the drive does with a request: storing, at once."""
        if node.node.storage.asked:
            node.node.storage.asked = False
            self.stored.append(node.node.storage.sub)
            node.lib.node_storage_done(node.node, self.abort)

    def pump(self) -> None:
        for node in self.nodes:
            for cob_id, data in node.frames():
                self.notify(cob_id, bytearray(data), node.now_us * 1e-6)
                for other in self.nodes:
                    if other is not node:
                        other.send(cob_id, data)


@pytest.fixture
def bus(make_node: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Bus:
    """Two nodes that differ in their serial numbers alone, boot-up messages still to be heard."""
    monkeypatch.setattr(peer.time, "sleep", lambda _s: None)
    nodes = [make_node(), make_node()]
    for node, serial in zip(nodes, SERIALS, strict=True):
        node.values.identity_serial_number = serial
    return Bus(nodes)


def select(bus: Bus, serial: int, product: int = PRODUCT) -> bool:
    try:
        return bool(bus.lss.send_switch_state_selective(0, product, REVISION, serial))
    except peer.LssError:  # no node has answered
        return False


def test_a_node_is_selected_by_its_whole_identity_and_tells_it(bus: Bus) -> None:
    lss = bus.lss
    assert not select(bus, SERIALS[0] ^ 1)
    assert not select(bus, SERIALS[0], product=PRODUCT + 1)
    assert select(bus, SERIALS[1])
    told = [
        lss.inquire_lss_address(number)
        for number in range(peer.CS_INQUIRE_VENDOR_ID, peer.CS_INQUIRE_SERIAL_NUMBER + 1)
    ]
    assert told == [0, PRODUCT, REVISION, SERIALS[1]]
    assert lss.inquire_node_id() == OLD_ID


def test_a_selected_node_alone_is_configured_and_stores(bus: Bus) -> None:
    first, second = bus.nodes
    assert select(bus, SERIALS[0])
    bus.lss.configure_node_id(NEW_ID)
    bus.lss.configure_bit_timing(2)
    bus.lss.store_configuration()
    assert (first.values.node_id, first.values.bit_rate) == (NEW_ID, 500)
    assert (second.values.node_id, second.values.bit_rate) == (OLD_ID, 1000)
    assert len(bus.stored) == 1
    assert bus.lss.inquire_node_id() == OLD_ID  # until the next start
    bus.lss.send_switch_state_global(bus.lss.WAITING_STATE)
    with pytest.raises(peer.LssError, match="No LSS response"):
        bus.lss.inquire_node_id()


@pytest.mark.parametrize("node_id", [0, 128, 255])
def test_a_node_id_that_does_not_exist_is_refused(bus: Bus, node_id: int) -> None:
    bus.lss.send_switch_state_global(bus.lss.CONFIGURATION_STATE)
    bus.nodes.pop()
    with pytest.raises(peer.LssError, match="Error: 1"):
        bus.lss.configure_node_id(node_id)
    assert bus.nodes[0].values.node_id == OLD_ID


@pytest.mark.parametrize(("place", "kbit"), [(0, 1000), (2, 500), (3, 250), (4, 125)])
def test_bit_rates_of_the_drive_are_taken(bus: Bus, place: int, kbit: int) -> None:
    assert select(bus, SERIALS[0])
    bus.nodes[0].values.bit_rate = 0
    bus.lss.configure_bit_timing(place)
    assert bus.nodes[0].values.bit_rate == kbit


@pytest.mark.parametrize("place", [1, 5, 6, 8, 255])
def test_others_are_refused(bus: Bus, place: int) -> None:
    assert select(bus, SERIALS[0])
    with pytest.raises(peer.LssError, match="Error: 1"):
        bus.lss.configure_bit_timing(place)
    assert bus.nodes[0].values.bit_rate == 1000


def test_nothing_is_changed_while_the_bridge_is_on(bus: Bus) -> None:
    assert select(bus, SERIALS[0])
    bus.nodes[0].node.od.config_locked = True
    for change in (
        lambda: bus.lss.configure_node_id(NEW_ID),
        lambda: bus.lss.configure_bit_timing(2),
        bus.lss.store_configuration,
    ):
        with pytest.raises(peer.LssError, match="Error: 255"):
            change()
    assert (bus.nodes[0].values.node_id, bus.stored) == (OLD_ID, [])


def test_a_store_that_fails_says_so(bus: Bus) -> None:
    assert select(bus, SERIALS[0])
    bus.abort = HARDWARE
    with pytest.raises(peer.LssError, match="Error: 2"):
        bus.lss.store_configuration()
    bus.abort = OD_DONE
    bus.lss.store_configuration()


def test_fastscan_finds_both_nodes_of_one_id_and_nobody_else(bus: Bus) -> None:
    assert bus.lss.fast_scan() == (False, None)  # who has an id of its own does not take part
    for node in bus.nodes:
        node.run(60_000)  # to the first heartbeat
        node.send(0x700 + OLD_ID, b"\x7f")
    found = []
    for _ in SERIALS:
        success, identity = bus.lss.fast_scan()
        assert success
        found.append(tuple(identity))
    assert sorted(found) == [(0, PRODUCT, REVISION, serial) for serial in sorted(SERIALS)]
    assert bus.lss.fast_scan() == (False, None)  # both are configuring
    assert [bool(node.node.lss.configuring) for node in bus.nodes] == [True, True]


def test_an_sdo_client_and_lss_do_not_store_at_once(bus: Bus) -> None:
    node = bus.nodes.pop(0)
    other = Bus([node])
    node.send(0x600 + OLD_ID, bytes.fromhex("2310100173617665"))  # save, not yet answered
    node.node.storage.asked = False  # the drive is at it
    assert select(other, SERIALS[0])
    with pytest.raises(peer.LssError, match="Error: 2"):
        other.lss.store_configuration()
    node.lib.node_storage_done(node.node, OD_DONE)
    assert [data for cob_id, data in node.frames() if cob_id == 0x580 + OLD_ID] != []


@pytest.mark.parametrize("data", [b"", b"\x04", b"\x04\x01", bytes(7), b"\xff" * 8])
def test_frames_that_are_none_of_the_services_do_nothing(bus: Bus, data: bytes) -> None:
    node = bus.nodes[0]
    node.frames()
    node.send(0x7E5, data)
    assert not node.node.lss.configuring
    assert node.frames() == []


def test_reset_communication_leaves_the_configuring_state(bus: Bus) -> None:
    assert select(bus, SERIALS[0])
    bus.nodes[0].nmt(0x82)
    assert not bus.nodes[0].node.lss.configuring


@pytest.mark.parametrize(
    ("kbit", "abort"), [(500, 0), (125, 0), (800, 0x06090030), (300, 0x06090030)]
)
def test_nobody_writes_a_bit_rate_that_the_node_does_not_have(
    node: Any, kbit: int, abort: int
) -> None:
    assert node.write_u(0x2013, 0, kbit, 2) == abort
    assert node.values.bit_rate == (1000 if abort else kbit)
