"""Sampling by SYNC: all drives of a recording take their samples at the same moments.

Each drive samples in the control tick in which it receives a SYNC (CiA 301), so the samples of one
SYNC are at most one tick (250 us) apart, whatever the drives' clocks do. The host sends the SYNC:
the kernel where the adapter can (SocketCAN), else a thread. It only says when; a SYNC that comes
late delays that sample on all drives alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

import can

from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.entry import Layout
from bowden.errors import DriveFailed

EVERY_SYNC = 1
LAST_SYNC_TYPE = 240
_LAST_ANSWERS_S = 0.02  # after the last SYNC; a sample takes the drive a tick and the bus 1 ms


@contextmanager
def sampling_by_sync(drives: Sequence[Drive], layouts: Sequence[list[Layout]]) -> Iterator[None]:
    """Have every PDO of the drives sent at each SYNC inside the block, and as before after it.

    The drives are in pre-operational at its begin and its end. One that vanishes or restarts
    inside comes back with its stored transmission types.
    """
    before: list[tuple[Drive, dict[str, int]]] = []
    try:
        for drive, of_drive in zip(drives, layouts, strict=True):
            names = [f"{layout.name}_communication.transmission_type" for layout in of_drive]
            before.append((drive, {name: drive.read_raw(name) for name in names}))
            for name in names:
                drive.write_raw(name, EVERY_SYNC)
        yield
    finally:
        for drive, types in before:
            with suppress(DriveFailed):  # one that has vanished
                for name, raw in types.items():
                    drive.write_raw(name, raw)


@contextmanager
def sync_sent(connection: Connection, period_s: float) -> Iterator[None]:
    """Send SYNC inside the block; at its end the answers to the last one have come.

    Raises
    ------
    DriveFailed
        The adapter cannot send it.
    """
    producer = connection.network.sync
    try:
        producer.start(period_s)
    except (can.CanError, OSError) as error:
        raise DriveFailed(f"the CAN adapter cannot send SYNC ({error})") from error
    try:
        yield
    finally:
        producer.stop()  # type: ignore[no-untyped-call]
        with suppress(DriveFailed):
            connection.listen(_LAST_ANSWERS_S)


def require_ours(drives: Sequence[Drive], ours: Sequence[Drive]) -> None:
    """Refuse a drive that already sends samples for another program: its PDOs are not ours.

    Raises
    ------
    DriveFailed
        There is one.
    """
    if taken := [drive.node_id for drive in drives if drive not in ours]:
        raise DriveFailed(
            f"node {taken[0]} already sends samples for another program, so it cannot sample by "
            "SYNC: end that program, or record without --sync"
        )


def missing_sync_hint(drives: Sequence[Drive]) -> str:
    """Return what to do where a recording without SYNC failed and a drive waits for one.

    Empty where none does, or where the drive that failed does not answer.
    """
    with suppress(DriveFailed):
        for drive in drives:
            if drive.read_raw("tpdo1_communication.transmission_type") <= LAST_SYNC_TYPE:
                return (
                    f"; node {drive.node_id} samples by SYNC only (its PDO transmission type): "
                    "record with --sync, or restart the drive"
                )
    return ""
