"""A table written whole over the bus: kept over a restart, not torn, not mixed by two masters."""

from __future__ import annotations

import struct

import pytest
from bowden.drive.dictionary import lookup
from bowden.drive.meanings import TableDefect, TablePlace
from bowden.drive.table_layout import TableFields
from bowden_rig.target import SIMULATED_RIG
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.benches import Benches
from hil_tests.lockstep_host import NMT_RESET_NODE, LockstepHost, SdoAbort

pytestmark = pytest.mark.needs(SIMULATED_RIG)  # a real board's configuration must not be changed

Host = LockstepHost[VirtualBus]

STORE, SAVE = 0x1010, 0x65766173
TORQUE = -2
TABLE = lookup("table.2")
SIZE = TABLE.bits // 8


def friction(*values: int) -> int:
    return TableFields(TablePlace.FRICTION_FACTOR, 0, 0, 0, -10, 20, values).to_raw()


RISING, FALLING = friction(*range(33)), friction(*range(33, 0, -1))


def write(host: Host, raw: int) -> None:
    host.write(TABLE.index, TABLE.sub, raw, SIZE)


def kept(host: Host) -> int:
    return int.from_bytes(host.read_long(TABLE.index, TABLE.sub), "little")


def frames(raw: int) -> list[bytes]:
    """A segmented download."""
    data = raw.to_bytes(SIZE, "little")
    parts = [data[i : i + 7] for i in range(0, SIZE, 7)]
    begin = struct.pack("<BHBI", 0x21, TABLE.index, TABLE.sub, SIZE)
    heads = [n % 2 << 4 | (7 - len(p)) << 1 | (p is parts[-1]) for n, p in enumerate(parts)]
    return [begin, *(bytes([h]) + p.ljust(7, b"\0") for h, p in zip(heads, parts, strict=True))]


def send(host: Host, requests: list[bytes]) -> None:
    for request in requests:
        host._ask(TABLE.index, TABLE.sub, request)


def test_it_survives_a_restart_once_stored(benches: Benches) -> None:
    host = benches()
    write(host, RISING)
    assert kept(host) == RISING
    host.write(STORE, 1, SAVE, 4)
    write(host, FALLING)
    host.nmt(NMT_RESET_NODE)
    host.await_boot(2.0)
    host.listen(0.01)
    assert kept(host) == RISING


def test_a_torn_transfer_leaves_what_was_there(benches: Benches) -> None:
    host = benches()
    write(host, RISING)
    send(host, frames(FALLING)[:15])
    host.listen(1.1)  # the drive gives up after 1 s
    assert kept(host) == RISING
    write(host, FALLING)
    assert kept(host) == FALLING


def test_segments_of_two_masters_make_no_table(benches: Benches) -> None:
    host = benches()
    with pytest.raises(SdoAbort, match="06090030"):
        send(host, frames(RISING)[:9] + frames(FALLING)[9:])
    assert host.read(0x2161, 1) == bytes([TABLE.sub])
    assert host.read(0x2161, 2) == bytes([TableDefect.CHECKSUM])
    assert kept(host) == 0


def test_none_is_written_while_the_bridge_is_on(benches: Benches) -> None:
    host = benches()
    host.enable(TORQUE)
    with pytest.raises(SdoAbort, match="08000022"):
        write(host, RISING)
    host.disable()
    write(host, RISING)
    assert kept(host) == RISING
