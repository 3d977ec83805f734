"""The compiled table against the YAML file itself, read here without the generator."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

SOURCE = Path(__file__).resolve().parents[3] / "shared" / "object_dictionary.yaml"
SIZE = {"u8": 1, "u16": 2, "u32": 4, "i8": 1, "i16": 2, "i24": 3, "i32": 4}


def entries() -> Iterator[tuple[int, int, dict[str, Any]]]:
    for entry in YAML(typ="safe", pure=True).load(SOURCE.read_text())["entries"]:
        if "subs" in entry:
            yield from ((entry["index"], i, sub) for i, sub in enumerate(entry["subs"], 1))
        elif "array" in entry:
            yield from ((entry["index"], i, entry) for i in range(1, entry["array"] + 1))
        else:
            yield entry["index"], 0, entry


ENTRIES = list(entries())
NUMBERS = [e for e in ENTRIES if e[2]["type"] not in ("string", "domain")]


SIGNED = (0x1010, 0x1011)  # take a signature alone: hil_tests/test_storage.py


def raw(value: int, entry: dict[str, Any]) -> bytes | None:
    signed = entry["type"].startswith("i")
    try:
        return value.to_bytes(SIZE[entry["type"]], "little", signed=signed)
    except OverflowError:
        return None


def test_defaults_after_power_on(node: Any) -> None:
    for index, sub, entry in NUMBERS:
        value = node.read(index, sub)
        if index == 0x1003:
            assert value == 0x08000024
        elif entry.get("default") != "schema_hash":
            expected = entry.get("default", 0) + (16 if entry.get("node_id_added") else 0)
            assert value == raw(expected, entry), entry["name"]


def test_limits_hold_to_the_last_unit(node: Any) -> None:
    checked = 0
    for index, sub, entry in NUMBERS:
        if entry["access"] != "rw" or index in SIGNED:
            continue
        signed, bits = entry["type"].startswith("i"), 8 * SIZE[entry["type"]]
        whole = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        if isinstance(named := entry.get("values"), list):
            whole = (min(v["value"] for v in named), max(v["value"] for v in named))
        low, high = entry.get("range", whole)
        for value, expected in ((low, 0), (high, 0), (low - 1, 0x06090032), (high + 1, 0x06090031)):
            data = raw(value, entry)
            if data is not None:
                assert node.write(index, sub, data) == expected, (entry["name"], value)
                checked += 1
        assert node.read(index, sub) == raw(high, entry)
    assert checked > 250


def test_of_values_with_gaps_between_them_only_the_named_ones_are_taken(node: Any) -> None:
    """Not from the generated list, but from the file: whatever lies between two named values."""
    checked = 0
    for index, sub, entry in NUMBERS:
        named = [v["value"] for v in entry.get("values", []) if isinstance(v, dict)]
        if entry["access"] == "rw" and named and entry["role"] != "command":
            for value in sorted({v + step for v in named for step in (-1, 0, 1)}):
                if min(named) <= value <= max(named):
                    expected = 0 if value in named else 0x06090030
                    assert node.write(index, sub, raw(value, entry)) == expected, entry["name"]
                    checked += value not in named
    assert checked >= 6  # below and above each gap of the bit rates at least


@pytest.mark.parametrize("access", ["const", "ro"])
def test_what_nobody_may_write_nobody_can(node: Any, access: str) -> None:
    for index, sub, entry in NUMBERS:
        if entry["access"] == access:
            assert node.write(index, sub, bytes(SIZE[entry["type"]])) == 0x06010002, entry["name"]


def test_values_of_an_array_lie_side_by_side_for_every_type(node: Any) -> None:
    """A table of its own: the drive's has no array of each type."""
    ffi, lib = node.ffi, node.lib
    types = (("int32_t", lib.OD_I24, 3), ("int16_t", lib.OD_I16, 2), ("int8_t", lib.OD_I8, 1))
    for name, kind, size in types:
        values = ffi.new(f"{name}[4]", [-1, -2, -3, -4])
        entry = ffi.new("od_entry_t *")
        entry.index, entry.sub, entry.count, entry.type = 0x3000, 0, 4, kind
        entry.flags, entry.low, entry.high = lib.OD_READ | lib.OD_WRITE, 2**32 - 100, 100
        od = ffi.new("od_t *", {"entries": entry, "count": 1, "values": values})
        inside, outside = ((v).to_bytes(size, "little", signed=True) for v in (-30, -101))
        assert lib.od_write(od, 0x3000, 2, inside, size) == 0
        assert lib.od_write(od, 0x3000, 2, outside, size) == 0x06090032
        assert list(values) == [-1, -2, -30, -4]
        assert lib.od_value(od, 0x3000, 3) == 2**32 - 4


def test_rows_are_sorted_and_every_object_has_a_sub_0(node: Any) -> None:
    rows = [(row.index, row.sub, row.count) for row in node.lib.DICTIONARY]
    assert rows == sorted(rows)
    for before, row in itertools.pairwise(rows):
        if before[0] == row[0]:
            assert before[1] + before[2] <= row[1]
        else:
            assert row[1] == 0
