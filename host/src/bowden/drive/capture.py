"""Recording a run: the drive's samples into a capture, watched, and stopped safely.

The reading thread writes the bus to the capture, frame by frame; `watch` ends the recording when
its time is over or when the drive fails, restarts or vanishes. Then the capture is closed all the
same and says that it was cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from bowden.drive.client import Drive
from bowden.drive.faults import describe_emergency
from bowden.drive.power import Run, powered
from bowden.drive.provenance import read_layouts, run_metadata, side_file
from bowden.drive.watch import Progress, Watch
from bowden.errors import BadInput, DriveFailed
from bowden.recording.capture_file import CaptureWriter
from bowden.recording.decode import Decoded
from bowden.recording.side_file import SideFile


@dataclass(frozen=True)
class Capture:
    """A finished recording: where it is, and its samples as read back from the file."""

    path: Path
    side: SideFile
    decoded: Decoded


def record(
    drive: Drive,
    path: Path,
    duration_s: float,
    *,
    run: Run | None = None,
    metadata: Mapping[str, str] | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Capture:
    """Record the drive, and run it meanwhile if asked to.

    Parameters
    ----------
    drive : Drive
        Connected; with `run`, left in pre-operational with its bridge off whatever happens.
    path : Path
        The capture (BLF); its side file gets ``.json`` behind the name.
    duration_s : float, s
        By the drive's clock, from the first sample (with `run`: from when the bridge is on).
    run : Run, optional
        None only listens, without a word to the bridge.
    metadata : mapping of str to str, optional
        Kept with the recording.
    on_progress : callable, optional
        Called about ten times a second.

    Raises
    ------
    BadInput
        A path that cannot be written, a duration of zero or less.
    DriveFailed
        The drive failed, restarted or vanished, or the bus did; what was recorded is kept and says
        that it was cut.
    """
    if not 0 < duration_s < float("inf"):
        raise BadInput("--duration", f"{duration_s:g}", "seconds, more than 0")
    layouts = read_layouts(drive)
    side = side_file(drive, layouts, {**(metadata or {}), **run_metadata(drive, run)})
    # A drive that sends samples already does so for someone else: then we only listen.
    ours = run is not None or drive.next_nmt_state() != "OPERATIONAL"
    if ours:
        drive.nmt("PRE-OPERATIONAL")
        side = side.model_copy(update={"counter_before": drive.read_raw("sample_counter")})
    watch = Watch(drive, layouts, on_progress)
    with CaptureWriter(path, side) as writer, _tapped(drive, writer):
        try:
            with _sampling(drive, run) if ours else nullcontext():
                watch.run(duration_s, is_powered=run is not None)
            if ours:
                writer.note(counter_after=drive.read_raw("sample_counter"))
        except KeyboardInterrupt:
            writer.note(cut="interrupted by the user")
            raise
        except DriveFailed as failure:
            writer.note(cut=str(failure))
            raise DriveFailed(
                f"{failure}; what was recorded until then is kept and marked as cut"
            ) from failure
    if writer.decoded is None:
        raise DriveFailed(f"{path} holds no samples")
    return Capture(path, writer.side, writer.decoded)


@contextmanager
def _tapped(drive: Drive, writer: CaptureWriter) -> Iterator[None]:
    """Have the reading thread write every frame inside the block."""
    drive.connection.set_tap(writer.write)
    try:
        yield
    finally:
        drive.connection.set_tap(None)
        if drive.emergencies:
            writer.note(emergencies=[describe_emergency(code) for code in drive.emergencies])


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
