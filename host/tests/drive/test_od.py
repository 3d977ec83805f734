"""`bowden od`: one value by its name, in its unit, on the real firmware."""

from __future__ import annotations

import json

import pytest
from bowden.cli.main import main
from bowden.drive.dictionary import ENTRIES
from bowden.drive.entry_text import find, parse, search, shown
from bowden.errors import BadInput
from bowden_rig.virtual_bus import VirtualBus


def document(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


def test_names_addresses_words_and_units() -> None:
    assert find("2121h").name == find("0x2121").name == "tunnel_stiffness"
    assert find("2113h:4").name == "segment_length.4"
    assert shown(find("tunnel_stiffness"), 500_000) == "0.5 N m/rad"
    assert shown(find("tunnel_angle_source"), 1) == "1 motor: motor angle"
    assert parse(find("tunnel_stiffness"), "0.8 N m/rad") == 800_000
    assert parse(find("tunnel_angle_source"), "scaled-motor") == 2
    assert parse(find("controlword"), "switch-on+enable-voltage") == 3
    assert [entry.name for entry in search(["breakaway"])] == ["friction_static"]


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("tunnel_stiffness", "0.8 Nm", "0 .. 100 N m/rad"),
        ("tunnel_stiffness", "101", "0 .. 100 N m/rad"),
        ("tunnel_stiffness", "nan", "0 .. 100 N m/rad"),
        ("tunnel_stiffness", "", "0 .. 100 N m/rad"),
        ("tunnel_angle_source", "handle", "load, motor, scaled-motor"),
    ],
)
def test_a_value_that_does_not_fit_names_what_would(name: str, text: str, told: str) -> None:
    with pytest.raises(BadInput, match=told.replace(".", r"\.")):
        parse(find(name), text)


def test_an_unknown_name_gets_the_nearest() -> None:
    with pytest.raises(BadInput, match="tunnel_stiffness"):
        find("tunel_stifness")


def test_list_and_search_need_no_drive(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["od", "list", "--role", "calibration", "--json"]) == 0
    names = {entry["name"] for entry in document(capsys)["entries"]}
    assert {"torque_constant", "load_cell_gain"} <= names
    assert "tunnel_stiffness" not in names
    assert main(["od", "search", "no_such_thing"]) == 2


@pytest.mark.usefixtures("bus")
def test_read_write_and_read_back(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["od", "write", "tunnel_stiffness=0.8", "--dry-run", "--json"]) == 0
    assert document(capsys)["written"] is False
    assert main(["od", "read", "tunnel_stiffness", "statusword", "--json"]) == 0
    values = {value["name"]: value for value in document(capsys)["values"]}
    assert values["tunnel_stiffness"]["value"] == 0.5
    assert "switch on disabled" in values["statusword"]["text"]

    assert main(["od", "write", "tunnel_stiffness=0.8", "tunnel_angle_source=motor"]) == 0
    capsys.readouterr()
    assert main(["od", "read", "tunnel_stiffness", "tunnel_angle_source", "--json"]) == 0
    assert [value["value"] for value in document(capsys)["values"]] == [0.8, 1.0]


@pytest.mark.usefixtures("bus")
def test_what_is_not_there_yet_is_said_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    """An index pulse that has not come is no count of minus two thousand million."""
    assert main(["od", "read", "index_found"]) == 0
    lines = "".join(capsys.readouterr()).splitlines()
    assert lines[1:] == ["index_found.motor = not seen yet", "index_found.load = not seen yet"]
    assert main(["od", "watch", "index_found.load", "--count", "1", "--json"]) == 0
    assert document(capsys)["samples"][0]["values"] == {"index_found.load": None}
    assert main(["od", "list", "index_found.load", "--json"]) == 0
    assert document(capsys)["entries"][0]["default"] is None
    assert shown(find("index_found.load"), -12) == "-12 count"


@pytest.mark.usefixtures("bus")
def test_one_refused_value_undoes_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    # mu_s below mu_d cannot run: the drive says so only when both are there
    assert main(["od", "write", "tunnel_stiffness=0.8", "friction_static=0.1"]) == 3
    assert "the old configuration is back" in capsys.readouterr().err
    assert main(["od", "read", "tunnel_stiffness", "--json"]) == 0
    assert document(capsys)["values"][0]["value"] == 0.5


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(
    ("assignment", "runs_the_motor"),
    [("controlword=15", True), ("target_torque=0.1", True), ("statusword=0", False)],
)
def test_what_commands_the_motor_is_not_written(
    assignment: str, runs_the_motor: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["od", "write", assignment]) == 2
    told = capsys.readouterr().err
    assert "accepted: a writable entry of role config" in told
    assert ("bowden record --enable" in told) is runs_the_motor


@pytest.mark.usefixtures("bus")
def test_an_array_is_written_without_its_count(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["od", "write", "segment_length=0.05", "segment_length.1=0.15", "--json"]) == 0
    written = {one["name"]: one["wanted"] for one in document(capsys)["changes"]}
    assert written["segment_length.1"] == 0.15
    assert {written[f"segment_length.{n}"] for n in range(2, 41)} == {0.05}


def test_watch_reads_in_the_bus_s_own_time(
    bus: VirtualBus, capsys: pytest.CaptureFixture[str]
) -> None:
    start = bus.time_s
    arguments = ["od", "watch", "bus_voltage", "--period", "0.25", "--count", "4", "--json"]
    assert main(arguments) == 0
    samples = document(capsys)["samples"]
    assert [sample["time_s"] for sample in samples] == pytest.approx([0, 0.25, 0.5, 0.75], abs=0.02)
    assert samples[0]["values"]["bus_voltage"] > 10
    assert bus.time_s - start < 1.0


@pytest.mark.usefixtures("bus")
def test_watch_once_shows_units_and_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", "--once", "--json"]) == 0
    shown = capsys.readouterr().err.splitlines()[1:]
    names = [line.split()[0] for line in shown]
    assert names == [entry.name for entry in ENTRIES if entry.name in names]  # cable by cable
    assert main(["watch", "--once"]) == 0
    shown = capsys.readouterr().err
    assert "switch on disabled" in shown
    assert "bus_voltage = 24 V" in shown
    assert "compensation_active_law = 0 none" in shown
