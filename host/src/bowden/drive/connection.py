"""The bus: how it is opened, who reads it, and what time it is there.

Everything of `bowden.drive` talks through one `Connection`. On a real bus a thread of its own does
nothing but read, so that no frame waits while the rest of the program computes; what it reads goes
to `tap` (the recorder) at once and into a queue. All other work happens in the caller's thread,
inside `receive`: nothing else needs a lock. With ``threaded=False`` frames are read in `receive`
itself and `clock` may be a simulated one: tests run in virtual time.
"""

from __future__ import annotations

import logging
import os
import queue
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

import can
import canopen

from bowden.errors import DriveFailed

#: Node id under which the host sends its heartbeat.
HOST_NODE_ID = 127
HEARTBEAT_PERIOD_S = 0.05
#: COB-IDs that only a node itself sends: EMCY, four TPDOs, SDO answers, heartbeat.
_TPDOS = (0x180, 0x280, 0x380, 0x480)
_FROM_NODE = (0x080, *_TPDOS, 0x580, 0x700)
_RECEIVE_BUFFER_BYTES = 64 << 20  # used only while frames wait to be read
_KERNEL_BYTES_PER_FRAME = 840  # what Linux counts for a waiting frame, measured
_SO_RCVBUFFORCE = 33  # Linux; beyond the system's limit, for root only
_READER_POLL_S = 0.1
_BATCH_S = 20e-3
_SHORTEST_WAIT_S = 1e-3  # waiting has to let time pass, also where time comes in steps

# Both report through exceptions here; without a handler Python would print their log lines too.
logging.getLogger("can").addHandler(logging.NullHandler())
logging.getLogger("canopen").addHandler(logging.NullHandler())


@dataclass(frozen=True)
class TimeLimits:
    """How long a drive may take before it counts as not answering, s.

    The defaults fit a drive, which has a processor of its own. A simulated rig shares this machine,
    which may give it no time for seconds.

    Parameters
    ----------
    answer_s : float, s
        For each answer of an SDO transfer.
    state_s : float, s
        For each change of the power state.
    silence_s : float, s
        Without any frame of the drive.
    """

    answer_s: float = 0.5
    state_s: float = 1.0
    silence_s: float = 1.0


#: For a simulated rig on this machine, which may be thirty times overloaded.
SHARED_MACHINE = TimeLimits(answer_s=15.0, state_s=30.0, silence_s=30.0)


class Connection:
    """One open bus.

    Parameters
    ----------
    bus : can.BusABC
        Owned from now on, shut down by `close`.
    adapter : dict of str to str
        How it was opened, for the record.
    clock : callable
        Seconds, increasing; the time in which waiting is measured.
    threaded : bool
        Read the bus in a thread of its own (True), or only when `receive` is called.
    limits : TimeLimits
        Of the drives on this bus.

    Attributes
    ----------
    network : canopen.Network
        The `canopen` package's side of the bus: it sends, and gets every frame received.
    tap : callable or None
        Gets every frame first, in the reading thread; see `set_tap`.
    """

    def __init__(
        self,
        bus: can.BusABC,
        *,
        adapter: dict[str, str] | None = None,
        clock: Callable[[], float] = time.monotonic,
        threaded: bool = True,
        limits: TimeLimits | None = None,
    ) -> None:
        self.bus = bus
        self.adapter = adapter or {}
        self.clock = clock
        self.limits = limits or TimeLimits()
        self.network = canopen.Network(bus)
        self._heard: dict[int, float] = {}
        self._errors = 0
        self._next_beat: float | None = None
        self._tap: Callable[[can.Message], None] | None = None
        #: Each gets every frame that `receive` handles, in the caller's thread.
        self.observers: list[Callable[[can.Message], None]] = []
        self._no_answer_due = False
        self._tap_lock = threading.Lock()
        self._frames: queue.SimpleQueue[can.Message | BaseException] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._reader = threading.Thread(target=self._read, name="bowden bus", daemon=True)
        self._threaded = threaded
        #: The kernel (or a server) takes each frame's time, whenever it is read.
        self.receive_buffer_frames = enlarge_receive_buffer(bus)
        self._is_socket = self.receive_buffer_frames is not None
        if threaded:
            self._reader.start()

    def close(self) -> None:
        """Stop reading and shut the bus down."""
        self._stop.set()
        if self._reader.is_alive():
            self._reader.join()
        self.bus.shutdown()

    def __enter__(self) -> Connection:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self.close()

    def set_tap(self, tap: Callable[[can.Message], None] | None) -> None:
        """Give every frame from now on to `tap`, in the reading thread; None ends that.

        When this returns, the previous tap is not running and will not be called again.
        """
        with self._tap_lock:
            self._tap = tap

    def send(self, cob_id: int, data: bytes) -> None:
        """Send one frame.

        Raises
        ------
        DriveFailed
            The adapter did not take it.
        """
        try:
            self.network.send_message(cob_id, data)
        except (can.CanError, OSError) as error:
            raise DriveFailed(
                f"the CAN adapter cannot send ({error}): is another node there to acknowledge, "
                "are bit rate and termination right?"
            ) from error

    def send_frame(self, frame: can.Message) -> None:
        """Send a frame as it is, also an extended one; DriveFailed as in `send`."""
        try:
            self.bus.send(frame)
        except (can.CanError, OSError) as error:
            raise DriveFailed(f"the CAN adapter cannot send ({error})") from error

    def receive(self, timeout_s: float) -> can.Message | None:
        """Handle the next frame, or return None after at most `timeout_s`.

        Raises
        ------
        DriveFailed
            The adapter failed.
        """
        frame = self._next(self._beat(timeout_s))
        if frame is not None:
            self._handle(frame)
        return frame

    def _handle(self, frame: can.Message) -> None:
        if frame.is_error_frame:
            self._errors += 1
            return
        service, node_id = frame.arbitration_id & 0x780, frame.arbitration_id & 0x7F
        if service in _FROM_NODE and node_id:
            self._heard[node_id] = self.clock()
        for observe in self.observers:
            observe(frame)
        if service not in _TPDOS and not frame.is_remote_frame:  # nothing of canopen takes those
            self.network.notify(frame.arbitration_id, frame.data, frame.timestamp)

    def wait_for(self, happened: Callable[[], bool], timeout_s: float) -> bool:
        """Handle frames until `happened()`; return whether it did within `timeout_s`."""
        deadline = self.clock() + timeout_s
        while not happened():
            remaining = deadline - self.clock()
            if remaining <= 0:
                return False
            self.receive(max(remaining, _SHORTEST_WAIT_S))
        return True

    def listen(self, duration_s: float) -> None:
        """Handle frames for a while."""
        self.wait_for(lambda: False, duration_s)

    def handle_for(self, duration_s: float, is_done: Callable[[], bool] | None = None) -> None:
        """Handle frames for a while, those of some milliseconds at a time.

        At 3000 frames/s, waking up for each costs more than handling it.

        Parameters
        ----------
        duration_s : float, s
        is_done : callable, optional
            Asked after each frame; ends it early. What has come by then is handled later.

        Raises
        ------
        DriveFailed
            The adapter failed.
        """
        end = self.clock() + duration_s
        self._no_answer_due = True
        try:
            while (left := end - self.clock()) > 0:
                if not self._threaded:
                    self.receive(max(left, _SHORTEST_WAIT_S))
                    if is_done is not None and is_done():
                        return
                    continue
                self._beat(0.0)
                time.sleep(min(left, _BATCH_S))
                for _ in range(self._frames.qsize()):
                    if (frame := self._next(0.0)) is not None:
                        self._handle(frame)
                    if is_done is not None and is_done():
                        return
        finally:
            self._no_answer_due = False

    def silence_s(self, node_id: int) -> float:
        """Return how long nothing has come from a node; infinite when it was never heard."""
        return self.clock() - self._heard.get(node_id, -float("inf"))

    @property
    def nodes_heard(self) -> list[int]:
        """Ids of the nodes from which anything came."""
        return sorted(self._heard)

    @property
    def error_frames(self) -> int:
        """Number of error frames that the adapter reported."""
        return self._errors

    def start_heartbeat(self) -> None:
        """Send the host's heartbeat from now on, from inside `receive`.

        Not from a thread: it must stop when the program that watches the drive hangs.
        """
        self._next_beat = self.clock()

    def stop_heartbeat(self) -> None:
        """Send no more heartbeats."""
        self._next_beat = None

    def _beat(self, timeout_s: float) -> float:
        """Send the heartbeat if it is due; return for how long one may then wait for a frame."""
        if self._next_beat is None:
            return timeout_s
        now = self.clock()
        if now >= self._next_beat:
            self.send(0x700 + HOST_NODE_ID, b"\x05")
            self._next_beat = now + HEARTBEAT_PERIOD_S
        return min(timeout_s, max(self._next_beat - now, _SHORTEST_WAIT_S))

    def _next(self, timeout_s: float) -> can.Message | None:
        frame: can.Message | BaseException | None
        try:
            if self._threaded:
                frame = self._frames.get(timeout=max(timeout_s, 0.0))
            else:
                frame = self._recv(timeout_s)
        except queue.Empty:
            return None
        except (can.CanError, OSError) as error:
            frame = error
        if isinstance(frame, can.CanError | OSError):
            self._frames.put(frame)  # the reader has ended; every later call must fail as well
            raise DriveFailed(f"the CAN adapter or the capture failed: {frame}") from frame
        if isinstance(frame, BaseException):
            raise frame
        return frame

    def _recv(self, timeout_s: float) -> can.Message | None:
        frame = self.bus.recv(timeout_s)
        if frame is not None:
            with self._tap_lock:
                if self._tap is not None:
                    self._tap(frame)
        return frame

    def _read(self) -> None:
        """Body of the reading thread.

        It wakes up for each frame where an answer is waited for, or where a recorder listens to an
        adapter that takes a frame's time only now; else once for all that have come meanwhile.
        """
        try:
            while not self._stop.is_set():
                in_batches = self._no_answer_due and (self._tap is None or self._is_socket)
                frame = self._recv(0.0 if in_batches else _READER_POLL_S)
                if frame is not None:
                    self._frames.put(frame)
                elif in_batches:
                    time.sleep(_BATCH_S)
        except Exception as error:  # noqa: BLE001  (whatever it is, `receive` raises it)
            self._frames.put(error)


def enlarge_receive_buffer(bus: can.BusABC) -> int | None:
    """Let the kernel hold seconds of frames, where the bus is a socket.

    Returns
    -------
    int or None
        How many frames it holds while they wait to be read; None where the bus is no socket: its
        adapter's driver has buffers of its own.
    """
    try:
        with socket.socket(fileno=os.dup(bus.fileno())) as handle:
            try:
                handle.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BUFFER_BYTES)
            except OSError:
                handle.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
            # Linux reports twice of what was set, for its own bookkeeping of each frame.
            granted = handle.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2
            return granted // _KERNEL_BYTES_PER_FRAME
    except (OSError, NotImplementedError, AttributeError):
        return None
