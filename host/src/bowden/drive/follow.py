"""Following one drive while it is recorded: its samples, its state, and what is wrong with it.

Takes the frames that `watch` handles; stores nothing and sends nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import can

from bowden.drive.client import Drive
from bowden.drive.dictionary import lookup
from bowden.drive.entry import Layout
from bowden.drive.faults import describe_emergency
from bowden.drive.power import is_fault, power_state
from bowden.errors import DriveFailed
from bowden.recording.clock import elapsed_us

_EMERGENCY_FOLLOWS_S = 0.05
_ANGLES = ("load_angle", "motor_angle")


class Follower:
    """Counts the samples of one drive.

    Parameters
    ----------
    drive : Drive
    layouts : sequence of Layout
        What its PDOs carry; the first has the sample counter and the device time.

    Attributes
    ----------
    elapsed_us : int, us
        By the drive's clock, since `begin`.
    samples : int
        By its counter, since `begin`.
    last : dict of str to int, or None
        Raw values of the last frame of the first PDO.
    last_host_s : float, s
        When that was received.
    """

    def __init__(self, drive: Drive, layouts: Sequence[Layout]) -> None:
        self.drive = drive
        self._clock = drive.connection.clock
        self._pdos = {layout.cob_id: layout for layout in layouts}
        self._angles_in = {
            layout.cob_id: [one.name for one in layout.entries if one.name in _ANGLES]
            for layout in layouts
        }
        self._first = layouts[0].cob_id
        self._boots = drive.boots
        self._emergencies = len(drive.emergencies)
        self._angles: dict[str, int] = {}
        self._reference: dict[str, int] = {}
        self._is_old_fault = True  # until a sample without one
        self.begin()

    def begin(self) -> None:
        """Count from the next sample on."""
        self._frames = 0
        self.last: dict[str, int] | None = None
        self.last_host_s = 0.0
        self.elapsed_us = 0
        self.samples = 0
        self._last_at = self._clock()
        self._reference = {}

    @property
    def silence_s(self) -> float:
        """How long no sample has come, s."""
        return self._clock() - self._last_at

    @property
    def lost(self) -> int:
        """Frames that the counters show as lost so far, all PDOs together."""
        # Frames of the sample that is just coming in are not lost yet.
        return max(0, len(self._pdos) * self.samples + 1 - self._frames)

    def count(self, frame: can.Message) -> dict[str, int] | None:
        """Take a frame and return its raw values; those of others change nothing."""
        layout = self._pdos.get(frame.arbitration_id)
        if layout is None or len(frame.data) != layout.size:
            return None
        now = layout.decode(bytes(frame.data))
        for name in self._angles_in[frame.arbitration_id]:
            self._angles[name] = now[name]
        if frame.arbitration_id == self._first:
            if self.last is not None:
                step_us = elapsed_us(self.last["device_time"], now["device_time"])
                if step_us <= 0:  # it came twice, or was overtaken
                    return now
                self.elapsed_us += step_us
                self.samples += (now["sample_counter"] - self.last["sample_counter"]) % (1 << 16)
            else:
                self._frames = 0
            self.last = now
            self.last_host_s = frame.timestamp
            self._last_at = self._clock()
        self._frames += 1
        return now

    def moved(self, motion_rad: float) -> str | None:
        """Return which angle has moved by more than so much since `begin`; None if none has."""
        for name, angle in self._angles.items():
            start = self._reference.setdefault(name, angle)
            if abs(lookup(name).to_value(angle - start)) > motion_rad:
                return f"{name.replace('_', ' ')} moved by more than {motion_rad:g} rad"
        return None

    @property
    def angles_rad(self) -> dict[str, float]:
        """The last angles by entry name (`motor_angle`, `load_angle`), those that came."""
        return {name: lookup(name).to_value(raw) for name, raw in self._angles.items()}

    def new_fault(self) -> str | None:
        """Return a fault that was not there at first, in words; None when there is none."""
        if not self._is_faulty():
            self._is_old_fault &= self.last is None
            return None
        return None if self._is_old_fault else self._fault()

    def _is_faulty(self) -> bool:
        statusword = self.last.get("statusword") if self.last else None
        return statusword is not None and is_fault(statusword)

    def _fault(self) -> str:
        """Return the present fault in words; its EMCY may still be on its way."""
        self.drive.connection.listen(_EMERGENCY_FOLLOWS_S)
        new = self.drive.emergencies[self._emergencies :]
        return describe_emergency(new[-1]) if new else "no EMCY"

    def check(self, is_powered: bool) -> None:
        """Raise DriveFailed when the drive has failed, restarted, stopped sending or vanished."""
        drive = self.drive
        node = f"node {drive.node_id}"
        if drive.boots > self._boots:
            raise DriveFailed(f"{node} restarted while it was recorded")
        if is_powered:
            if self._is_faulty():
                raise DriveFailed(f"{node} reports a fault: {self._fault()}")
            statusword = self.last.get("statusword") if self.last else None
            if statusword is not None and (state := power_state(statusword)) != "operation enabled":
                raise DriveFailed(f"{node} has left 'operation enabled' for {state!r}")
        limit_s = drive.connection.limits.silence_s
        if self._clock() - self._last_at <= limit_s:
            return
        if drive.connection.silence_s(drive.node_id) <= limit_s:
            raise DriveFailed(f"{node} sends no samples any more (NMT {drive.nmt_state.lower()})")
        raise DriveFailed(f"{node} has vanished: nothing from it for {limit_s:g} s")
