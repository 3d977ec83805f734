"""``pytest --target=hardware`` itself, without hardware: against the rig process on a real bus.

The wall clock, a socket and another process are real here; only the board is not.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections import deque
from pathlib import Path

import can
import pytest
from bowden_rig.process import DEFAULT_CHANNEL

from hil_tests.lockstep_host import CONTROLWORD, LockstepHost
from hil_tests.targets.hardware import Guard, HardwareWire

ROOT = Path(__file__).resolve().parents[1]
PORT = 43918  # not python-can's default: another rig may run on this machine
HANGS_S = 900.0  # only ends a test that hangs


class Loopback(can.BusABC):
    """Keeps what it is sent; `recv` gives what a test has put into `heard`."""

    def __init__(self) -> None:
        self.channel_info = "loopback"
        self.sent: list[can.Message] = []
        self.heard: deque[can.Message] = deque()
        super().__init__(channel="loopback")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        self.sent.append(msg)

    def _recv_internal(
        self,
        timeout: float | None,  # noqa: ARG002
    ) -> tuple[can.Message | None, bool]:
        return (self.heard.popleft() if self.heard else None), False


def frame(cob_id: int, data: str) -> can.Message:
    return can.Message(arbitration_id=cob_id, is_extended_id=False, data=bytes.fromhex(data))


@pytest.mark.parametrize(
    "message",
    [
        frame(0x610, "2b4060000f000000"),  # SDO, controlword 000Fh
        frame(0x610, "2b4060000f010000"),  # with a bit of another meaning
        frame(0x610, "22406000ff000000"),  # size not told
        frame(0x210, "0f00ff000000"),  # RPDO 1
    ],
)
def test_wire_never_switches_the_bridge_on_unless_motion_is_allowed(message: can.Message) -> None:
    with HardwareWire(Loopback(), Guard(16, allow_motion=False)) as wire:
        with pytest.raises(PermissionError, match="--allow-motion"):
            wire.send(message)
        assert not wire._bus.sent  # type: ignore[attr-defined]
    with HardwareWire(Loopback(), Guard(16, allow_motion=True)) as wire:
        wire.send(message)
    with HardwareWire(Loopback(), Guard(17, allow_motion=False)) as wire:
        wire.send(message)  # another node's


@pytest.mark.parametrize("word", [0x00, 0x06, 0x07, 0x80])
def test_wire_lets_the_other_commands_through(word: int) -> None:
    bus = Loopback()
    bus.heard.append(frame(0x590, "6040600000000000"))
    with HardwareWire(bus, Guard(16, allow_motion=False)) as wire:
        LockstepHost(wire).write(CONTROLWORD, 0, word, 2)
        assert len(bus.sent) == 1


def test_wire_hides_its_own_echo_and_counts_error_frames() -> None:
    bus = Loopback()
    with HardwareWire(bus, Guard(16, allow_motion=False)) as wire:
        wire.send(frame(0x000, "0110"))
        bus.heard.extend([frame(0x000, "0110"), can.Message(is_error_frame=True)])
        bus.heard.append(frame(0x710, "05"))
        got = wire.recv(0.1)
        assert got is not None
        assert got.arbitration_id == 0x710
        assert wire.error_frames == 1
        assert [m.arbitration_id for m in wire.traffic] == [0x000, 0x710]


def _multicast_works() -> bool:
    try:
        with can.Bus(
            interface="udp_multicast", channel=DEFAULT_CHANNEL, port=PORT, hop_limit=0
        ) as bus:
            bus.send(frame(0x7FF, ""))
            return bus.recv(1.0) is not None
    except can.CanError:
        return False


def _run_tests(*arguments: str) -> str:
    """Run the wire's tests in a pytest of their own, bus from python-can's configuration."""
    bus = {"interface": "udp_multicast", "port": PORT, "hop_limit": 0}
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")
    } | {"CAN_CONFIG": json.dumps(bus)}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--target=hardware", "-rs", *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=HANGS_S,
        check=False,
    )
    return done.stdout + done.stderr


def test_tests_of_the_wire_run_on_a_real_bus_and_the_others_say_why_not() -> None:
    if not _multicast_works():
        pytest.skip("multicast does not come back on this machine")
    rig = [sys.executable, "-m", "bowden_rig", "--bus-kwargs", f"port={PORT}"]
    with subprocess.Popen(rig, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert process.stderr.readline().startswith("rig: ready")
            said = _run_tests(
                f"--can-channel={DEFAULT_CHANNEL}",
                "hil_tests/test_drive.py",
                "hil_tests/test_bench.py",
            )
        finally:
            process.terminate()
    assert re.search(r"^12 passed, \d+ skipped", said, re.MULTILINE), said
    assert "target hardware lacks: motion" in said
    assert "target hardware lacks: simulated-rig, virtual-time" in said


def test_what_the_target_lacks_fails_where_the_target_is_required() -> None:
    said = _run_tests(
        "--require-target", "hil_tests/test_bench.py", "-k", "railed_load_cell or two_drives"
    )
    assert "2 failed" in said or "2 errors" in said, said
    assert "target hardware lacks: several, simulated-rig, virtual-time" in said
