"""A recording sent onto a bus as its drives sent it, so that every tool can run on it as if live.

Frames go out in the recorded rhythm. SDO requests are answered from the dictionary's defaults and
what the capture says of the PDOs (the `canopen` package's local node serves them); nothing can be
written. A recording without raw frames (CSV) is encoded into the default PDOs.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import can
import canopen
import numpy as np

from bowden.drive.connection import Connection
from bowden.drive.dcf import eds
from bowden.drive.dictionary import HASH, TPDOS, lookup
from bowden.drive.entry import Layout
from bowden.errors import BadInput, DriveFailed
from bowden.recording.blf import read_frames
from bowden.recording.capture_file import capture_caveats
from bowden.recording.channels import TIME, name_with_unit
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden.recording.side_file import OtherDrive, PdoLayout, SideFile, read_side_file
from bowden.recording.source_bytes import starts_with

_LOG = logging.getLogger(__name__)
_OPERATIONAL = b"\x05"
_HEARTBEAT_S = 0.05
_TAKEN_S = 0.3
_LISTEN_S = 0.05
#: Services of a node that are sent again: EMCY, TPDOs. Heartbeats and SDO answers are made anew.
_RECORDED = (0x080, 0x180, 0x280, 0x380, 0x480)
_ABORT_READ_ONLY = 0x06010002
_PDO_DOES_NOT_EXIST = 1 << 31
_SWITCH_ON_DISABLED = 0x40


@dataclass(frozen=True)
class ReplayedNode:
    """One node of the recording: what it answers.

    Parameters
    ----------
    node_id : int
    values : dict of str to int
        Raw values by entry name, where they differ from the dictionary's defaults.
    """

    node_id: int
    values: dict[str, int]


class Replay:
    """Sends the frames of a recording and answers for its nodes.

    Parameters
    ----------
    connection : Connection
        The bus.
    nodes : sequence of ReplayedNode
    frames : iterable of can.Message
        In order of their timestamps, s.
    speed : float
        Recorded seconds a second.

    Attributes
    ----------
    sent : int
        Frames of the recording sent so far.
    """

    def __init__(
        self,
        connection: Connection,
        nodes: Sequence[ReplayedNode],
        frames: Iterable[can.Message],
        speed: float = 1.0,
    ) -> None:
        self.connection = connection
        self.sent = 0
        self._nodes = nodes
        self._frames = iter(frames)
        self._next = next(self._frames, None)
        self._first_s = self._next.timestamp if self._next else 0.0
        self._speed = speed
        self._start_s = self._next_beat_s = connection.clock()
        for node in nodes:
            connection.network.add_node(_local_node(node))

    @property
    def done(self) -> bool:
        """Return whether every frame has been sent."""
        return self._next is None

    def run(self, on_turn: Callable[[int], None] | None = None) -> None:
        """Send everything in its rhythm; `on_turn` gets the number of frames sent so far."""
        while not self.done:
            self.turn(_LISTEN_S)
            if on_turn is not None:
                on_turn(self.sent)

    def turn(self, longest_s: float) -> None:
        """Send what is due, then handle requests until the next is, or for at most so long."""
        connection = self.connection
        now = connection.clock()
        if now >= self._next_beat_s:
            self._next_beat_s = now + _HEARTBEAT_S
            for node in self._nodes:
                connection.send(0x700 + node.node_id, _OPERATIONAL)
        while self._next is not None and (due_s := self._due_s()) <= now:
            connection.send_frame(self._next)
            self.sent += 1
            self._next = next(self._frames, None)
        due_s = self._next_beat_s if self._next is None else min(self._due_s(), self._next_beat_s)
        connection.receive(min(max(due_s - now, 0.0), longest_s))

    def _due_s(self) -> float:
        assert self._next is not None
        return self._start_s + (self._next.timestamp - self._first_s) / self._speed


def read_replay(path: Path) -> tuple[list[ReplayedNode], Iterator[can.Message]]:
    """Read the answers of a recording's nodes, and the frames to send.

    A recording that was cut, or is in doubt, is read with a warning, as by `read_recording`.

    Raises
    ------
    BadInput
        What `read_recording` raises; a CSV whose values no drive could send.
    """
    if starts_with(path, b"LOGG", "a recording (.csv or .blf, also .gz)"):
        side = read_side_file(path)
        for caveat in capture_caveats(path, side):
            _LOG.warning("%s: %s", path, caveat)
        drives: list[SideFile | OtherDrive] = [side, *side.others]
        nodes = [ReplayedNode(one.node_id, _answers(one)) for one in drives]
        sent = {service + one.node_id for service in _RECORDED for one in drives}
        sent |= {pdo.cob_id for one in drives for pdo in one.pdos}
        foreign = {(one.cob_id, one.extended) for one in side.foreign}
        frames = (
            frame
            for frame in read_frames(path)
            if not frame.is_error_frame
            and (
                (frame.arbitration_id in sent and not frame.is_extended_id)
                or (frame.arbitration_id, frame.is_extended_id) in foreign
            )
        )
        return nodes, frames
    recording = read_recording(path)
    node_id = int(recording.metadata.get("node_id", "16"))
    layouts = _layouts_for(recording)
    period_s = float(np.median(np.diff(recording.time_s))) if recording.time_s.size > 1 else 1e-3
    node = ReplayedNode(node_id, _mapping(layouts, node_id, period_s))
    return [node], _encoded(recording, layouts, node_id)


def require_free(connection: Connection, nodes: Sequence[ReplayedNode]) -> None:
    """Refuse a bus on which a node of one of these ids is heard."""
    connection.listen(_TAKEN_S)
    taken = sorted({node.node_id for node in nodes} & set(connection.nodes_heard))
    if taken:
        raise DriveFailed(
            f"node {', '.join(map(str, taken))} is on this bus already: replay onto another bus "
            "(-i, -c), or stop it"
        )


def _local_node(node: ReplayedNode) -> Any:  # noqa: ANN401  (canopen is untyped)
    """Make a node that answers reads and refuses writes."""
    text = StringIO(eds())
    text.name = "bowden.eds"
    local: Any = canopen.LocalNode(node.node_id, canopen.import_od(text, node.node_id))
    for name, raw in {"dictionary_hash": HASH, **node.values}.items():
        entry = lookup(name)
        local.set_data(entry.index, entry.sub, entry.encode(raw), check_writable=False)

    def refuse(**_request: Any) -> None:  # noqa: ANN401
        raise canopen.SdoAbortedError(_ABORT_READ_ONLY)

    local.add_write_callback(refuse)
    return local


def _answers(side: SideFile | OtherDrive) -> dict[str, int]:
    """Return the PDO parameters that the capture was recorded with."""
    layouts = [Layout(pdo.name.lower(), pdo.cob_id, 0, tuple(_entries(pdo))) for pdo in side.pdos]
    period_s = side.sample_period_s
    values = _mapping(layouts, 0, period_s)
    return values | {"dictionary_hash": int(side.dictionary_hash.rstrip("h"), 16)}


def _entries(pdo: PdoLayout) -> Iterator[Any]:
    for field in pdo.fields:
        yield lookup(field.name)


def _mapping(layouts: Sequence[Layout], node_id: int, period_s: float) -> dict[str, int]:
    """Return the entries that say what the TPDOs carry."""
    values: dict[str, int] = {}
    by_name = {layout.name: layout for layout in layouts}
    for default in TPDOS:
        layout = by_name.get(default.name)
        cob_name = f"{default.name}_communication.cob_id"
        if layout is None:
            values[cob_name] = _PDO_DOES_NOT_EXIST | default.cob_id
            continue
        values[cob_name] = layout.cob_id + node_id
        values[f"{default.name}_mapping.count"] = len(layout.entries)
        for place, entry in enumerate(layout.entries, start=1):
            mapped = entry.index << 16 | entry.sub << 8 | entry.bits
            values[f"{default.name}_mapping.object_{place}"] = mapped
    values["tpdo1_communication.event_timer"] = max(round(period_s * 1e3), 1)
    return values


def _layouts_for(recording: Recording) -> list[Layout]:
    """Return the default TPDOs with those entries that the recording has channels for."""
    layouts = [TPDOS[0]]
    for default in TPDOS[1:]:
        low, *measured = default.entries
        there = [entry for entry in measured if _column(entry.name) in recording.channels]
        if there:
            layouts.append(Layout(default.name, default.cob_id, default.event_ms, (low, *there)))
    if len(layouts) == 1:
        recording.require(["motor_angle_rad"], "a replay")
    return layouts


def _column(name: str) -> str:
    return name_with_unit(name, lookup(name).unit)


def _encoded(
    recording: Recording, layouts: Sequence[Layout], node_id: int
) -> Iterator[can.Message]:
    status = recording.channels.get("status")
    columns = {
        entry.name: recording[_column(entry.name)]
        for layout in layouts[1:]
        for entry in layout.entries[1:]
    }
    raw_columns = {
        name: [lookup(name).to_raw(float(value), f"{recording.source}, {name}") for value in values]
        for name, values in columns.items()
    }
    for number, time_s in enumerate(recording[TIME].tolist()):
        raw = {name: values[number] for name, values in raw_columns.items()}
        raw |= {
            "sample_counter": number % (1 << 16),
            "sample_counter_low": number % (1 << 8),
            "device_time": round(time_s * 1e6) % (1 << 32),
            "statusword": _SWITCH_ON_DISABLED if status is None else int(status[number]) & 0xFFFF,
        }
        for layout in layouts:
            yield can.Message(
                arbitration_id=layout.cob_id + node_id,
                data=layout.encode(raw),
                is_extended_id=False,
                timestamp=time_s,
            )


def check_speed(speed: float) -> None:
    """Refuse a speed that is none."""
    if not 0 < speed < float("inf"):
        raise BadInput("--speed", f"{speed:g}", "recorded seconds a second, more than 0")
