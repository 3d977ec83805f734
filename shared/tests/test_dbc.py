"""The DBC as cantools reads it: frames made by hand come out in physical units."""

from __future__ import annotations

from typing import Any

import cantools
import pytest
from cantools.database.can import Database
from cantools.database.namedsignalvalue import NamedSignalValue

from shared.dictionary.outputs import ROOT


@pytest.fixture(scope="module")
def database() -> Database:
    found = cantools.database.load_file(ROOT / "shared" / "generated" / "bowden.dbc")
    assert isinstance(found, Database)
    return found


def decode(database: Database, cob_id: int, data: bytes) -> dict[str, Any]:
    values = database.decode_message(cob_id, data)
    assert isinstance(values, dict)
    return values


def test_sample_frame(database: Database) -> None:
    values = decode(database, 0x190, bytes.fromhex("0304 3716 40420f00"))
    assert values == {"sample_counter": 0x0403, "statusword": 0x1637, "device_time": 1.0}


@pytest.mark.parametrize(("cob_id", "prefix"), [(0x290, "motor"), (0x390, "load")])
def test_angle_and_24_bit_torque_with_their_signs(
    database: Database, cob_id: int, prefix: str
) -> None:
    frame = b"\xff" + (-1_500_000).to_bytes(4, "little", signed=True) + bytes.fromhex("000080")
    values = decode(database, cob_id, frame)
    assert values["sample_counter_low"] == 255
    assert values[f"{prefix}_angle"] == pytest.approx(-1.5, abs=1e-12)  # one product in float64
    assert values[f"{prefix}_torque"] == pytest.approx(-8.388608, abs=1e-12)
    message = database.get_message_by_frame_id(cob_id)
    units = {s.name: s.unit for s in message.signals}
    assert units[f"{prefix}_angle"] == "rad"
    assert units[f"{prefix}_torque"] == "N m"
    assert message.cycle_time == 1


def test_command_frame_both_ways(database: Database) -> None:
    command: dict[str, int | float | str | NamedSignalValue] = {
        "controlword": 15,
        "mode_of_operation": "torque",
        "target_torque": -0.25,
    }
    data = database.encode_message("RPDO1", command)
    assert data == bytes.fromhex("0f00 fe") + (-250_000).to_bytes(3, "little", signed=True)
    values = decode(database, 0x210, data)
    assert str(values["mode_of_operation"]) == "torque"
    assert values["target_torque"] == pytest.approx(-0.25)
    assert values["controlword"] == 15


def test_emergency_and_heartbeat_in_words(database: Database) -> None:
    values = decode(database, 0x090, bytes.fromhex("3081 11 2a000000 00"))
    assert str(values["error_code"]) == "heartbeat_lost"
    assert values["error_register"] == 0x11
    assert values["error_detail"] == 42
    assert str(decode(database, 0x710, b"\x7f")["nmt_state"]) == "pre_operational"


def test_frames_are_the_ones_that_can_run_by_themselves(database: Database) -> None:
    ids = {m.frame_id: m.length for m in database.messages}
    assert ids == {0x090: 8, 0x190: 8, 0x210: 6, 0x290: 8, 0x390: 8, 0x490: 8, 0x710: 1}
