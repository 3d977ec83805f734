"""`bowden config`: a drive's configuration in a file, and back into a drive, whole."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path

import canopen
import pytest
from bowden.cli.main import main
from bowden.drive.configuration_file import read_configuration
from bowden.drive.dcf import eds
from bowden.errors import BadInput
from bowden_rig.virtual_bus import VirtualBus


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert main(["config", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize("name", ["drive.yaml", "drive.dcf"])
def test_what_was_dumped_brings_a_changed_drive_back(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    run(capsys, "dump", str(path))
    assert run(capsys, "diff", str(path))["changes"] == []
    main(["od", "write", "tunnel_stiffness=0.8", "segment_length.3=0.05", "torque_constant=0.1"])
    capsys.readouterr()
    changed = {c["name"] for c in run(capsys, "diff", str(path))["changes"]}
    assert changed == {"tunnel_stiffness", "segment_length.3", "torque_constant"}

    planned = run(capsys, "apply", str(path), "--dry-run")
    assert planned["written"] is False
    done = run(capsys, "apply", str(path))
    # Calibration belongs to the drive's sensors: not without being named.
    assert {c["name"] for c in done["changes"]} == {"tunnel_stiffness", "segment_length.3"}
    left = run(capsys, "diff", str(path))["changes"]
    assert [c["name"] for c in left] == ["torque_constant"]
    run(capsys, "apply", str(path), "--role", "calibration")
    assert run(capsys, "diff", str(path))["changes"] == []


@pytest.mark.usefixtures("bus")
def test_a_pdo_mapping_comes_back_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "drive.yaml"
    run(capsys, "dump", str(path), "--role", "communication")
    text = path.read_text()
    # TPDO4 carries the bus voltage (2027h, 32 bits) instead of the wanted torque, and is sent.
    text = text.replace("0x20330018", "0x20270020").replace("0xC0000480", "0x40000480")
    text = text.replace("0x20340018", "0x0").replace("0x20370008", "0x0")
    text = text.replace(
        "tpdo4_mapping.count: {at: 1A03h, value: 4}", "tpdo4_mapping.count: {at: 1A03h, value: 2}"
    )
    changed = tmp_path / "changed.yaml"
    changed.write_text(text)
    done = run(capsys, "apply", str(changed), "--role", "communication")
    assert {"tpdo4_mapping.count", "tpdo4_mapping.object_2"} <= {c["name"] for c in done["changes"]}
    assert run(capsys, "diff", str(changed))["changes"] == []
    run(capsys, "apply", str(path), "--role", "communication")
    assert run(capsys, "diff", str(path))["changes"] == []


@pytest.mark.usefixtures("bus")
def test_store_reset_and_restore(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "drive.yaml"
    run(capsys, "dump", str(path))
    main(["od", "write", "tunnel_stiffness=0.8", "--store"])
    main(["od", "write", "tunnel_stiffness=0.9"])
    capsys.readouterr()
    run(capsys, "reset")
    (change,) = run(capsys, "diff", str(path))["changes"]
    assert change["before"] == pytest.approx(0.8)  # stored; 0.9 is gone
    run(capsys, "restore")
    assert run(capsys, "diff", str(path))["changes"] == []


def old_file(tmp_path: Path, body: str) -> Path:
    path = tmp_path / "old.yaml"
    head = "bowden_configuration: 1\ndrive: {dictionary_hash: 12345678h, serial_number: 7}\n"
    path.write_text(head + body)
    return path


def test_an_older_version_s_names_are_found_by_their_addresses(tmp_path: Path) -> None:
    path = old_file(
        tmp_path,
        "config:\n"
        "  wall_stiffness: {at: 2121h, value: 0.7, unit: N m/rad}\n"
        "  seg_length: {at: '2113h:1', value: [0.2, 0.3], unit: m}\n"
        "  old_gain: {at: 2FFFh, value: 3}\n"
        "  pretension: {at: 2111h, value: 10, unit: kN}\n",
    )
    read = read_configuration(path)
    assert read.renamed == {"wall_stiffness": "tunnel_stiffness", "seg_length": "segment_length"}
    assert read.raw == {
        "tunnel_stiffness": 700_000,
        "segment_length.1": 200_000,
        "segment_length.2": 300_000,
    }
    assert [text.split(" ")[0] for text in read.unknown] == ["config.old_gain", "config.pretension"]
    assert "unit 'N', not 'kN'" in read.unknown[1]


@pytest.mark.usefixtures("bus")
def test_unknown_entries_are_named_and_left_out_only_when_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = old_file(tmp_path, "config:\n  tunnel_stifness: 0.7\n  tunnel_half_width: 0.1\n")
    assert main(["config", "apply", str(path)]) == 2
    assert "tunnel_stiffness" in capsys.readouterr().err
    done = run(capsys, "apply", str(path), "--skip-unknown")
    assert [c["name"] for c in done["changes"]] == ["tunnel_half_width"]


@pytest.mark.usefixtures("bus")
def test_another_drive_s_calibration_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = old_file(tmp_path, "calibration:\n  torque_constant: 0.1\n")
    assert main(["config", "apply", str(path), "--role", "calibration"]) == 2
    assert "00000007h" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("config:\n  tunnel_stiffness: 1000\n", "0 .. 100 N m/rad"),
        ("config:\n  tunnel_stiffness: {value: 1, unit: mN m/rad}\n", "unit 'N m/rad'"),
        ("config:\n  tunnel_angle_source: handle\n", "load, motor, scaled-motor"),
        ("settings: {}\n", "unknown key"),
        ("config: [1, 2]\n", "dictionary"),
        ("config:\n  tunnel_stiffness: {value: 1\n", "line"),
    ],
)
def test_a_file_that_does_not_fit_is_one_clear_error(body: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=told):
        read_configuration(old_file(tmp_path, body))


@pytest.mark.usefixtures("bus")
def test_the_canopen_package_reads_the_dcf(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An independent reader sees the drive's values, also where its id is added."""
    path = tmp_path / "drive.dcf"
    main(["od", "write", "tunnel_stiffness=0.8"])
    capsys.readouterr()
    run(capsys, "dump", str(path))
    dictionary = canopen.import_od(str(path), node_id=16)
    assert dictionary[0x2121].value == 800_000
    assert dictionary["segment_length"][1].value == 100_000
    assert dictionary[0x1800][1].value == 0x40000180 + 16


def test_a_dcf_without_values_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "empty.dcf"
    path.write_text("[FileInfo]\nFileName=x\n")
    with pytest.raises(BadInput, match="no ParameterValue"):
        read_configuration(path)


def test_existing_files_stay(bus: VirtualBus, tmp_path: Path) -> None:
    path = tmp_path / "drive.yaml"
    path.write_text("mine")
    assert main(["config", "dump", str(path)]) == 2
    assert path.read_text() == "mine"
    assert bus.time_s == 0


def test_an_installation_has_the_eds_with_units_for_the_canopen_package() -> None:
    text = StringIO(eds(with_units=True))
    text.name = "bowden-si.eds"
    entry = canopen.import_od(text)["tunnel_stiffness"]
    assert (entry.factor, entry.unit) == (1e-6, "N m/rad")
    assert "Factor" not in eds()
