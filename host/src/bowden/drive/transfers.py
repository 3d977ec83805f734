"""SDO transfers in which every answer is matched to its request, whatever the bus does to frames.

`canopen`'s SDO client takes the next frame from the drive for the answer. On a busy bus or host an
answer may come after its time-out, twice, or after a later one; taken for the answer of the next
request, it is an error at best and a wrong value at worst. Here an answer counts only if its
command, its index and sub-index, or its toggle bit are those that the request asks for (CiA 301,
section 7.2.4.3); every other frame is discarded and counted.

An SDO answer carries no number, so two answers for one entry look alike. After anything unexpected
the bus is therefore settled before the next entry is read: another entry is read until its own
answer comes. On a bus that keeps the order of frames no earlier answer can come after that. A write
never waits for that: the command that stops a drive goes out at once.
"""

from __future__ import annotations

import struct

from canopen import ObjectDictionary, SdoCommunicationError
from canopen.sdo.client import SdoClient

from bowden.drive.connection import Connection

_SETTLE_ATTEMPTS = 2
#: Entries read to settle the bus, both constant and mandatory in CiA 301: device type, vendor id.
_SETTLE_ENTRIES = ((0x1000, 0), (0x1018, 1))
_ABORT = 0x80
_MULTIPLEXER = struct.Struct("<xHB")
# Client command specifiers (bits 7 to 5 of byte 0) and the server's answer to each.
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT = 0, 1, 2, 3
_ANSWER = {_DOWNLOAD_SEGMENT: 1, _DOWNLOAD: 3, _UPLOAD: 2, _UPLOAD_SEGMENT: 0}
_TOGGLE = 0x10


class Transfers(SdoClient):
    """`canopen`'s SDO client for one node, waiting in the connection instead of on a thread.

    Parameters
    ----------
    connection : Connection
    node_id : int
        1 .. 126.
    answer_timeout_s : float, s
        For each answer.

    Attributes
    ----------
    discarded : int
        Answers that matched no request: late, repeated or out of order.
    """

    def __init__(self, connection: Connection, node_id: int, answer_timeout_s: float) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, ObjectDictionary())  # type: ignore[no-untyped-call]
        self.RESPONSE_TIMEOUT = answer_timeout_s
        self.discarded = 0
        self._connection = connection
        self._entry = (0, 0)
        self._is_settled = True

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take a frame from the drive; CiA 301 knows no answer of another length."""
        if len(data) == 8:
            super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]

    def send_request(self, request: bytearray) -> None:
        """Send one frame."""
        self._connection.send(self.rx_cobid, bytes(request))

    def read_response(self) -> bytes:
        """Wait for the next frame; SdoCommunicationError where none comes in time."""
        self._connection.wait_for(lambda: not self.responses.empty(), self.RESPONSE_TIMEOUT)
        if self.responses.empty():
            raise SdoCommunicationError("No SDO response received")
        response: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return response

    def request_response(self, sdo_request: bytearray) -> bytes:
        """Send a request and return the answer to it.

        Raises
        ------
        SdoAbortedError
            The drive refuses.
        SdoCommunicationError
            No answer to this request within the time-out. The transfer has been aborted.
        """
        command = sdo_request[0] >> 5
        if command in (_DOWNLOAD, _UPLOAD):
            self._entry = _MULTIPLEXER.unpack_from(sdo_request)
        if command == _UPLOAD and not self._is_settled:
            self._settle()
        self._discard_waiting()
        return self._exchange(sdo_request)

    def _exchange(self, request: bytearray) -> bytes:
        """Send, and wait until the answer to this request comes; discard what comes instead."""
        connection = self._connection
        self.send_request(request)
        deadline_s = connection.clock() + self.RESPONSE_TIMEOUT
        while True:
            remaining_s = deadline_s - connection.clock()
            if not connection.wait_for(lambda: not self.responses.empty(), max(remaining_s, 0.0)):
                self._is_settled = False
                self.abort()  # type: ignore[no-untyped-call]
                raise SdoCommunicationError("No SDO response received")
            if self._answers(self.responses.queue[0], request):
                return self.read_response()
            self.responses.get()
            self._note_unexpected()

    def _answers(self, response: bytes, request: bytearray) -> bool:
        command = request[0] >> 5
        if response[0] == _ABORT:
            return _MULTIPLEXER.unpack_from(response) == self._entry
        if command not in _ANSWER:
            return True  # block transfer: checked by its sequence numbers and CRC
        if response[0] >> 5 != _ANSWER[command]:
            return False
        if command in (_DOWNLOAD, _UPLOAD):
            return _MULTIPLEXER.unpack_from(response) == _MULTIPLEXER.unpack_from(request)
        return response[0] & _TOGGLE == request[0] & _TOGGLE

    def _settle(self) -> None:
        """Read another entry until its own answer comes: what was on its way before has come."""
        wanted = self._entry
        try:
            for attempt in range(1, _SETTLE_ATTEMPTS + 1):
                # Another entry than the wanted one, and each time another: a late answer to one
                # must not look like the next one's.
                others = [entry for entry in _SETTLE_ENTRIES if entry not in (wanted, self._entry)]
                self._entry = others[0]
                request = bytearray(8)
                struct.pack_into("<BHB", request, 0, _UPLOAD << 5, *self._entry)
                self._discard_waiting()
                try:
                    self._exchange(request)
                except SdoCommunicationError:
                    if attempt == _SETTLE_ATTEMPTS:
                        raise
                else:
                    self._is_settled = True
                    return
        finally:
            self._entry = wanted

    def _discard_waiting(self) -> None:
        while not self.responses.empty():
            self.responses.get()
            self._note_unexpected()

    def _note_unexpected(self) -> None:
        self.discarded += 1
        self._is_settled = False
