"""Switching bridges off from outside: any CiA 402 node, whatever its dictionary or state.

NMT pre-operational first, which needs no answer and takes the torque from a bowden drive at once;
then controlword 0 to each node, and its statusword as the proof.
"""

from __future__ import annotations

from dataclasses import dataclass

from bowden.drive.client import Drive
from bowden.drive.connection import HOST_NODE_ID, Connection
from bowden.drive.power import BRIDGE_ON, power_state
from bowden.errors import DriveFailed

_PRE_OPERATIONAL = 128
_ALL_NODES = 0
_TAKES_EFFECT_S = 0.01
_HEARTBEATS_S = 1.2  # longer than any sensible heartbeat period


@dataclass(frozen=True)
class Stopped:
    """A node after the stop.

    Parameters
    ----------
    node_id : int
    power_state : str or None
        CiA 402 state afterwards; None when it does not report one.
    """

    node_id: int
    power_state: str | None

    @property
    def confirmed(self) -> bool:
        """Return whether the node has confirmed that its bridge is off."""
        return self.power_state is not None and self.power_state not in BRIDGE_ON


def stop_node(connection: Connection, node_id: int) -> Stopped:
    """Switch the bridge of one node off; BadInput for an id that no node has.

    Raises
    ------
    DriveFailed
        The adapter cannot send.
    """
    drive = Drive(connection, node_id)
    connection.send(0, bytes((_PRE_OPERATIONAL, node_id)))
    return _confirm(drive)


def stop_all(connection: Connection) -> list[Stopped]:
    """Switch off the bridges of all nodes; those that are heard are asked for their state.

    Raises
    ------
    DriveFailed
        The adapter cannot send.
    """
    connection.send(0, bytes((_PRE_OPERATIONAL, _ALL_NODES)))
    connection.listen(_HEARTBEATS_S)
    heard = [node_id for node_id in connection.nodes_heard if node_id != HOST_NODE_ID]
    return [_confirm(Drive(connection, node_id)) for node_id in heard]


def _confirm(drive: Drive) -> Stopped:
    try:
        drive.write_raw("controlword", 0)
        drive.connection.listen(_TAKES_EFFECT_S)
        return Stopped(drive.node_id, power_state(drive.read_raw("statusword")))
    except DriveFailed:
        return Stopped(drive.node_id, None)
