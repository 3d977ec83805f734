"""Finds the nodes on the bus: every node that sends a heartbeat or answers an SDO request.

Requests are paced, so that a slow adapter's queue does not overflow; all 127 ids take about a
second.
"""

from __future__ import annotations

from dataclasses import dataclass

from bowden.drive.client import Drive
from bowden.drive.connection import HOST_NODE_ID, Connection
from bowden.drive.dictionary import HASH
from bowden.drive.power import power_state
from bowden.errors import DriveFailed

_PACE_S = 0.005
_LAST_ANSWERS_S = 0.4
_READ_DEVICE_TYPE = bytes((0x40, 0x00, 0x10, 0, 0, 0, 0, 0))


@dataclass(frozen=True)
class Node:
    """A node on the bus.

    Parameters
    ----------
    node_id : int
        1 .. 126.
    nmt_state : str
        From its heartbeat, or ``UNKNOWN``.
    name, software_version : str or None
        As it tells them; None when it does not answer.
    serial_number : int or None
        As it tells it.
    dictionary_matches : bool or None
        Whether it has the object dictionary of this bowden; None when it is no bowden drive.
    power_state : str or None
        CiA 402 state; None when it does not tell one.
    """

    node_id: int
    nmt_state: str
    name: str | None
    software_version: str | None
    serial_number: int | None
    dictionary_matches: bool | None
    power_state: str | None = None


def scan(connection: Connection) -> list[Node]:
    """Send a request to every node id, and read the identity of those that answer.

    Raises
    ------
    DriveFailed
        The adapter failed.
    """
    drives = {node_id: Drive(connection, node_id) for node_id in range(1, HOST_NODE_ID)}
    for node_id in drives:
        connection.send(0x600 + node_id, _READ_DEVICE_TYPE)
        connection.listen(_PACE_S)
    connection.listen(_LAST_ANSWERS_S)
    return [_identify(drives[node_id]) for node_id in connection.nodes_heard if node_id in drives]


def _identify(drive: Drive) -> Node:
    try:
        name = drive.read_text("device_name")
        version = drive.read_text("software_version")
        serial = drive.read_raw("identity.serial_number")
    except DriveFailed:
        return Node(drive.node_id, drive.nmt_state, None, None, None, None)
    try:
        matches = drive.read_raw("dictionary_hash") == HASH
    except DriveFailed:
        matches = None
    return Node(drive.node_id, drive.nmt_state, name, version, serial, matches, _state(drive))


def _state(drive: Drive) -> str | None:
    try:
        return power_state(drive.read_raw("statusword"))
    except DriveFailed:
        return None
