"""The rig as a process: its arguments, what it carries, and that it ends when it should."""

from __future__ import annotations

import os
import select
import signal
import struct
import subprocess
import sys
from collections import deque
from pathlib import Path

import can
import pytest
from bowden_rig.bench import Bench
from bowden_rig.frame_loss import SeededLoss
from bowden_rig.process import DEFAULT_CHANNEL, Bridge, main, taken
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target

from hil_tests.board_bench import NEEDS_ELF
from hil_tests.targets import emulated

COMMAND = [sys.executable, "-m", "bowden_rig"]
PORT = 44000 + os.getpid() % 16000  # of its own: other rigs may run on this machine
BUS = ["--bus-kwargs", f"port={PORT}"]
HANGS_S = 900.0  # only ends a test that hangs


class EchoingBus(can.BusABC):
    """Hears whatever it sends, as a multicast bus does."""

    def __init__(self) -> None:
        self.channel_info = "echo"
        self.heard: deque[can.Message] = deque()
        self.carried: list[can.Message] = []
        self.sent = 0
        super().__init__(channel="echo")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        self.sent += 1
        self.heard.append(msg)
        self.carried.append(msg)

    def _recv_internal(
        self,
        timeout: float | None,  # noqa: ARG002
    ) -> tuple[can.Message | None, bool]:
        return (self.heard.popleft() if self.heard else None), False


def frame(cob_id: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=cob_id, is_extended_id=False, data=data)


def boot(bridge: Bridge) -> None:
    """Advance virtual time until the drive has said that it is there."""
    while not bridge.sent:
        bridge.slice()


@pytest.mark.needs("simulated-rig", "virtual-time")
def test_bridge_ignores_its_own_echo_and_hears_others(target_name: str) -> None:
    with EchoingBus() as bus:
        bridge = Bridge(Bench(SimulatedRig(), make_target(target_name)), bus, SeededLoss(0.0))
        boot(bridge)
        bus.heard.append(frame(0x000, bytes([0x01, 16])))
        for _ in range(1000):
            bridge.slice()
        assert bridge.received == 1
        # boot-up, twenty heartbeats a second, three TPDOs a millisecond: no storm
        assert bridge.sent == bus.sent == pytest.approx(3021, abs=6)


@pytest.mark.needs("simulated-rig", "virtual-time")
def test_each_of_several_syncs_that_a_busy_machine_hands_over_at_once_is_a_sample(
    target_name: str,
) -> None:
    with EchoingBus() as bus:
        bridge = Bridge(Bench(SimulatedRig(), make_target(target_name)), bus, SeededLoss(0.0))
        boot(bridge)
        for pdo in range(3):
            write = bytes([0x2F, pdo, 0x18, 2, 1, 0, 0, 0])  # transmission type: each SYNC
            bus.heard.append(frame(0x610, write))
            bridge.slice()
        bus.heard.append(frame(0x000, bytes([0x01, 16])))
        bridge.slice()
        before = bridge.sent
        for _ in range(6):
            bus.heard.append(frame(0x080, b""))
        for _ in range(3):
            bridge.slice()
        samples = [message for message in bus.carried if message.arbitration_id == 0x190]
        counters = [struct.unpack_from("<H", sample.data)[0] for sample in samples]
        assert bridge.sent - before >= 18  # three frames each
        assert counters == list(range(counters[0], counters[0] + 6))


@pytest.mark.needs("simulated-rig", "virtual-time")
def test_bridge_keeps_a_record_of_what_it_drops(target_name: str) -> None:
    with EchoingBus() as bus:
        bridge = Bridge(Bench(SimulatedRig(), make_target(target_name)), bus, SeededLoss(0.1, 7))
        boot(bridge)
        bus.heard.append(frame(0x000, bytes([0x01, 16])))
        for _ in range(1000):
            bridge.slice()
        assert 220 < len(bridge.dropped) < 390  # 0.1 of 3000, 5 sigma = 82
        assert bridge.sent + len(bridge.dropped) == pytest.approx(3021, abs=6)


@pytest.mark.parametrize(("cob_id", "is_taken"), [(0x710, True), (0x190, True), (0x711, False)])
def test_second_rig_of_the_same_node_id_is_noticed(cob_id: int, is_taken: bool) -> None:
    with EchoingBus() as bus:
        bus.heard.append(frame(cob_id, b"\x05"))
        assert taken(bus, 16, until_s=0.0) is is_taken


def test_runs_for_its_duration_and_reports(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ready, log = tmp_path / "ready", tmp_path / "dropped.csv"
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    virtual = ["-i", "virtual", "-c", "rig process test"]
    with can.Bus(interface="virtual", channel="rig process test") as bus:
        status = main(
            [
                *virtual,
                *("--duration-s", "0.15", "--node-id", "42", "--set", "cable.friction=0.3"),
                *("--ready-file", str(ready), "--drop-log", str(log)),
            ]
        )
        first = bus.recv(0)
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    assert status == 0
    assert first is not None
    assert (first.arbitration_id, bytes(first.data)) == (0x700 + 42, b"\x00")
    assert ready.read_text() == "ready\n"
    assert log.read_text() == "time_s,cob_id,data\n"
    said = capsys.readouterr().err
    assert "rig: ready: node 42" in said
    assert "stopped after 0.15" in said


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--node-id", "0"], "--node-id"),
        (["--drop-probability", "2"], "found 2.0; accepted: 0 to 1"),
        (["--set", "cable.friction=lots"], "rig.cable.friction: found 'lots'"),
        (["--set", "elements=3"], "rig: found 'elements=3'"),
        (["--operator-frequency-hz", "-1"], "frequency_hz: found -1.0; accepted: 0 or above"),
        (["--operator", "dancing"], "--operator"),
    ],
)
def test_bad_usage_is_one_line_and_status_2(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["-i", "virtual", *arguments])
    assert ended.value.code == 2
    last_line = capsys.readouterr().err.strip().splitlines()[-1]
    assert complaint in last_line


def test_bus_that_cannot_be_opened_is_one_line_and_status_3(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["-i", "slcan", "-c", "/dev/no-such-adapter"]) == 3
    said = capsys.readouterr().err
    assert said.startswith("rig: cannot open the bus: ")
    assert "/dev/no-such-adapter" in said
    assert said.count("\n") == 1


def test_missing_firmware_is_one_line_that_names_the_cure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(emulated, "ELF", tmp_path / "bowden.elf")
    assert main(["-i", "virtual", "-c", "no firmware", "--target", "emulated"]) == 3
    said = capsys.readouterr().err
    assert said == f"rig: {tmp_path / 'bowden.elf'} is missing; run 'make firmware'\n"


@NEEDS_ELF
def test_emulated_board_as_a_process(capsys: pytest.CaptureFixture[str]) -> None:
    on = ["-i", "virtual", "-c", "emulated rig process", "--target", "emulated"]
    with can.Bus(interface="virtual", channel="emulated rig process") as bus:
        assert main([*on, "--duration-s", "0.1"]) == 0
        first = bus.recv(0)
    assert first is not None
    assert (first.arbitration_id, bytes(first.data)) == (0x710, b"\x00")
    assert "rig: ready: node 16, emulated target" in capsys.readouterr().err
    assert main([*on, "--node-id", "17"]) == 2
    assert capsys.readouterr().err == (
        "rig: node id: found 17; accepted: 16, which is in the ELF\n"
    )


@pytest.fixture
def multicast() -> None:
    """Skip where the machine has no route for multicast (a container without network)."""
    try:
        with can.Bus(
            interface="udp_multicast", channel=DEFAULT_CHANNEL, port=PORT, hop_limit=0
        ) as bus:
            bus.send(frame(0x7FF, b""))
            heard = bus.recv(1.0)
    except can.CanError as error:
        pytest.skip(f"no multicast on this machine: {error}")
    if heard is None:
        pytest.skip("multicast does not come back on this machine")


@pytest.mark.usefixtures("multicast")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_process_serves_a_host_and_ends_cleanly_on_a_signal(number: signal.Signals) -> None:
    with (
        can.Bus(interface="udp_multicast", channel=DEFAULT_CHANNEL, port=PORT, hop_limit=0) as bus,
        subprocess.Popen([*COMMAND, *BUS], stderr=subprocess.PIPE, text=True) as process,
    ):
        assert process.stderr is not None
        try:
            assert process.stderr.readline().startswith("rig: ready")
            bus.send(frame(0x610, struct.pack("<BHBI", 0x40, 0x1000, 0, 0)))
            bus.set_filters([{"can_id": 0x590, "can_mask": 0x7FF}])
            answer = bus.recv(HANGS_S)
            assert answer is not None
            assert bytes(answer.data) == bytes.fromhex("4300100092010200")
            process.send_signal(number)
            said = process.stderr.read()
            assert process.wait(HANGS_S) == 0
            assert said.startswith("rig: stopped after ")
            assert said.count("\n") == 1
        finally:
            process.kill()


@pytest.mark.usefixtures("multicast")
def test_process_dies_with_the_one_that_started_it() -> None:
    starter = (
        "import subprocess, sys;"
        f"rig = subprocess.Popen({[*COMMAND, *BUS]!r}, stderr=subprocess.PIPE, text=True);"
        "rig.stderr.readline(); print(rig.pid, flush=True); sys.stdin.readline()"
    )
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", starter],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as parent:
        assert parent.stdout is not None
        rig = os.pidfd_open(int(parent.stdout.readline()))
        try:
            assert not select.select([rig], [], [], 0)[0]
            parent.kill()
            assert select.select([rig], [], [], HANGS_S)[0]
        finally:
            os.close(rig)
