"""Node id and bit rate as the host sets them: by node id, or by serial number where it is taken."""

from __future__ import annotations

import json
from typing import Any

import can
import canopen.lss as peer
import pytest
from bowden.cli.main import main
from bowden_rig.virtual_bus import VirtualBus

Output = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _waits_in_virtual_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer.time, "sleep", lambda _s: None)


def told(capsys: Output, *arguments: str) -> Any:
    capsys.readouterr()
    assert main(["node", "--json", *arguments]) == 0
    return json.loads(capsys.readouterr().out)


def another_node_sends(bus: VirtualBus, node_id: int) -> None:
    bus.send(can.Message(arbitration_id=0x700 + node_id, data=[5], is_extended_id=False))
    bus.advance(0.01)


def test_a_new_node_id_holds_after_the_restart(bus: VirtualBus, capsys: Output) -> None:
    serial = told(capsys)["serial_number"]
    done = told(capsys, "--set-id", "17")
    assert (done["node_id_before"], done["node_id"], done["serial_number"]) == (16, 17, serial)
    found = told(capsys, "--node", "17")
    assert found == {
        "node_id": 17,
        "serial_number": serial,
        "next_start": {"node_id": 17, "bit_rate": 1000},
    }
    bus.advance(0.1)  # its heartbeat, under the new id


def test_a_drive_whose_id_another_has_is_found_and_gets_its_own(
    bus: VirtualBus, capsys: Output
) -> None:
    bus.advance(0.01)
    assert told(capsys, "--find") == {"nodes": []}
    another_node_sends(bus, 16)
    [found] = told(capsys, "--find")["nodes"]
    assert found["product_code"] == 0x0B0DE4
    serial = found["serial_number"]
    assert told(capsys, "--set-id", "21", "--serial", serial)["node_id"] == 21
    assert told(capsys, "--node", "21")["serial_number"] == serial


def test_a_bit_rate_is_stored_for_the_next_power_on(bus: VirtualBus, capsys: Output) -> None:
    assert not told(capsys, "--set-bit-rate", "500")["restarted"]
    bus.bench.target.reset()
    bus.advance(0.01)
    assert told(capsys)["next_start"] == {"node_id": 16, "bit_rate": 500}


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--set-id", "0"], 2, "1 .. 126"),
        (["--set-id", "16"], 2, "nothing is heard"),
        (["--set-id", "17", "--serial", "what"], 2, "hexadecimal"),
        (["--set-id", "17", "--serial", "123456789"], 2, "hexadecimal"),
        (["--set-id", "17", "--serial", "DEADBEEF"], 3, "no drive with serial number DEADBEEFh"),
    ],
)
def test_what_cannot_be_is_refused_in_words(
    bus: VirtualBus, capsys: Output, arguments: list[str], status: int, said: str
) -> None:
    bus.advance(0.1)
    assert main(["node", *arguments]) == status
    assert said in capsys.readouterr().err


def test_a_drive_that_runs_keeps_its_id(bus: VirtualBus, capsys: Output) -> None:
    def send(cob_id: int, text: str) -> None:
        data = bytes.fromhex(text)
        bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        bus.advance(0.002)

    bus.advance(0.01)
    send(0, "0110")
    for word in ("06", "07", "0f"):
        send(0x210, f"{word}00 ff 000000")
    assert bus.bench.actuators.bridge_enabled
    assert main(["node", "--set-id", "17"]) == 3
    assert "its bridge is on" in capsys.readouterr().err
    bus.advance(1.0)  # the command deadline
