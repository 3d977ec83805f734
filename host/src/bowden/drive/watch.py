"""Watches a recording: waits for its trigger, reports progress, decides when it ends.

Handles frames through the connection; stores nothing of them (the reading thread writes the
capture) and sends nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import can

from bowden.drive.follow import Follower
from bowden.errors import BadInput

_PROGRESS_S = 0.1
_STEP_S = 0.02


@dataclass(frozen=True)
class Span:
    """When a recording begins and ends.

    Parameters
    ----------
    duration_s : float or None, s
        By the drive's clock, from the trigger; None: until a `Stop` or Ctrl-C.
    start_on_motion_rad : float or None, rad
        Begin when an angle has moved by so much; None: at once.
    pre_trigger_s : float, s
        Keep so long before the trigger.
    stop_on_fault : bool
        End, as wanted, when the drive reports a fault (also one that is only listened to).

    Raises
    ------
    BadInput
        A time or an angle that makes no sense.
    """

    duration_s: float | None
    start_on_motion_rad: float | None = None
    pre_trigger_s: float = 0.0
    stop_on_fault: bool = False

    def __post_init__(self) -> None:
        if self.duration_s is not None and not 0 < self.duration_s < float("inf"):
            raise BadInput("--duration", f"{self.duration_s:g}", "seconds, more than 0")
        motion = self.start_on_motion_rad
        if motion is not None and not 0 < motion < float("inf"):
            raise BadInput("--start-on-motion", f"{motion:g}", "rad, more than 0")
        if not 0 <= self.pre_trigger_s < float("inf"):
            raise BadInput("--pre-trigger", f"{self.pre_trigger_s:g}", "seconds, 0 or more")
        if self.pre_trigger_s and motion is None:
            raise BadInput("--pre-trigger", "no trigger", "--start-on-motion with it")


@dataclass(frozen=True)
class Progress:
    """How far a recording is; `lost` is what the counters show so far, all PDOs together."""

    elapsed_s: float
    samples: int
    lost: int
    rate_hz: float
    waiting: bool = False


@dataclass(frozen=True)
class SetMark:
    """Request to mark this moment."""

    text: str


@dataclass(frozen=True)
class Stop:
    """Request to end the recording; it is then complete, not cut."""


Request = SetMark | Stop


class Store(Protocol):
    """What the watch needs of the capture's writer."""

    failure: str | None

    def mark(self, text: str, device_time_us: int, host_time_s: float) -> None:
        """Keep a mark at a time of the drive's clock."""


class Watch:
    """Handles the frames of one recording.

    Parameters
    ----------
    followers : sequence of Follower
        One a drive, at least one, all on one bus; the first one's clock is the recording's.
    store : Store
        Gets the marks, and says when it cannot write any more.
    on_progress : callable, optional
        Called about ten times a second.
    requests : callable, optional
        Polled as often for requests: marks, an end.
    during : sequence of callable
        Called after every frame, once the recording has begun, with its time in s.
    """

    def __init__(
        self,
        followers: Sequence[Follower],
        store: Store,
        on_progress: Callable[[Progress], None] | None = None,
        requests: Callable[[], Iterable[Request]] | None = None,
        during: Sequence[Callable[[float], None]] = (),
    ) -> None:
        self._followers = followers
        self._first = followers[0]
        self._connection = self._first.drive.connection
        self._store = store
        self._on_progress = on_progress
        self._requests = requests
        self._during = during
        self._next_progress = self._connection.clock()

    def wait_for_motion(self, motion_rad: float, is_powered: bool) -> str | None:
        """Handle frames until an angle has moved; return which, or None when asked to stop.

        Raises
        ------
        DriveFailed
            A drive failed, restarted, vanished or sends no samples.
        """
        self._begin()

        def moved() -> str | None:
            every = (follower.moved(motion_rad) for follower in self._followers)
            return next(filter(None, every), None)

        with self._counting():
            while not self._step(is_powered, lambda: moved() is not None, waiting=True):
                if found := moved():
                    return found
        return None

    def run(self, span: Span, is_powered: bool) -> str | None:
        """Handle frames until the time is over or a request ends it.

        Returns
        -------
        str or None
            What ended it, where that was not the time.

        Raises
        ------
        DriveFailed
            A drive failed, restarted or vanished.
        BadInput
            The capture cannot be written any more.
        """
        self._begin()
        end_us = float("inf") if span.duration_s is None else span.duration_s * 1e6
        ended = None

        def is_over() -> bool:
            return self._first.elapsed_us >= end_us

        with self._counting():
            while ended is None and not is_over():
                if self._step(is_powered, is_over):
                    ended = "stopped by the user"
                elif span.stop_on_fault:
                    faults = (follower.new_fault() for follower in self._followers)
                    ended = next((f"fault: {fault}" for fault in faults if fault), None)
        self._tell(waiting=False)
        return ended

    def _begin(self) -> None:
        self._next_progress = self._connection.clock()
        for follower in self._followers:
            follower.begin()

    @contextmanager
    def _counting(self) -> Iterator[None]:
        """Let the followers count every frame that is handled."""

        def count(frame: can.Message) -> None:
            for follower in self._followers:
                follower.count(frame)

        self._connection.observers.append(count)
        try:
            yield
        finally:
            self._connection.observers.remove(count)

    def _step(self, is_powered: bool, is_done: Callable[[], bool], waiting: bool = False) -> bool:
        """Handle frames for a moment and what is due; return whether an end was requested."""
        if self._during:
            self._connection.receive(_PROGRESS_S)
        else:
            self._connection.handle_for(_STEP_S, is_done)
        for follower in self._followers:
            follower.check(is_powered)
        if not waiting and self._first.last is not None:
            for act in self._during:
                act(self._first.elapsed_us / 1e6)
        if self._store.failure is not None:
            raise BadInput("capture", self._store.failure, "a disk with room")
        if self._connection.clock() < self._next_progress:
            return False
        self._next_progress = self._connection.clock() + _PROGRESS_S
        self._tell(waiting)
        return self._obey()

    def _obey(self) -> bool:
        """Carry out the requests; return whether one is an end."""
        stop = False
        for request in self._requests() if self._requests else ():
            if isinstance(request, Stop):
                stop = True
            elif self._first.last is not None:
                at_us, host_s = self._first.last["device_time"], self._first.last_host_s
                self._store.mark(request.text, at_us, host_s)
        return stop

    def _tell(self, waiting: bool) -> None:
        if self._on_progress is None:
            return
        elapsed_s = self._first.elapsed_us / 1e6
        samples = self._first.samples
        rate_hz = samples / elapsed_s if elapsed_s else 0.0
        lost = sum(follower.lost for follower in self._followers)
        self._on_progress(Progress(elapsed_s, samples, lost, rate_hz, waiting))
