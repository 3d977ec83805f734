"""Recording a run: the drive's samples into a capture, watched, and stopped safely.

The reading thread writes the bus to the capture, frame by frame; `watch` begins the recording at
its trigger and ends it when its time is over or when the drive fails, restarts or vanishes. Then
the drive is stopped first, and the capture is closed all the same and says that it was cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from bowden.drive.client import Drive
from bowden.drive.faults import describe_emergency
from bowden.drive.follow import Follower
from bowden.drive.position_follower import command_sender
from bowden.drive.power import Run, powered, require_allowed_torque, require_unused
from bowden.drive.provenance import read_layouts, run_metadata, side_file
from bowden.drive.sync import missing_sync_hint, require_ours, sampling_by_sync, sync_sent
from bowden.drive.watch import Progress, Request, Span, Watch
from bowden.errors import BadInput, DriveFailed
from bowden.recording.capture_writer import CaptureWriter
from bowden.recording.decode import Decoded, nothing_decoded
from bowden.recording.side_file import ForeignSource, SideFile


@dataclass(frozen=True)
class Capture:
    """A recording that has ended: where it is, and its samples as read back from the file.

    Parameters
    ----------
    path : Path
        The ``.part`` where it could not be written to its end.
    side : SideFile
        `side.cut` says why it was cut.
    decoded : Decoded
        Empty without a sample.
    ended : str
        What ended it.
    """

    path: Path
    side: SideFile
    decoded: Decoded
    ended: str


def record(
    drive: Drive | Sequence[Drive],
    path: Path,
    span: Span | float,
    *,
    run: Run | None = None,
    metadata: Mapping[str, str] | None = None,
    foreign: Sequence[ForeignSource] = (),
    sync: bool = False,
    overwrite: bool = False,
    on_progress: Callable[[Progress], None] | None = None,
    requests: Callable[[], Iterable[Request]] | None = None,
    on_end: Callable[[Capture], None] | None = None,
) -> Capture:
    """Record one drive or several of one bus, and run them meanwhile if asked to.

    Parameters
    ----------
    drive : Drive or sequence of Drive
        On one connection; the first one's clock is the recording's time. With `run`, left in
        pre-operational with their bridges off whatever happens.
    path : Path
        The capture (BLF); its side file gets ``.json`` behind the name.
    span : Span or float, s
        Trigger and duration (with `run`: from when the bridge is on), or the duration alone.
    run : Run, optional
        None only listens, without a word to the bridge.
    metadata : mapping of str to str, optional
        Kept with the recording.
    foreign : sequence of ForeignSource
        Other nodes of the bus whose frames become channels.
    sync : bool
        Have all drives sample at the same moments, by a SYNC that the host sends with the first
        drive's sample period.
    overwrite : bool
        Replace an unfinished recording of that name.
    on_progress : callable, optional
        Called about ten times a second.
    requests : callable, optional
        Asked as often for marks and for an end.
    on_end : callable, optional
        Gets the capture however the recording ended, before anything is raised.

    Raises
    ------
    BadInput
        A path that cannot be written, or not to the end.
    DriveFailed
        A drive failed, restarted or vanished, or the bus did; what was recorded is kept and says
        that it was cut. With `sync`, also a drive that sends samples for another program.
    """
    drives = [drive] if isinstance(drive, Drive) else list(drive)
    span = span if isinstance(span, Span) else Span(span)
    session = _Session(
        drives,
        path,
        span,
        run,
        metadata=metadata or {},
        foreign=foreign,
        sync=sync,
        overwrite=overwrite,
    )
    watch = Watch(session.followers, session.writer, on_progress, requests, session.senders)
    try:
        with session.writer, _tapped(drives, session.writer):
            session.run_watched(watch)
    finally:
        capture = session.end()
        if on_end is not None:
            on_end(capture)
    session.raise_unwritten()
    if not capture.side.samples and session.triggered:
        raise DriveFailed(f"{path} holds no samples")
    return capture


class _Session:
    """One recording under way: prepared when made, then run, then told how it ended."""

    def __init__(
        self,
        drives: Sequence[Drive],
        path: Path,
        span: Span,
        run: Run | None,
        *,
        metadata: Mapping[str, str],
        foreign: Sequence[ForeignSource],
        sync: bool,
        overwrite: bool,
    ) -> None:
        self.drives, self.path, self.span, self.run, self.sync = drives, path, span, run, sync
        self.triggered = span.start_on_motion_rad is None
        self.ended = "duration over"
        if run is not None:
            for drive in drives:
                require_unused(drive)
                if run.torque_nm:
                    require_allowed_torque(drive, run.torque_nm)
        self.layouts = layouts = [read_layouts(drive) for drive in drives]
        self.followers = [Follower(drive, one) for drive, one in zip(drives, layouts, strict=True)]
        side = side_file(drives, layouts, {**metadata, **run_metadata(drives[0], run)})
        # A drive that sends samples already does so for someone else: then we only listen to it.
        self.ours = [
            drive for drive in drives if run is not None or drive.next_nmt_state() != "OPERATIONAL"
        ]
        if sync:
            require_ours(drives, self.ours)
        every = [command_sender(one, run) for one in self.followers] if run is not None else []
        self.senders = [sender for sender in every if sender is not None]
        for drive in self.ours:
            drive.nmt("PRE-OPERATIONAL")
        counters = self._counters()
        side = side.with_counters("counter_before", counters if self.triggered else {})
        if sync:
            side = side.with_counters("sync_counter", counters).with_one_period()
        self.writer = CaptureWriter(
            path,
            side.model_copy(update={"foreign": list(foreign)}),
            pre_trigger_s=None if self.triggered else span.pre_trigger_s,
            overwrite=overwrite,
        )

    def run_watched(self, watch: Watch) -> None:
        """Have the drives send and run, and watch them; say in the capture why it was cut."""
        writer = self.writer
        try:
            with ExitStack() as sampling:
                if self.sync:
                    sampling.enter_context(sampling_by_sync(self.drives, self.layouts))
                for drive in self.ours:
                    sampling.enter_context(_sampling(drive, self.run))
                if self.sync:
                    connection, period_s = self.drives[0].connection, writer.side.sample_period_s
                    sampling.enter_context(sync_sent(connection, period_s))
                self._watch(watch)
            writer.side = writer.side.with_counters("counter_after", self._counters())
        except KeyboardInterrupt as stop:
            if self.span.duration_s is None and type(stop) is KeyboardInterrupt:
                self.ended = "stopped by the user"  # the usual end of a recording without one
                return
            self.ended = "interrupted by the user"
            writer.note(cut=self.ended)
            raise
        except DriveFailed as failure:
            self.ended = str(failure)
            writer.note(cut=self.ended)
            hint = "" if self.sync else missing_sync_hint(self.ours)
            raise DriveFailed(
                f"{failure}{hint}; what was recorded until then is kept and marked as cut"
            ) from failure
        except BadInput:
            self.raise_unwritten()
            raise

    def end(self) -> Capture:
        """Return the capture as it is now; one that never began is removed."""
        writer = self.writer
        if not self.triggered:
            writer.discard()
        path = self.path if writer.failure is None else writer.part
        decoded = writer.decoded or nothing_decoded()
        return Capture(path, writer.side, decoded, writer.failure or self.ended)

    def raise_unwritten(self) -> None:
        """Raise BadInput when the capture could not be written to its end."""
        if self.writer.failure is not None:
            accepted = f"a disk with room; what is there is kept in {self.writer.part}"
            raise BadInput(str(self.path), self.writer.failure, accepted) from None

    def _watch(self, watch: Watch) -> None:
        is_powered, motion_rad = self.run is not None, self.span.start_on_motion_rad
        if motion_rad is not None:
            trigger = watch.wait_for_motion(motion_rad, is_powered)
            if trigger is None:
                self.ended = "stopped by the user before the trigger"
                return
            self.writer.note(trigger=trigger)
            self.writer.release()
            self.triggered = True
        self.ended = watch.run(self.span, is_powered) or self.ended

    def _counters(self) -> dict[int, int]:
        """Read the sample counters of the drives that send for us, by node id."""
        return {drive.node_id: drive.read_raw("sample_counter") for drive in self.ours}


@contextmanager
def _tapped(drives: Sequence[Drive], writer: CaptureWriter) -> Iterator[None]:
    """Have the reading thread write every frame inside the block."""
    connection = drives[0].connection
    errors = connection.error_frames
    connection.set_tap(writer.write)
    try:
        yield
    finally:
        connection.set_tap(None)
        writer.note(error_frames=connection.error_frames - errors)
        if emergencies := [
            (f"node {drive.node_id}: " if len(drives) > 1 else "") + describe_emergency(code)
            for drive in drives
            for code in drive.emergencies
        ]:
            writer.note(emergencies=emergencies)


@contextmanager
def _sampling(drive: Drive, run: Run | None) -> Iterator[None]:
    """Have the drive send samples inside the block, and run if asked to."""
    if run is not None:
        with powered(drive, run):
            yield
        return
    drive.nmt("OPERATIONAL")
    try:
        yield
    finally:
        drive.nmt("PRE-OPERATIONAL")
