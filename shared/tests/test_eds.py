"""The EDS as the `canopen` package reads it, against the YAML file read without the generator."""

from __future__ import annotations

from collections.abc import Iterator
from configparser import RawConfigParser
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ODArray, ODRecord, ODVariable
from ruamel.yaml import YAML

from shared.dictionary.outputs import ROOT, SOURCE

EDS = ROOT / "shared" / "generated" / "bowden.eds"
WITH_UNITS = ROOT / "shared" / "generated" / "bowden-si.eds"
NODE_ID = 16
BITS = {"u8": 8, "u16": 16, "u32": 32, "i8": 8, "i16": 16, "i24": 24, "i32": 32}
# CiA 301, table 44
CODES = {"i8": 2, "i16": 3, "i32": 4, "u8": 5, "u16": 6, "u32": 7, "string": 9, "i24": 0x10}
CODES["domain"] = 0x0F
FILE: dict[str, Any] = YAML(typ="safe", pure=True).load(SOURCE.read_text())


@pytest.fixture(scope="module")
def dictionary() -> canopen.ObjectDictionary:
    return canopen.import_od(str(EDS), node_id=NODE_ID)


def described() -> Iterator[tuple[int, int, dict[str, Any]]]:
    for entry in FILE["entries"]:
        if "subs" in entry:
            yield from ((entry["index"], i, s) for i, s in enumerate(entry["subs"], 1))
        elif "array" in entry:
            yield from ((entry["index"], i, entry) for i in range(1, entry["array"] + 1))
        else:
            yield entry["index"], 0, entry


def at(dictionary: canopen.ObjectDictionary, index: int, sub: int) -> ODVariable:
    obj = dictionary[index]
    return obj if isinstance(obj, ODVariable) else obj[sub]


def test_values_and_bits_stand_among_the_comments() -> None:
    parser = RawConfigParser()
    parser.read_string(EDS.read_text(encoding="ascii"))
    comments = dict(parser["Comments"])
    assert "2130sub0 compensation_law value 5 model_inversion: model inversion" in comments.values()
    assert "6041sub0 statusword bit 3 fault: fault" in comments.values()
    assert int(comments["lines"]) == len(comments) - 1


def test_every_entry_comes_back(dictionary: canopen.ObjectDictionary) -> None:
    for index, sub, entry in described():
        variable = at(dictionary, index, sub)
        assert variable.data_type == CODES[entry["type"]], entry["name"]
        access = "rww" if entry.get("pdo") == "rx" else entry["access"]
        assert variable.access_type == access, entry["name"]
        assert variable.pdo_mappable == ("pdo" in entry), entry["name"]
        if entry["type"] != "i24":  # canopen 2.4.1 drops the limits of INTEGER24
            limits = entry.get("range", (None, None))
            if "values" in entry and entry["access"] == "rw":
                numbers = [meaning["value"] for meaning in entry["values"]]
                limits = (min(numbers), max(numbers))
            assert (variable.min, variable.max) == tuple(limits), entry["name"]
        default = entry.get("default", 0)
        if default == "schema_hash" or entry["type"] == "domain":
            continue
        relative = bool(entry.get("node_id_added"))
        assert variable.relative == relative, entry["name"]
        assert variable.default == (default + NODE_ID if relative else default), entry["name"]


def test_limits_of_24_bit_entries_stand_in_the_file() -> None:
    eds = RawConfigParser()
    eds.read(EDS, encoding="ascii")
    assert eds.get("2040", "LowLimit") == "-8388607"
    assert eds.get("2040", "HighLimit") == "8388607"


def test_nothing_else_is_in_it_but_the_pdo_parameters(
    dictionary: canopen.ObjectDictionary,
) -> None:
    expected = {entry["index"] for entry in FILE["entries"]}
    for kind, base in (("rpdo", 0x1400), ("tpdo", 0x1800)):
        for pdo in FILE["pdos"][kind]:
            expected |= {base + pdo["number"] - 1, base + 0x200 + pdo["number"] - 1}
    assert set(dictionary) == expected


def test_kinds_and_sub_counts(dictionary: canopen.ObjectDictionary) -> None:
    for entry in FILE["entries"]:
        obj = dictionary[entry["index"]]
        if "subs" in entry:
            assert isinstance(obj, ODRecord)
            assert len(obj.subindices) == len(entry["subs"]) + 1
            assert obj[0].default == len(entry["subs"])
        elif "array" in entry:
            assert isinstance(obj, ODArray)
            assert len(obj.subindices) == entry["array"] + 1


def test_pdo_parameters(dictionary: canopen.ObjectDictionary) -> None:
    addresses = {}
    for index, sub, entry in described():
        addresses[entry["name"]] = (index, sub, BITS.get(entry["type"], 0))
    for kind, base in (("rpdo", 0x1400), ("tpdo", 0x1800)):
        for pdo in FILE["pdos"][kind]:
            communication: Any = dictionary[base + pdo["number"] - 1]
            flags = 0x4000_0000 if kind == "tpdo" else 0  # no RTR
            flags |= 0 if pdo.get("enabled", True) else 0x8000_0000
            assert communication[1].default == pdo["cob_id"] + NODE_ID + flags
            assert communication[2].default == pdo["type"]
            if kind == "tpdo":
                assert communication[5].default == pdo["event_ms"]
            mapping: Any = dictionary[base + 0x200 + pdo["number"] - 1]
            assert mapping[0].default == len(pdo["map"])
            for slot, name in enumerate(pdo["map"], 1):
                index, sub, bits = addresses[name]
                assert mapping[slot].default == index << 16 | sub << 8 | bits


def test_device(dictionary: canopen.ObjectDictionary) -> None:
    info = dictionary.device_information
    assert info.product_number == FILE["device"]["product_code"]
    assert info.allowed_baudrates == {125_000, 250_000, 500_000, 1_000_000}
    assert (info.nr_of_RXPDO, info.nr_of_TXPDO) == (1, 4)


def test_lists_name_each_object_once() -> None:
    lists, section = [], ""
    for line in EDS.read_text(encoding="ascii").splitlines():
        section = line if line.startswith("[") else section
        if section.endswith("Objects]") and "=0x" in line:
            lists.append(int(line.split("=")[1], 16))
    assert len(lists) == len(set(lists))
    assert set(lists) == set(canopen.import_od(str(EDS), node_id=NODE_ID))


def test_file_is_plain_ascii_without_what_readers_lose() -> None:
    text = Path(EDS).read_text(encoding="ascii")
    assert " ;" not in text
    assert "CompactSubObj" not in text
    assert "DataType=0x0008" not in text  # REAL32


def test_the_other_file_gives_every_entry_its_factor_and_unit() -> None:
    dictionary = canopen.import_od(str(WITH_UNITS), node_id=NODE_ID)
    scaled = 0
    for index, sub, entry in described():
        variable = at(dictionary, index, sub)
        assert variable.factor == entry.get("scale", 1), entry["name"]
        assert variable.unit == entry.get("unit", ""), entry["name"]
        scaled += "scale" in entry
        if "doc" in entry:
            assert variable.description.startswith(entry["doc"].split(";")[0]), entry["name"]
    assert scaled > 100


def test_they_differ_in_nothing_that_the_standard_knows() -> None:
    strict, other = RawConfigParser(), RawConfigParser()
    strict.read(EDS, encoding="ascii")
    other.read(WITH_UNITS, encoding="ascii")
    assert other.sections() == strict.sections()
    for name in strict.sections():
        extra = {} if name == "FileInfo" else dict(strict[name])
        left = dict(other[name])
        assert {key: left.get(key) for key in extra} == extra
        if name != "FileInfo":
            assert set(left) - set(extra) <= {"factor", "unit", "description"}, name
            assert "factor" not in extra
