"""`bowden stop` and `bowden faults` against the real firmware that another program has enabled."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable

import can
import pytest
from bowden.cli import stop as stop_command
from bowden.cli.main import main
from bowden.drive.bus_options import BusOptions
from bowden.drive.connection import Connection
from bowden.drive.fault_report import failures
from bowden.drive.meanings import Supervision
from bowden_rig.virtual_bus import VirtualBus

from tools.lent_rig import Lender


def send(bus: VirtualBus, cob_id: int, data: bytes) -> None:
    bus.send(can.Message(arbitration_id=cob_id, is_extended_id=False, data=data))
    bus.advance(0.002)


def another_master_enables(bus: VirtualBus) -> None:
    """A generic master that opts out of the deadline, gives 0.05 N m and exits."""
    bus.advance(0.02)
    send(bus, 0x610, struct.pack("<BHBI", 0x2B, 0x2140, 0, 0))
    bus.advance(0.06)
    send(bus, 0x000, b"\x01\x10")
    for word in (0x06, 0x07, 0x0F):
        send(bus, 0x210, struct.pack("<Hb", word, -2) + (50_000).to_bytes(3, "little"))
    assert bus.bench.actuators.bridge_enabled


@pytest.fixture
def stoppable(bus: VirtualBus, monkeypatch: pytest.MonkeyPatch) -> VirtualBus:
    opened: Callable[[BusOptions], Connection] = Lender(bus).open
    monkeypatch.setattr(stop_command, "open_connection", opened)
    return bus


@pytest.mark.parametrize("which", [["--all"], ["--node", "16"], []])
def test_stop_switches_off_what_another_master_left_on(
    stoppable: VirtualBus, which: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    another_master_enables(stoppable)
    assert main(["stop", *which, "--json"]) == 0
    assert not stoppable.bench.actuators.bridge_enabled
    (node,) = json.loads(capsys.readouterr().out)["nodes"]
    assert node == {"node_id": 16, "power_state": "switch on disabled", "confirmed": True}


def test_stop_says_which_node_has_not_confirmed(
    stoppable: VirtualBus, capsys: pytest.CaptureFixture[str]
) -> None:
    stoppable.advance(0.01)
    assert main(["stop", "--node", "17"]) == 3
    assert "node 17 has not confirmed that its bridge is off: cut its power" in (
        capsys.readouterr().err.replace("\n", " ")
    )


@pytest.mark.parametrize("command", [["info"], ["faults"], ["scan"], ["doctor"]])
def test_a_command_that_meets_a_live_bridge_says_so(
    stoppable: VirtualBus, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    another_master_enables(stoppable)
    main(command)
    assert "bridge" in (shown := capsys.readouterr().err)
    assert "ON" in shown
    main(["stop"])


def test_faults_shows_present_and_latched_and_what_to_do(
    stoppable: VirtualBus, capsys: pytest.CaptureFixture[str]
) -> None:
    stoppable.advance(0.01)
    assert main(["faults", "--json"]) == 0
    clean = json.loads(capsys.readouterr().out)
    assert clean["failures"] == []
    assert clean["deadline_ms"] == 500
    another_master_enables(stoppable)
    send(stoppable, 0x610, struct.pack("<BHBI", 0x2B, 0x6040, 0, 0))
    send(stoppable, 0x610, struct.pack("<BHBI", 0x2B, 0x2140, 0, 500))
    stoppable.advance(0.06)
    for word in (0x06, 0x07, 0x0F):
        send(stoppable, 0x210, struct.pack("<Hb", word, -2) + bytes(3))
    stoppable.advance(0.6)  # no frame is sent
    assert not stoppable.bench.actuators.bridge_enabled
    send(stoppable, 0x000, b"\x01\x10")
    assert main(["faults", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    (failure,) = report["failures"]
    (logged,) = report["log"]
    assert (logged["code"], logged["reset_cause"]) == (0x8131, "power-on")
    assert failure["check"] == "command_late"
    assert failure["present"] is True
    assert failure["code"] == 0x8131
    assert "more often" in failure["advice"]
    assert main(["faults"]) == 0
    assert "command_deadline" in capsys.readouterr().err


def test_bits_become_words_with_the_reason_of_a_refused_reset() -> None:
    present, latched = Supervision.UNDERVOLTAGE, Supervision.UNDERVOLTAGE | Supervision.ENCODER
    encoder, supply = failures(present, latched, refused=present)
    assert (encoder.check, encoder.present, encoder.refused_reset) == ("encoder", False, False)
    assert (supply.check, supply.present, supply.refused_reset) == ("undervoltage", True, True)
    assert supply.limit == "bus_voltage_min"
