"""One drive on the bus: its entries by name and in SI units, its NMT state, its emergencies.

`connect` opens the bus, finds the drive and checks that both sides mean the same dictionary.
Transfers go through the `canopen` package, one at a time, each answer matched to its request
(`transfers`). Reads are repeated when an answer is missing. So are writes of configuration and
calibration, after a look whether the value is there; a command that is sent twice could act twice.
When nothing answers, the error says what was received instead.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from canopen import SdoAbortedError, SdoCommunicationError

from bowden.drive.bus_options import BusOptions, open_connection
from bowden.drive.connection import Connection
from bowden.drive.dictionary import DEFAULT_NODE_ID, HASH, lookup
from bowden.drive.entry import Entry
from bowden.drive.entry_text import shown
from bowden.drive.faults import describe_abort
from bowden.drive.meanings import TableDefect
from bowden.drive.transfers import Transfers
from bowden.errors import BadInput, DriveFailed

_ATTEMPTS = 3
#: Roles of entries whose value may be written twice: writing them does nothing but set them.
_REPEATABLE = ("config", "calibration")
_HEARTBEAT_S = 0.5
_DIAGNOSIS_S = 1.2  # longer than any sensible heartbeat period
_NMT_COMMANDS = {"OPERATIONAL": 1, "STOPPED": 2, "PRE-OPERATIONAL": 128, "RESET": 129}
_NMT_STATES = {0: "BOOTING", 4: "STOPPED", 5: "OPERATIONAL", 127: "PRE-OPERATIONAL"}
_EMCY = struct.Struct("<HB5s")


class Drive:
    """A drive that answers under one node id.

    Parameters
    ----------
    connection : Connection
        The bus it is on.
    node_id : int
        1 .. 126.

    Attributes
    ----------
    nmt_state : str
        As last told by a heartbeat; ``UNKNOWN`` before the first.
    boots : int
        Boot-up messages seen: more than none means that the drive restarted.
    emergencies : list of int
        EMCY codes in order of arrival, "error reset" (code 0) left out.

    Raises
    ------
    BadInput
        A node id that CANopen does not have, or the host's own.
    """

    def __init__(self, connection: Connection, node_id: int = DEFAULT_NODE_ID) -> None:
        if not 1 <= node_id <= 126:
            raise BadInput("--node", str(node_id), "1 .. 126 (127 is this host)")
        self.connection = connection
        self.node_id = node_id
        network = connection.network
        self._sdo = Transfers(connection, node_id, connection.limits.answer_s)
        self._lock = threading.Lock()
        network.subscribe(0x580 + node_id, self._sdo.on_response)
        network.subscribe(0x700 + node_id, self._on_heartbeat)
        network.subscribe(0x080 + node_id, self._on_emergency)
        self.nmt_state = "UNKNOWN"
        self.boots = 0
        self.emergencies: list[int] = []

    def read(self, name: str) -> float:
        """Read an entry, in the unit of its dictionary entry (SI)."""
        return lookup(name).to_value(self.read_raw(name))

    def read_raw(self, name: str) -> int:
        """Read an entry as the integer that is on the wire."""
        return lookup(name).decode(self._upload(name))

    def read_text(self, name: str) -> str:
        """Read an entry that is text."""
        return lookup(name).decode_text(self._upload(name))

    def write(self, name: str, value: float) -> None:
        """Write an entry, in its unit; what does not fit its range is refused with `BadInput`."""
        self.write_raw(name, lookup(name).to_raw(value))

    def write_raw(self, name: str, raw: int) -> None:
        """Write an entry as an integer.

        When the answer is missing, a configuration or calibration value is read back, and written
        again where it is not there. A command is never repeated.

        Raises
        ------
        BadInput
            Out of the entry's range.
        DriveFailed
            Refused by the drive, or no answer.
        """
        entry = lookup(name)
        data = entry.encode(raw)
        with self._lock:
            for attempt in range(1, _ATTEMPTS + 1):
                try:
                    self._sdo.download(entry.index, entry.sub, data)
                    return
                except SdoAbortedError as error:
                    raise DriveFailed(
                        f"node {self.node_id} refuses {name} = {shown(entry, raw)}: "
                        f"{describe_abort(error)}{self._cause(entry)}"
                    ) from error
                except SdoCommunicationError as error:
                    if entry.role not in _REPEATABLE or attempt == _ATTEMPTS:
                        raise DriveFailed(self._diagnose(f"writing {name}", error)) from error
                if self._holds(entry, data):
                    return

    def nmt(self, command: str) -> None:
        """Send an NMT command: OPERATIONAL, PRE-OPERATIONAL, STOPPED or RESET."""
        self.connection.send(0, bytes((_NMT_COMMANDS[command], self.node_id)))

    def next_nmt_state(self) -> str:
        """Wait for the next heartbeat and return the state it tells; ``UNKNOWN`` if none comes."""
        self.nmt_state = "UNKNOWN"
        self.connection.wait_for(lambda: self.nmt_state != "UNKNOWN", _HEARTBEAT_S)
        return self.nmt_state

    def check_dictionary(self) -> None:
        """Refuse a drive whose object dictionary is not the one of this bowden.

        Raises
        ------
        DriveFailed
            Another dictionary, or no answer.
        """
        there = self.read_raw("dictionary_hash")
        if there != HASH:
            raise DriveFailed(
                f"node {self.node_id} has object dictionary {there:08X}h, this bowden has "
                f"{HASH:08X}h: flash the firmware of this version, or use --force at your own risk"
            )

    def _upload(self, name: str) -> bytes:
        entry = lookup(name)
        with self._lock:
            for attempt in range(1, _ATTEMPTS + 1):
                try:
                    return bytes(self._sdo.upload(entry.index, entry.sub))
                except SdoAbortedError as error:
                    raise DriveFailed(
                        f"node {self.node_id} does not give {name}: {describe_abort(error)}"
                    ) from error
                except SdoCommunicationError as error:
                    if attempt == _ATTEMPTS:
                        raise DriveFailed(self._diagnose(f"reading {name}", error)) from error
        raise AssertionError("unreachable")

    def _holds(self, entry: Entry, data: bytes) -> bool:
        """Return whether the drive has that value; False also where it does not answer."""
        if entry.access == "wo":
            return False
        try:
            return bytes(self._sdo.upload(entry.index, entry.sub)) == data
        except (SdoAbortedError, SdoCommunicationError):
            return False

    def _cause(self, entry: Entry) -> str:
        """Return why a table was refused, as far as the drive says."""
        cause = lookup("table_refused.defect")
        if entry.type != "domain":
            return ""
        try:
            raw = cause.decode(bytes(self._sdo.upload(cause.index, cause.sub)))
        except (SdoAbortedError, SdoCommunicationError):
            return ""
        return f": {TableDefect.describe(raw)}" if raw else ""

    def _on_heartbeat(self, _cob_id: int, data: bytearray, _timestamp: float) -> None:
        if len(data) == 1:
            self.boots += data[0] == 0
            self.nmt_state = _NMT_STATES.get(data[0] & 0x7F, "UNKNOWN")

    def _on_emergency(self, _cob_id: int, data: bytearray, _timestamp: float) -> None:
        if len(data) == _EMCY.size and (code := _EMCY.unpack(data)[0]):
            self.emergencies.append(code)

    def _diagnose(self, doing: str, error: SdoCommunicationError) -> str:
        """Return why there may be no answer, from what is heard on the bus."""
        if "No SDO response" not in str(error):
            return f"{doing} of node {self.node_id}: {error}"
        connection, node = self.connection, f"node {self.node_id}"
        connection.listen(_DIAGNOSIS_S)
        others = [n for n in connection.nodes_heard if n != self.node_id]
        if connection.silence_s(self.node_id) < _DIAGNOSIS_S:
            if self.nmt_state == "STOPPED":
                return f"{node} is there but NMT stopped, so it answers nothing: reset it"
            return (
                f"{node} is there (NMT {self.nmt_state.lower()}) but does not answer ({doing}): "
                "is another program talking to it? else reset it"
            )
        if others:
            return (
                f"{node} is not there; heard from node {', '.join(map(str, others))}: "
                "name it with --node"
            )
        if connection.error_frames:
            return (
                f"{node} does not answer and the bus reports errors: "
                "check bit rate, wiring and termination"
            )
        return (
            f"{node} does not answer and the bus is silent: is the drive on, are interface, "
            "channel and bit rate right? (`bowden rig` starts the simulated rig)"
        )


@contextmanager
def connect(
    options: BusOptions | None = None, node_id: int = DEFAULT_NODE_ID, *, force: bool = False
) -> Iterator[Drive]:
    """Open the bus and find the drive; the bus is shut down at the end of the ``with`` block.

    Parameters
    ----------
    options : BusOptions, optional
        The bus; by default the simulated rig's.
    node_id : int
        The drive's.
    force : bool
        Also work with a drive whose object dictionary is another one.

    Raises
    ------
    DriveFailed
        No bus, no drive, or another dictionary.
    """
    with open_connection(options or BusOptions()) as connection:
        drive = Drive(connection, node_id)
        if not force:
            drive.check_dictionary()
        yield drive
