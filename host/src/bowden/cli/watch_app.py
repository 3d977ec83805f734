"""The terminal page of `bowden watch`: a textual app over a `LiveSession`; draws and takes keys.

The session runs in a thread of its own. Every tick of the page tells it `alive`: a page that hangs
stops the motor.
"""

from __future__ import annotations

import threading
from datetime import datetime
from pathlib import Path
from typing import ClassVar

from rich.markup import escape
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Grid
from textual.widgets import Footer, Sparkline, Static

from bowden.drive.live import LiveSession
from bowden.drive.live_state import (
    TENSION_PROFILES,
    EndRecording,
    MarkMoment,
    Snapshot,
    StartMotor,
    StartRecording,
    StopMotor,
    tension_profile,
)
from bowden.drive.meanings import CompensationLaw, ModeOfOperation
from bowden.drive.power import Run

REFRESH_S = 0.35
_CONFIRM_S = 3.0
_CURVE_EVERY = 3  # pictures: the curve is what costs most to draw
_PLOTTED_SAMPLES, _PLOTTED = 4000, 100
_BLOCKS = " ▁▂▃▄▅▆▇█"


class WatchApp(App[None]):
    """Shows one drive.

    Parameters
    ----------
    session : LiveSession
    folder : Path
        Where recordings go.
    threaded : bool
        Run the session in a thread of its own; else each refresh turns it (tests, virtual time).
    """

    CSS = """
    Grid { grid-size: 2; grid-columns: 1fr 1fr; grid-rows: auto; grid-gutter: 0 1; height: auto; }
    .panel { border: round $primary; padding: 0 1; height: 7; }
    #state { column-span: 2; text-style: bold; content-align: center middle; height: 3; }
    #fault { column-span: 2; display: none; border: heavy red; color: red; padding: 0 1; }
    #fault.shown { display: block; }
    Sparkline { height: 3; }
    #message { height: 1; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "stop", "STOP", priority=True),
        Binding("s", "start", "start the tunnel"),
        Binding("r", "record", "record on/off"),
        Binding("m", "mark", "mark"),
        Binding("q", "quit", "quit"),
    ]
    TITLE = "bowden watch"

    def __init__(self, session: LiveSession, folder: Path, *, threaded: bool = True) -> None:
        super().__init__()
        self.session = session
        self.failure: BaseException | None = None
        self._folder = folder
        self._threaded = threaded
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._turn_until_ended, name="bowden live")
        self._asked_at: float | None = None
        self._texts: dict[str, str] = {}
        self._picture = 0

    def compose(self) -> ComposeResult:
        """Lay the page out."""
        yield Static(id="state", classes="panel")
        yield Static(id="fault")
        with Grid():
            yield Static(id="motion", classes="panel")
            yield Static(id="tunnel", classes="panel")
            yield Static(id="cables", classes="panel")
            yield Static(id="bus", classes="panel")
        yield Static("load torque, the last seconds")
        yield Sparkline([], id="torque")
        yield Static(id="message")
        yield Footer()

    def on_mount(self) -> None:
        """Start the session's thread and the page's clock."""
        self.session.alive()
        if self._threaded:
            self._thread.start()
        self.set_interval(REFRESH_S, self.refresh_page)
        self.refresh_page()

    def on_unmount(self) -> None:
        """End the session's thread; the caller closes the session, which stops the drive."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def refresh_page(self) -> None:
        """Draw what is known now."""
        self.session.alive()
        if not self._threaded:
            self.session.turn(REFRESH_S)
        if self.failure is not None:
            self.exit()
            return
        now = self.session.snapshot()
        self._show("state", _state(now))
        self._show("motion", _motion(now))
        self._show("tunnel", _tunnel(now))
        self._show("cables", _cables(now))
        self._show("bus", _bus(now))
        self._show("message", escape(now.message))
        if self._texts.get("fault") != (now.fault or ""):
            self._texts["fault"] = now.fault or ""
            fault = self.query_one("#fault", Static)
            fault.set_class(now.fault is not None, "shown")
            fault.update(escape(f"FAULT: {now.fault}"))
        self._picture += 1
        if self._picture % _CURVE_EVERY != 1:
            return
        rows = self.session.samples_after(max(now.samples - _PLOTTED_SAMPLES, 0))
        step = max(len(rows) // _PLOTTED, 1)
        self.query_one("#torque", Sparkline).data = [abs(row[5]) for row in rows[::step]]

    def action_stop(self) -> None:
        """Stop the drive, whoever runs it."""
        self._asked_at = None
        self.session.request(StopMotor())

    def action_start(self) -> None:
        """Start the tunnel on the second key press."""
        now = self.session.drive.connection.clock()
        if self._asked_at is None or now - self._asked_at > _CONFIRM_S:
            self._asked_at = now
            self.notify("the motor will move: press s again to start, space stops")
            return
        self._asked_at = None
        self.session.request(StartMotor(Run(ModeOfOperation.TUNNEL)))

    def action_record(self) -> None:
        """Begin or end a recording."""
        if self.session.snapshot().recording:
            self.session.request(EndRecording())
            return
        name = f"watch_{datetime.now():%Y%m%d_%H%M%S}.blf"
        self.session.request(StartRecording(self._folder / name))

    def action_mark(self) -> None:
        """Set a mark in the recording."""
        self.session.request(MarkMoment("mark"))

    def _show(self, name: str, text: str) -> None:
        if self._texts.get(name) != text:
            self._texts[name] = text
            # Every panel has its height: the page is not laid out anew again and again.
            self.query_one(f"#{name}", Static).update(text, layout=False)

    def _turn_until_ended(self) -> None:
        try:
            while not self._ended.is_set():
                self.session.turn()
        except Exception as failure:  # noqa: BLE001  (raised again by the command)
            self.failure = failure


def _state(now: Snapshot) -> str:
    colour = "red" if now.fault else "green" if now.is_on else "white"
    who = " by this page" if now.is_ours else " by another program" if now.is_on else ""
    recording = f"   [red]REC[/] {now.recorded_s:.1f} s" if now.recording else ""
    return (
        f"node {now.node_id}   [{colour}]{now.power_state.upper()}[/]{who}   "
        f"NMT {now.nmt_state.lower()}{recording}"
    )


def _motion(now: Snapshot) -> str:
    v = now.values
    return (
        "[b]motion[/]\n"
        f"motor angle   {_number(v, 'motor_angle', 'rad')}\n"
        f"load angle    {_number(v, 'load_angle', 'rad')}\n"
        f"motor torque  {_number(v, 'motor_torque', 'N m')}\n"
        f"load torque   {_number(v, 'load_torque', 'N m')}"
    )


def _tunnel(now: Snapshot) -> str:
    half = now.tunnel.get("tunnel_half_width", 0.0)
    angle = now.values.get("load_angle", 0.0)
    outside = max(abs(angle) - half, 0.0)
    place = "inside" if not outside else f"[yellow]{outside:.4f} rad outside[/]"
    law = int(now.values.get("compensation_active_law", 0))
    return (
        "[b]tunnel[/]\n"
        f"half width    {half:8.4f} rad\n"
        f"stiffness     {now.tunnel.get('tunnel_stiffness', 0.0):8.4f} N m/rad\n"
        f"load          {place}\n"
        f"compensation  {CompensationLaw.word_of(law)}"
    )


def _cables(now: Snapshot) -> str:
    profiles = {cable: tension_profile(now.values, cable) for cable in TENSION_PROFILES}
    most = max([tension for profile in profiles.values() for tension in profile] + [1.0])
    lines = ["[b]tensions (N), motor to load[/]"]
    for cable, profile in profiles.items():
        if profile:
            blocks = (_BLOCKS[round((len(_BLOCKS) - 1) * one / most)] for one in profile)
            course = "".join(2 * block for block in blocks)
            lines += ["", f"{cable} {profile[0]:.1f} {course} {profile[-1]:.1f}"]
    return "\n".join(lines)


def _bus(now: Snapshot) -> str:
    lost = f"[red]{now.lost}[/]" if now.lost else "0"
    return (
        "[b]bus[/]\n"
        f"samples       {now.rate_hz:8.0f} /s, {lost} frames lost\n"
        f"load          {now.bus_share:8.0%}, {now.frames_per_s:.0f} frames/s\n"
        f"supply        {_number(now.values, 'bus_voltage', 'V')}\n"
        f"error frames  {now.error_frames:8d}"
    )


def _number(values: dict[str, float], name: str, unit: str) -> str:
    return f"{values[name]:9.4f} {unit}" if name in values else "        -"
