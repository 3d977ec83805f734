"""Tables of the drive from the host's side: applied whole, read back, in files, refused by name."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import canopen
import numpy as np
import pytest
from bowden.cli.main import main
from bowden.drive.checks import check_configuration
from bowden.drive.client import Drive
from bowden.drive.configuration import Change, difference, write
from bowden.drive.dcf import eds
from bowden.drive.dictionary import lookup
from bowden.drive.entry_text import parse, plain, shown
from bowden.drive.meanings import ModeOfOperation, TableArgument, TableDirection, TablePlace
from bowden.drive.power import Run, enable
from bowden.drive.table_layout import TableFields
from bowden.drive.tables import DriveTable, table_entries
from bowden.errors import BadInput, DriveFailed
from bowden_rig.virtual_bus import VirtualBus
from hypothesis import given
from hypothesis import strategies as st

MakeRig = Callable[..., tuple[Drive, VirtualBus]]

ANGLE_RAD = np.linspace(-0.8, 0.8, 33)
FRICTION = DriveTable(TablePlace.FRICTION_FACTOR, 0.2 * np.sin(ANGLE_RAD), first=-0.8, span=1.6)
LOSS = DriveTable(TablePlace.LOAD_TORQUE, np.array([2.4]), direction=TableDirection.POSITIVE)
ENTRY = lookup("table.1")

i32 = st.integers(-(2**31), 2**31 - 1)


tables = st.builds(
    TableFields,
    st.sampled_from(list(TablePlace)[1:]),
    st.sampled_from(list(TableArgument)),
    st.sampled_from(list(TableDirection)),
    st.booleans(),
    i32,
    st.integers(0, 2**32 - 1),
    st.lists(i32, min_size=1, max_size=33).map(tuple),
)


@given(tables)
def test_a_table_comes_back_from_bytes_and_from_a_file(fields: TableFields) -> None:
    raw = fields.to_raw()
    assert TableFields.of_raw(raw) == fields
    assert parse(ENTRY, plain(ENTRY, raw)) == raw
    assert parse(ENTRY, json.dumps(plain(ENTRY, raw))) == raw


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("x", "none, or a table"),
        (7, "TableFile: 7"),
        ({"place": "handle", "values": [1]}, "friction-factor"),
        ({"place": "load-torque", "values": []}, "values"),
        ({"place": "load-torque", "values": [0.0] * 34}, "values"),
        ({"place": "load-torque", "values": [1e9]}, "32 bits"),
        ({"place": "load-torque", "values": [1], "span": float("nan")}, "span"),
        ({"place": "load-torque", "values": [1], "knots": 3}, "knots"),
    ],
)
def test_what_is_no_table_is_named(value: object, told: str) -> None:
    with pytest.raises(BadInput, match=told):
        parse(ENTRY, value)  # type: ignore[arg-type]


def test_tables_are_written_read_back_and_taken_away(rig: MakeRig) -> None:
    drive, _ = rig()
    wanted = table_entries((FRICTION, LOSS))
    changes = difference(drive, wanted)
    assert [c.name for c in changes] == ["table.1", "table.2", "table_version"]
    write(drive, changes)
    assert difference(drive, wanted) == []
    assert shown(ENTRY, drive.read_raw("table.1")).startswith("friction-factor over load-angle, 33")
    write(drive, difference(drive, table_entries(())))
    assert drive.read_raw("table.1") == drive.read_raw("table_version") == 0


def test_a_refused_table_is_named_with_its_cause_and_all_is_as_before(rig: MakeRig) -> None:
    """2.4 N m of loss are within the friction at 10 N, 3.12 N m, and beyond that at 7 N."""
    drive, _ = rig()
    write(drive, difference(drive, table_entries((FRICTION,))))
    wanted = table_entries((LOSS,)) | {"cable_pretension": 7.0}
    with pytest.raises(DriveFailed, match=r"table\.1 = load-torque .*more than the friction.*back"):
        write(drive, difference(drive, wanted))
    assert drive.read("cable_pretension") == 10.0
    assert difference(drive, table_entries((FRICTION,))) == []
    assert drive.read_raw("configuration_error") == 0


def test_a_table_that_no_longer_fits_is_named_with_its_cause(rig: MakeRig) -> None:
    """Another program writes the pretension."""
    drive, _ = rig()
    write(drive, difference(drive, table_entries((LOSS,))))
    drive.write("cable_pretension", 7.0)
    drive.connection.listen(0.01)
    found = check_configuration(drive)
    assert found.state == "failed"
    assert "table.1 (a torque that depends on direction" in found.found
    with pytest.raises(DriveFailed, match=r"cannot run with its table\.1 \(a torque"):
        enable(drive, Run(ModeOfOperation.TORQUE))


def test_a_table_that_only_the_old_cables_fit_comes_back_with_them(rig: MakeRig) -> None:
    drive, _ = rig()
    write(drive, difference(drive, table_entries((LOSS,))))
    wanted = table_entries((FRICTION,)) | {"cable_pretension": 7.0, "friction_static": 0.1}
    with pytest.raises(DriveFailed, match=r"cannot run.*friction.*the old configuration is back"):
        write(drive, difference(drive, wanted))
    assert difference(drive, table_entries((LOSS,)) | {"cable_pretension": 10.0}) == []


def test_tables_come_after_what_they_must_fit(rig: MakeRig) -> None:
    """The list has the table first, and 15 N allow it, not 10 N."""
    drive, _ = rig()
    more = DriveTable(LOSS.place, np.array([4.5]), direction=LOSS.direction)
    changes = [
        Change("table.1", 0, more.to_raw()),
        Change("motor_torque_limit", 500_000, 1_500_000),
        Change("cable_pretension", 10_000_000, 15_000_000),
    ]
    write(drive, changes)
    assert drive.read_raw("table.1") == more.to_raw()


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize("name", ["drive.yaml", "drive.dcf"])
def test_a_dumped_table_brings_a_changed_drive_back(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    text = json.dumps(plain(ENTRY, FRICTION.to_raw()))
    main(["od", "write", f"table.3={text}"])
    run(capsys, "config", "dump", str(path))
    main(["od", "write", "table.3=none"])
    capsys.readouterr()
    (change,) = run(capsys, "config", "diff", str(path))["changes"]
    assert (change["name"], change["before"]) == ("table.3", "none")
    assert change["wanted"] == json.loads(text)
    assert run(capsys, "config", "apply", str(path), "--dry-run")["written"] is False
    assert main(["config", "apply", str(path)]) == 0
    assert "33 knots" in capsys.readouterr().err
    assert run(capsys, "config", "diff", str(path))["changes"] == []
    (value,) = run(capsys, "od", "read", "table.3")["values"]
    assert value["value"] == json.loads(text)


def test_another_makers_reader_of_the_dcf_has_its_bytes(tmp_path: Path) -> None:
    """The `canopen` package, from the EDS alone: a domain of bytes."""
    path = tmp_path / "drive.eds"
    path.write_text(eds())
    node = canopen.import_od(str(path), node_id=16)
    assert node[0x2162][1].data_type == canopen.objectdictionary.DOMAIN
