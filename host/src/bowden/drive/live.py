"""A drive watched and run live: what `bowden watch` and `bowden studio` show and do.

One thread (the owner's) calls `turn` again and again: it handles the bus, does what was requested,
polls slow values. Any other thread may call `request`, `snapshot`, `samples_after` and `alive`.
Safety: the motor runs only while whoever shows it says `alive` often enough; a screen that hangs or
a page that is lost stops the drive, and so does the end of the session, however it ends. Should
this program hang itself, the drive misses its heartbeat and stops.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from itertools import takewhile
from pathlib import Path

import can

from bowden.counted import counted
from bowden.drive.bus_load import BusLoad
from bowden.drive.client import Drive
from bowden.drive.dictionary import lookup
from bowden.drive.faults import describe_emergency
from bowden.drive.follow import Follower
from bowden.drive.live_experiment import TimedRun
from bowden.drive.live_recording import LiveRecording
from bowden.drive.live_state import (
    TENSION_PROFILES,
    Command,
    EndRecording,
    MarkMoment,
    RunTimed,
    Snapshot,
    StartMotor,
    StartRecording,
    StopMotor,
    WriteValues,
)
from bowden.drive.live_values import Row, change_values, plotted_row
from bowden.drive.position_follower import command_sender
from bowden.drive.power import BRIDGE_ON, Run, is_fault, power_state, powered, safe_stop
from bowden.drive.provenance import read_layouts
from bowden.errors import BadInput, DriveFailed

#: The motor stops when `alive` was not called for so long.
ALIVE_WITHIN_S = 1.0
#: Samples kept for whoever draws them.
KEPT = 8192
_LOAD_EVERY_S = 0.5
_POLL_EVERY_S = 0.25
_LOST_S = 1.0
#: Values that no PDO carries by default; a group is read at once, one group every `_POLL_EVERY_S`:
#: each SDO transfer costs a watching page a twentieth of a percent of a core a second.
POLLED = (
    TENSION_PROFILES["a"],
    ("bus_voltage", "conduit_temperature"),
    TENSION_PROFILES["b"],
    ("mode_of_operation_display", "compensation_active_law"),
)
TUNNEL = ("tunnel_half_width", "tunnel_stiffness", "tunnel_torque_limit")


class LiveSession:
    """One drive, watched until `close`; a context manager.

    Parameters
    ----------
    drive : Drive
        Connected. What it is doing is not changed by watching it; when it sends no samples, it is
        asked to (NMT operational), and put back at the end.

    Raises
    ------
    DriveFailed
        It does not answer.
    """

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self._clock = drive.connection.clock
        self._commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._rows: deque[Row] = deque(maxlen=KEPT)
        self._values: dict[str, float] = {}
        self._raw: dict[str, int] = {}
        self._layouts = read_layouts(drive)
        self._first = self._layouts[0].cob_id
        self._follower = Follower(drive, self._layouts)
        self._recording = LiveRecording(self._follower, self._layouts)
        self._load = BusLoad(drive.connection)
        self._motor: ExitStack | None = None
        self._run: Run | None = None
        self._message = ""
        self._alive_at = self._load_at = self._poll_at = self._clock()
        self._rates = 0.0, 0.0
        self._samples_before, self._rate_hz = 0, 0.0
        self._started_at_sample = 0
        self._boots = drive.boots
        self._ends_at_s: float | None = None  # of the recording; the motor stops with it
        self._sender: Callable[[float], None] | None = None
        self._poll_place = 0
        self._changes: list[dict[str, object]] = []
        self._read_tunnel()
        self._sends_for_us = drive.next_nmt_state() != "OPERATIONAL"
        self._snapshot = Snapshot(drive.node_id, tunnel=self.tunnel, ratio=self.ratio)
        drive.connection.observers.append(self._observe)
        if self._sends_for_us:
            drive.nmt("OPERATIONAL")

    def __enter__(self) -> LiveSession:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- from any thread ----------------------------------------------------------------------

    def request(self, command: Command) -> None:
        """Ask for something; it is done in the next turn, its outcome is the snapshot's message."""
        self._commands.put(command)

    def alive(self) -> None:
        """Report that the page is open, so that the drive can be stopped."""
        self._alive_at = self._clock()

    def snapshot(self) -> Snapshot:
        """Return what is known now."""
        with self._lock:
            return self._snapshot

    def samples_after(self, number: int) -> list[Row]:
        """Return the kept samples after one, as `live_values.plotted_row` makes them."""
        with self._lock:
            new = list(takewhile(lambda row: row[0] > number, reversed(self._rows)))
        return new[::-1]

    # --- from the owner's thread --------------------------------------------------------------

    def turn(self, longest_s: float = 0.02) -> None:
        """Handle frames for at most so long, then what was requested, then what is due.

        Raises
        ------
        DriveFailed
            The adapter failed. `close` still has to be called.
        """
        self._handle_for(longest_s)
        self._check_samples()
        self._end_timed()
        self._stop_unwatched()
        self._check_motor()
        while not self._commands.empty():
            self._obey(self._commands.get())
        if self._recording.has_failed:
            self._obey(EndRecording())
        self._poll()
        self._publish()

    def close(self) -> None:
        """Stop what was started here, close the capture, leave the drive as it was found.

        Raises
        ------
        DriveFailed
            The bridge is not known to be off.
        """
        connection = self.drive.connection
        state = power_state(self._raw.get("statusword", 0))
        if self._motor is None and state in BRIDGE_ON:
            self._sends_for_us = False  # another program runs it, and needs its samples now
        try:
            self._recording.end()
        finally:
            try:
                self._stop_ours()
            finally:
                if self._observe in connection.observers:
                    connection.observers.remove(self._observe)
                if self._sends_for_us:
                    with suppress(DriveFailed):
                        self.drive.nmt("PRE-OPERATIONAL")
                self._publish()

    def _observe(self, frame: can.Message) -> None:
        self._load.count(frame)
        if frame.arbitration_id == self._first and self._raw:
            self._keep_sample()  # whatever came since the one before belongs to it
        raw = self._follower.count(frame)
        if raw is None:
            return
        self._raw.update(raw)

    def _keep_sample(self) -> None:
        """Keep the sample that the frames so far make up."""
        row = plotted_row(self._follower.samples, self._raw)
        with self._lock:
            self._rows.append(row)

    def _obey(self, command: Command) -> None:
        try:
            match command:
                case StartMotor(run):
                    self._start(run)
                case StopMotor():
                    self._stop("stopped")
                case StartRecording(path, notes):
                    self._message = self._recording.start(path, notes, self._run)
                case RunTimed(timed, path):
                    self._run_timed(timed, path)
                case EndRecording():
                    self._message = self._recording.end() or self._message
                case MarkMoment(text):
                    self._message = self._recording.mark(text)
                case WriteValues(values, dry_run):
                    self._write_values(values, dry_run)
        except (DriveFailed, BadInput) as failure:
            self._message = str(failure)

    def _check_samples(self) -> None:
        """End what ran on a drive that has restarted or sends no samples, and watch it anew."""
        restarted, drive = self.drive.boots != self._boots, self.drive
        is_heard = drive.connection.silence_s(drive.node_id) <= _LOST_S
        if not restarted and (not is_heard or self._follower.silence_s <= _LOST_S):
            return
        self._boots = drive.boots
        state = "restarted" if restarted else f"sent no samples (NMT {drive.nmt_state.lower()})"
        why = f"node {drive.node_id} {state}"
        self._follower.begin()
        self._raw.clear()
        self._ends_at_s = None
        try:
            why = "; ".join(filter(None, [why, self._recording.end(cut=why)]))
        except BadInput as failure:
            why = f"{why}; {failure}"
        self._sends_for_us |= not restarted  # another program has ended, and its samples with it
        if restarted or self._motor is not None:
            self._stop_because(why)
            return
        self._message = why
        drive.nmt("OPERATIONAL")

    def _require_idle(self) -> None:
        if self._motor is not None:
            raise DriveFailed("the drive runs already")
        if power_state(self._raw.get("statusword", 0)) in BRIDGE_ON:
            raise DriveFailed("another program runs this drive: stop it first")

    def _start(self, run: Run) -> None:
        self._require_idle()
        with ExitStack() as stack:
            stack.enter_context(powered(self.drive, run))
            self._motor, self._run = stack.pop_all(), run
        self._started_at_sample = self._follower.samples
        self._message = f"running: {run.mode.word}"

    def _run_timed(self, timed: TimedRun, path: Path) -> None:
        self._require_idle()
        sender = command_sender(self._follower, timed.run)  # refuses before anything moves
        self._recording.start(path, timed.notes, timed.run)
        try:
            self._start(timed.run)
        except (DriveFailed, BadInput):
            self._recording.discard()
            raise
        self._recording.count_from_now()
        self._ends_at_s, self._sender = timed.duration_s, sender
        self._message = f"running for {timed.duration_s:.3g} s: {timed.notes}"

    def _handle_for(self, duration_s: float) -> None:
        """Handle frames; command the torque after each, where an experiment does."""
        if self._sender is None:
            self.drive.connection.handle_for(duration_s)
            return
        end = self._clock() + duration_s
        while (left := end - self._clock()) > 0:
            self.drive.connection.receive(max(left, 1e-3))  # time may come in steps
            self._sender(self._recording.elapsed_s)

    def _end_timed(self) -> None:
        """Stop a timed run when its time is over, or when its recording has ended before."""
        if self._ends_at_s is None:
            return
        if self._recording.path is not None and self._recording.elapsed_s < self._ends_at_s:
            return
        self._ends_at_s = None
        if self._stop_because("stopped"):
            self._obey(EndRecording())

    def _stop(self, why: str) -> None:
        """Take the torque away; also from a drive that is not ours."""
        if self._motor is not None:
            self._stop_ours()
        else:
            safe_stop(self.drive)
        if self._sends_for_us:
            self.drive.nmt("OPERATIONAL")
        self._message = why
        if self._ends_at_s is not None:  # before its time
            self._ends_at_s = None
            told = self._recording.end(cut=why)
            self._message = f"{why}; {told}"

    def _stop_because(self, why: str) -> bool:
        """Stop, and tell what fails; return whether all went well."""
        try:
            self._stop(why)
        except (DriveFailed, BadInput) as failure:
            self._message = f"{why}; {failure}"
            return False
        return True

    def _stop_ours(self) -> None:
        motor, self._motor, self._run, self._sender = self._motor, None, None, None
        if motor is not None:
            motor.close()

    def _stop_unwatched(self) -> None:
        if self._motor is not None and self._clock() - self._alive_at > ALIVE_WITHIN_S:
            self._stop_because("stopped: the page was not watched")

    def _check_motor(self) -> None:
        """Turn the bridge off when the drive has left operation by itself."""
        if self._motor is None or self._follower.samples <= self._started_at_sample + 1:
            return
        state = power_state(self._raw.get("statusword", 0))
        silent = self.drive.connection.silence_s(self.drive.node_id) > _LOST_S
        if state == "operation enabled" and not silent:
            return
        why = "nothing comes from the drive" if silent else self._fault() or f"drive: {state}"
        self._stop_because(why)

    def _write_values(self, values: dict[str, float | str], dry_run: bool) -> None:
        self._changes = change_values(self.drive, values, dry_run=dry_run)
        if not dry_run:
            self._read_tunnel()
        done = "would change" if dry_run else "changed and read back"
        self._message = f"{counted(len(self._changes), 'entry', 'entries')} {done}"

    def _read_tunnel(self) -> None:
        self.tunnel = {name: self.drive.read(name) for name in TUNNEL}
        radii = (self.drive.read(f"{end}_pulley_radius") for end in ("load", "motor"))
        self.ratio = next(radii) / next(radii)

    def _poll(self) -> None:
        now = self._clock()
        if (span_s := now - self._load_at) >= _LOAD_EVERY_S:
            self._rate_hz = (self._follower.samples - self._samples_before) / span_s
            self._samples_before = self._follower.samples
            self._rates = self._load.take()
            self._load_at = now
        if now < self._poll_at or self.drive.connection.silence_s(self.drive.node_id) > _LOST_S:
            return
        self._poll_at = now + _POLL_EVERY_S
        names = POLLED[self._poll_place]
        self._poll_place = (self._poll_place + 1) % len(POLLED)
        try:
            self._values |= {name: self.drive.read(name) for name in names}
        except DriveFailed as failure:
            self._message = str(failure)

    def _fault(self) -> str | None:
        if not is_fault(self._raw.get("statusword", 0)):
            return None
        codes = self.drive.emergencies
        return describe_emergency(codes[-1]) if codes else "a fault from before: bowden info"

    def _publish(self) -> None:
        drive, raw = self.drive, self._raw
        silent = drive.connection.silence_s(drive.node_id) > _LOST_S
        state = power_state(raw["statusword"]) if "statusword" in raw else "no samples"
        for name, value in raw.items():
            self._values[name] = lookup(name).to_value(value)
        shown = Snapshot(
            node_id=drive.node_id,
            nmt_state=drive.nmt_state,
            power_state="vanished" if silent else state,
            is_on=state in BRIDGE_ON,
            is_ours=self._motor is not None,
            fault=self._fault(),
            values=dict(self._values),
            tunnel=self.tunnel,
            ratio=self.ratio,
            samples=self._follower.samples,
            lost=self._follower.lost,
            rate_hz=self._rate_hz,
            frames_per_s=self._rates[0],
            bus_share=self._rates[1],
            error_frames=drive.connection.error_frames,
            recording=str(self._recording.path) if self._recording.path else None,
            recorded_s=self._recording.elapsed_s,
            runs_until_s=self._ends_at_s,
            last_recording=self._recording.last,
            changes=self._changes,
            message=self._message,
        )
        with self._lock:
            self._snapshot = shown
