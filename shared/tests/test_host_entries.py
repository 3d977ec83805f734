"""The host's accessors: names, units, ranges and bytes; nothing is clamped."""

from __future__ import annotations

import math

import pytest
from bowden.drive.dictionary import BITRATE, EMERGENCIES, ENTRIES, HASH, RPDOS, TABLE, TPDOS, lookup
from bowden.drive.entry import Entry
from bowden.drive.meaning import NamedValue
from bowden.errors import BadInput
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from shared.dictionary.outputs import SOURCE, build

FILE = YAML(typ="safe", pure=True).load(SOURCE.read_text())
NUMBERS = [e for e in ENTRIES if e.type != "string"]


def test_hash_and_bitrate_are_the_files() -> None:
    assert build(SOURCE.read_text(), "x").hash == HASH == lookup("dictionary_hash").default
    assert BITRATE == 1_000_000


def test_every_entry_of_the_file_is_found_with_what_it_says() -> None:
    for entry in FILE["entries"]:
        names = [entry["name"]]
        values = [entry]
        if "subs" in entry:
            names = [f"{entry['name']}.{sub['name']}" for sub in entry["subs"]]
            values = entry["subs"]
        elif "array" in entry:
            names = [f"{entry['name']}.{i + 1}" for i in range(entry["array"])]
            values = [entry] * entry["array"]
        for name, value in zip(names, values, strict=True):
            found = lookup(name)
            assert (found.index, found.type) == (entry["index"], value["type"])
            assert (found.access, found.role) == (value["access"], value["role"])
            assert (found.unit, found.scale) == (value.get("unit"), value.get("scale"))
            if "range" in value:
                assert [found.low, found.high] == value["range"]


def test_addresses_are_unique_and_found() -> None:
    assert len({(e.index, e.sub) for e in ENTRIES}) == len(ENTRIES)
    for entry in ENTRIES:
        assert TABLE.at(entry.index, entry.sub) is entry
    assert TABLE.at(0x5000, 0) is None


def test_values_in_si() -> None:
    stiffness = lookup("tunnel_stiffness")
    assert stiffness.to_raw(0.5) == 500_000
    assert stiffness.to_value(500_000) == pytest.approx(0.5)
    assert lookup("segment_length.40").to_raw(0.1) == 100_000
    assert lookup("controlword").to_raw(15) == 15


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("motor_pulley_radius", 0.0),
        ("motor_pulley_radius", -0.02),
        ("motor_pulley_radius", 20.0),  # millimetres
        ("tunnel_stiffness", math.nan),
        ("tunnel_stiffness", math.inf),
        ("mode_of_operation", 1),
    ],
)
def test_out_of_range_is_refused_with_the_range_in_the_unit(name: str, value: float) -> None:
    with pytest.raises(BadInput) as caught:
        lookup(name).to_raw(value, where=f"rig.yaml, {name}")
    assert str(caught.value).startswith(f"rig.yaml, {name}: found ")
    if name == "motor_pulley_radius":
        assert caught.value.accepted == "0.001 .. 0.5 m"


def test_unknown_names_are_refused() -> None:
    with pytest.raises(BadInput, match="segment_length"):
        lookup("segment_length.41")


@given(st.sampled_from(NUMBERS), st.data())
def test_raw_and_bytes_and_value_come_back(entry: Entry, data: st.DataObject) -> None:
    if entry.meaning and issubclass(entry.meaning, NamedValue):
        raw = int(data.draw(st.sampled_from(entry.meaning)))
    else:
        raw = data.draw(st.integers(entry.low, entry.high))
    encoded = entry.encode(raw)
    assert len(encoded) == entry.bits // 8
    assert entry.decode(encoded) == raw
    assert entry.to_raw(entry.to_value(raw)) == raw


@given(st.sampled_from(NUMBERS))
def test_nothing_outside_is_encoded(entry: Entry) -> None:
    for raw in (entry.low - 1, entry.high + 1):
        with pytest.raises(BadInput):
            entry.encode(raw)


def test_layouts() -> None:
    assert [(p.name, p.cob_id, p.event_ms, p.size) for p in (*RPDOS, *TPDOS)] == [
        ("rpdo1", 0x200, 0, 6),
        ("tpdo1", 0x180, 1, 8),
        ("tpdo2", 0x280, 1, 8),
        ("tpdo3", 0x380, 1, 8),
        ("tpdo4", 0x480, 1, 8),
    ]
    frame = b"\x07" + (-3).to_bytes(4, "little", signed=True) + b"\xfe\xff\xff"
    raw = TPDOS[1].decode(frame)
    assert raw == {"sample_counter_low": 7, "motor_angle": -3, "motor_torque": -2}
    assert TPDOS[1].encode(raw) == frame
    with pytest.raises(BadInput, match="7 bytes"):
        TPDOS[1].decode(frame[:7])


def test_emergencies_tell_what_to_do() -> None:
    by_code = {e.code: e for e in EMERGENCIES}
    assert by_code[0x8130].name == "heartbeat_lost"
    assert all(e.advice for e in EMERGENCIES if e.code)
