"""The simulated rig as a process of its own: a CANopen node on any python-can bus, in real time.

    python -m bowden_rig -i socketcan -c vcan0 --operator sine --drop-probability 0.001
    python -m bowden_rig --target emulated     the flashed ELF on the emulated chip

Runs the bench in slices of 1 ms beside the wall clock and carries frames between the drive and the
bus. Without -i it uses UDP multicast that never leaves the machine. Ends on SIGINT, SIGTERM, after
--duration-s, or when the process that started it dies; then it says how punctual it was.
Exit status: 0 done, 2 usage, 3 the bus failed.
"""

from __future__ import annotations

import argparse
import gc
import math
import os
import signal
import socket
import sys
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

import can
import can.cli

from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.frame_loss import SeededLoss
from bowden_rig.pacing import Pace
from bowden_rig.rig import parameters
from bowden_rig.rig.rig import Actuators, SimulatedRig
from bowden_rig.target import DEFAULT_NODE_ID, Target, fitted
from bowden_rig.targets import make_target, names

DEFAULT_INTERFACE: Final = "udp_multicast"
DEFAULT_CHANNEL: Final = "239.74.163.2"
_IP_MULTICAST_ALL: Final = 49  # Linux
SLICE_S: Final = 1e-3
TICKS_PER_SLICE: Final = round(SLICE_S * TICKS_PER_S)
LISTEN_S: Final = 0.25  # for another node of our id, before we join
SYNC_COB_ID: Final = 0x080
MOST_FRAMES_IN: Final = 64  # taken from the bus before each slice
ROUTE_ADVICE: Final = (
    "no multicast route on this machine; add one with 'sudo ip route add 239.0.0.0/8 dev lo', "
    "or name another bus with -i and -c"
)


def main(arguments: list[str] | None = None) -> int:
    """Run the rig until told to stop; the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        description = _describe(options)
        loss = SeededLoss(options.drop_probability, options.seed)
    except ValueError as error:
        parser.error(str(error))
    try:
        bus = _open_bus(options)
    except (can.CanError, OSError, ValueError, argparse.ArgumentError) as error:
        _say(f"cannot open the bus: {_advice(error)}")
        return 3
    listen_until_s = time.monotonic() + LISTEN_S
    try:
        target = _warm_target(options, description)
        rig = SimulatedRig(fitted(description, target.capabilities), options.seed)
        bench = Bench(rig, target)
        if taken(bus, options.node_id, listen_until_s):
            _say(f"node {options.node_id} is on this bus already; stop it or pass --node-id")
            return 3
        bridge = Bridge(bench, bus, loss)
        worked_s = -time.process_time()
        with _signals() as stopping:
            pace = _run(bridge, options, stopping)
        worked_s += time.process_time()
        _report(bridge, pace, worked_s, options.drop_log)
        for complaint in bench.target.complaints():
            _say(complaint)
    except FileNotFoundError as error:
        _say(str(error))
        return 3
    except ValueError as error:
        _say(str(error))
        return 2
    except can.CanError as error:
        _say(f"the bus failed: {_advice(error)}")
        return 3
    finally:
        bus.shutdown()
    return 0


class Bridge:
    """Carries frames between a bench and a bus, and counts them.

    On multicast a bus hears itself. A frame whose COB-ID the drive has sent is taken for such an
    echo: in CANopen no two nodes send the same COB-ID.
    """

    def __init__(self, bench: Bench, bus: can.BusABC, loss: SeededLoss) -> None:
        self.bench = bench
        self.sent = 0
        self.received = 0
        self.dropped: list[can.Message] = []
        self._bus = bus
        self._loss = loss
        self._own_cob_ids: set[int] = set()
        self._waiting: deque[can.Message] = deque()  # for the drive

    def slice(self) -> None:
        """Let one millisecond pass on the bench."""
        bench, bus = self.bench, self._bus
        for _ in range(MOST_FRAMES_IN):
            message = bus.recv(0)
            if message is None:
                break
            if message.arbitration_id not in self._own_cob_ids:
                self.received += 1
                self._waiting.append(message)
        for _ in range(TICKS_PER_SLICE):
            self._deliver()
            bench.step()
        while bench.from_drive:
            message = bench.from_drive.popleft()
            if self._loss(message):
                self.dropped.append(message)
                continue
            self._own_cob_ids.add(message.arbitration_id)
            bus.send(message)
            self.sent += 1

    def _deliver(self) -> None:
        """Give the drive what has come, up to the first SYNC: each one takes a sample.

        A machine that is busy hands over several at once; on a wire they are a period apart.
        """
        while self._waiting:
            message = self._waiting.popleft()
            self.bench.to_drive.append(message)
            if message.arbitration_id == SYNC_COB_ID:
                break


def taken(bus: can.BusABC, node_id: int, until_s: float) -> bool:
    """Listen until a monotonic time whether another node of that id is heard.

    Its heartbeat (100 ms by default) or process data give it away.
    """
    ours = {function + node_id for function in (0x080, 0x180, 0x280, 0x380, 0x580, 0x700)}
    while True:
        message = bus.recv(max(until_s - time.monotonic(), 0.0))
        if message is None:
            return False
        if message.arbitration_id in ours:
            return True


def _run(bridge: Bridge, options: argparse.Namespace, stopping: list[int]) -> Pace:
    """Run slices beside the wall clock until a signal, the duration or the parent ends it."""
    parent = os.getppid()
    gc.collect()
    gc.freeze()  # what lives now lives to the end: looking through it again costs time
    duration_s = math.inf if options.duration_s is None else options.duration_s
    pace = Pace(SLICE_S, time.monotonic())
    _say(f"ready: node {options.node_id}, {bridge.bench.target.name} target, seed {options.seed}")
    if options.ready_file is not None:
        options.ready_file.write_text("ready\n")
    while not stopping and bridge.bench.time_s < duration_s and os.getppid() == parent:
        for _ in range(pace.due(time.monotonic())):
            bridge.slice()
        time.sleep(pace.wait_s(time.monotonic()))
    gc.unfreeze()
    return pace


@contextmanager
def _signals() -> Iterator[list[int]]:
    """Collect SIGINT and SIGTERM in a list instead of dying of them."""
    got: list[int] = []
    before = {
        number: signal.signal(number, lambda came, _frame: got.append(came))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield got
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _report(bridge: Bridge, pace: Pace, worked_s: float, drop_log: Path | None) -> None:
    """Print what was carried, how punctual it was, and how busy a core; list the dropped frames."""
    share = 100.0 * worked_s / max(bridge.bench.time_s, SLICE_S)
    lost = Counter(f"{message.arbitration_id:03X}h" for message in bridge.dropped)
    lost_text = ", ".join(f"{name} {count}" for name, count in sorted(lost.items())) or "none"
    skipped = f", clock moved by {pace.skipped_s:.1f} s" if pace.skipped_s > 0.0 else ""
    _say(
        f"stopped after {bridge.bench.time_s:.3f} s: {bridge.sent} frames sent, "
        f"{bridge.received} received, dropped on purpose: {lost_text}; "
        f"{pace.late_slices} of {pace.slices} ms late, worst {1e3 * pace.worst_lateness_s:.1f} ms"
        f"{skipped}; {share:.0f} % of a core"
    )
    if drop_log is not None:
        rows = [f"{m.timestamp:.6f},{m.arbitration_id:03X},{m.data.hex()}" for m in bridge.dropped]
        drop_log.write_text("\n".join(["time_s,cob_id,data", *rows]) + "\n")


def _warm_target(options: argparse.Namespace, description: parameters.Rig) -> Target:
    """Load library and compiled plant before time starts to count."""
    target = make_target(options.target, options.node_id, description)
    SimulatedRig(description).step(Actuators())
    return target


def _open_bus(options: argparse.Namespace) -> can.BusABC:
    if not hasattr(options, "interface"):
        options.interface = DEFAULT_INTERFACE
    if options.interface == DEFAULT_INTERFACE:
        if not hasattr(options, "channel"):
            options.channel = DEFAULT_CHANNEL
        given = getattr(options, "bus_kwargs", {})
        options.bus_kwargs = {"hop_limit": 0, **given}  # nothing leaves this machine
    bus = can.cli.create_bus_from_namespace(options)
    if options.interface == DEFAULT_INTERFACE:
        # Linux delivers every group of the port to each socket: rigs on two channels would meet.
        with suppress(OSError), socket.socket(fileno=os.dup(bus.fileno())) as handle:
            handle.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
    return bus


def _advice(error: BaseException) -> str:
    """One line that names the cause, and the remedy where it is known."""
    chain: list[str] = []
    cause: BaseException | None = error
    while cause is not None:
        chain.append(str(cause))
        if "unreachable" in str(cause).lower() or "No such device" in str(cause):
            return ROUTE_ADVICE
        cause = cause.__cause__
    return chain[-1].splitlines()[0] if chain[-1] else type(error).__name__


def _describe(options: argparse.Namespace) -> parameters.Rig:
    """Build the rig from the defaults and what the command line changes."""
    operator = parameters.Operator(
        motion=options.operator,
        amplitude_rad=math.radians(options.operator_amplitude_deg),
        frequency_hz=options.operator_frequency_hz,
        starts=options.start,
    )
    rig = parameters.Rig(operator=operator)
    for assignment in options.set:
        rig = parameters.changed(rig, assignment)
    return rig


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m bowden_rig",
        description="Simulated rig with the drive's firmware, as a CANopen node on a CAN bus.",
    )
    can.cli.add_bus_arguments(parser, group_title=f"bus (default: -i {DEFAULT_INTERFACE})")
    add = parser.add_argument
    add("--target", choices=names(), default="native", help="runs the firmware")
    add("--node-id", type=int, default=DEFAULT_NODE_ID, choices=range(1, 128), metavar="1..127")
    add("--seed", type=int, default=0, help="of the sensors' noise and of the dropped frames")
    add("--operator", "--human", choices=("still", "sine", "locked", "free"), default="sine")
    add(
        "--operator-amplitude-deg", "--human-amplitude-deg", type=float, default=40.0, metavar="DEG"
    )
    add("--operator-frequency-hz", "--human-frequency-hz", type=float, default=0.5, metavar="HZ")
    add("--start", choices=("on-enable", "now"), default="on-enable", help="of the operator")
    add("--set", action="append", default=[], metavar="PART.FIELD=VALUE", help="change the rig")
    add("--drop-probability", type=float, default=0.0, metavar="P", help="of each TPDO frame")
    add("--drop-log", type=Path, metavar="CSV", help="write the dropped frames here at the end")
    add("--duration-s", type=float, metavar="S", help="default: until stopped")
    add("--ready-file", type=Path, metavar="PATH", help="written when the node is on the bus")
    return parser


def _say(line: str) -> None:
    sys.stderr.write(f"rig: {line}\n")
    sys.stderr.flush()
