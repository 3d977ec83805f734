"""Node id and bit rate by layer setting services (LSS, CiA 305): also where two nodes share an id.

A node is addressed by its identity (vendor, product, revision, serial number), not by its node id.
The protocol is `canopen`'s `LssMaster`; here it waits in the connection instead of on a thread.
"""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from canopen.lss import LssError, LssMaster

from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.dictionary import lookup
from bowden.errors import BadInput, DriveFailed

#: Place of each bit rate, kbit/s, in the standard table of CiA 305, as far as the drive has it.
BIT_RATES = {1000: 0, 500: 2, 250: 3, 125: 4}
_STORED_WITHIN_S = 2.5  # the largest configuration takes half a second; erasing for it two
_TAKEN_S = 0.3  # several heartbeat periods
_STARTS_WITHIN_S = 3.0
_RESET_NODE = 129
_REFUSED = 255


@dataclass(frozen=True)
class Identity:
    """Identity of a node (entry 1018h), unique in the world by its serial number.

    Parameters
    ----------
    vendor_number, product_code, revision, serial_number : int
        32 bits each.
    """

    vendor_number: int
    product_code: int
    revision: int
    serial_number: int


def identity_with(serial_number: int) -> Identity:
    """Return the identity of the drive of this bowden's kind with that serial number."""
    return Identity(
        int(lookup("identity.vendor_number").default),
        int(lookup("identity.product_code").default),
        int(lookup("identity.revision").default),
        serial_number,
    )


def identity_of(drive: Drive) -> Identity:
    """Read a drive's identity by its node id.

    Raises
    ------
    DriveFailed
        It does not answer.
    """
    return identity_with(drive.read_raw("identity.serial_number"))


def find_disputed(connection: Connection) -> list[Identity]:
    """Return the drives that have received frames of another node with their own id (fastscan).

    Raises
    ------
    DriveFailed
        The adapter failed.
    """
    found: list[Identity] = []
    with _master(connection) as master:
        while True:
            success, numbers = master.fast_scan()
            if not success:
                return found
            found.append(Identity(*numbers))  # it is configuring now and does not take part again


def require_free(connection: Connection, node_id: int) -> None:
    """Refuse a node id from which anything is heard.

    Raises
    ------
    BadInput
        That id is taken, or is none.
    """
    if not 1 <= node_id <= 126:
        raise BadInput("--set-id", str(node_id), "1 .. 126 (127 is this host)")
    connection.listen(_TAKEN_S)
    if node_id in connection.nodes_heard:
        raise BadInput("--set-id", str(node_id), "a node id from which nothing is heard")


def set_link(
    connection: Connection,
    identity: Identity,
    *,
    node_id: int | None = None,
    bit_rate_kbit: int | None = None,
) -> int:
    """Store node id, bit rate or both in one drive; they hold from its next start on.

    Parameters
    ----------
    connection : Connection
    identity : Identity
    node_id : int, optional
        1 .. 126.
    bit_rate_kbit : int, optional
        One of `BIT_RATES`.

    Returns
    -------
    int
        The node id that the drive has until then.

    Raises
    ------
    DriveFailed
        No such drive, its bridge is on, or it could not store.
    """
    with _master(connection) as master:
        try:
            master.send_switch_state_selective(
                identity.vendor_number,
                identity.product_code,
                identity.revision,
                identity.serial_number,
            )
        except LssError:
            raise DriveFailed(
                f"no drive with serial number {identity.serial_number:08X}h answers on this bus: "
                "`bowden scan` or `bowden node --find` lists those that are there"
            ) from None
        try:
            if node_id is not None:
                master.configure_node_id(node_id)
            if bit_rate_kbit is not None:
                master.configure_bit_timing(BIT_RATES[bit_rate_kbit])
            present = int(master.inquire_node_id())
            master.RESPONSE_TIMEOUT = max(_STORED_WITHIN_S, connection.limits.answer_s)
            master.store_configuration()
        except LssError as error:
            raise DriveFailed(
                f"the drive with serial number {identity.serial_number:08X}h has not taken it: "
                f"{_describe(error)}"
            ) from error
    return present


def restart_as(connection: Connection, before: int, node_id: int) -> Drive:
    """Reset the nodes of an id and wait until one starts under its new one.

    Raises
    ------
    DriveFailed
        None does.
    """
    drive = Drive(connection, node_id)
    connection.send(0, bytes((_RESET_NODE, before)))
    if not connection.wait_for(lambda: drive.boots > 0, _STARTS_WITHIN_S):
        raise DriveFailed(
            f"no node {node_id} within {_STARTS_WITHIN_S:g} s of the reset of node {before}: "
            "cut its power, then run `bowden scan`"
        )
    return drive


def _describe(error: LssError) -> str:
    if str(error) == f"LSS Error: {_REFUSED}":
        return "its bridge is on (`bowden stop`), or it is storing something else"
    return str(error)


class _Answers(queue.Queue[bytes]):
    """What the master waits for, while the connection handles frames."""

    def __init__(self, connection: Connection) -> None:
        super().__init__()
        self._connection = connection

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        if block:
            self._connection.wait_for(lambda: not self.empty(), timeout or 0.0)
        return super().get(block=False)


class _Master(LssMaster):
    """`canopen`'s master on a connection; drops what came before a request itself."""

    def __init__(self, connection: Connection) -> None:
        self._answers = _Answers(connection)
        super().__init__()
        self.network = connection.network
        self.RESPONSE_TIMEOUT = connection.limits.answer_s

    @property
    def responses(self) -> queue.Queue[bytes]:
        return self._answers

    @responses.setter
    def responses(self, _fresh: queue.Queue[bytes]) -> None:
        while not self._answers.empty():
            self._answers.get(block=False)


@contextmanager
def _master(connection: Connection) -> Iterator[Any]:
    """Lend a master; at the end every node waits again. `canopen` has no types for it."""
    master: Any = _Master(connection)
    connection.network.subscribe(master.LSS_RX_COBID, master.on_message_received)
    try:
        yield master
    finally:
        connection.network.unsubscribe(master.LSS_RX_COBID, master.on_message_received)
        master.send_switch_state_global(master.WAITING_STATE)
