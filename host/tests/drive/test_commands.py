"""The commands that talk to a drive, from arguments to exit status, on the real firmware."""

from __future__ import annotations

import json
from pathlib import Path

import can
import pytest
from bowden.cli.main import main
from bowden.drive import client
from bowden.recording.read import read_recording
from bowden_rig.virtual_bus import VirtualBus


def document(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


@pytest.mark.usefixtures("bus")
def test_scan(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", "--json"]) == 0
    (node,) = document(capsys)["nodes"]
    assert node["node_id"] == 16
    assert node["dictionary_matches"] is True


@pytest.mark.usefixtures("bus")
def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--json"]) == 0
    shown = capsys.readouterr()
    info = json.loads(shown.out)
    assert info["name"] == "bowden drive"
    assert info["power_state"] == "switch on disabled"
    assert info["error_history"] == []
    assert info["last_reset"] == "power-on"
    assert info["crash"] is None
    assert info["measured"]["bus_voltage"]["unit"] == "V"
    assert "bowden drive" in shown.err


def test_info_shows_past_errors(bus: VirtualBus, capsys: pytest.CaptureFixture[str]) -> None:
    bus.bench.target.send(
        can.Message(arbitration_id=0x210, data=b"\x00", is_extended_id=False)  # too short
    )
    bus.send(can.Message(arbitration_id=0, data=b"\x01\x10", is_extended_id=False))
    bus.advance(0.01)
    bus.send(can.Message(arbitration_id=0x210, data=b"\x00", is_extended_id=False))
    bus.advance(0.05)
    assert main(["info", "--json"]) == 0
    assert any("8210h" in error for error in document(capsys)["error_history"])


@pytest.mark.usefixtures("bus")
def test_configure_shows_writes_and_finds_nothing_more_to_do(
    model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model.write_text(model.read_text().replace("mu_d: 0.21", "mu_d: 0.25"))
    arguments = ["configure", str(model), "--segments", "10", "--json"]
    arguments += ["--tunnel-half-width", "0.1", "--tunnel-angle", "motor"]
    assert main([*arguments, "--dry-run"]) == 0
    planned = document(capsys)
    assert planned["written"] is False
    wanted = {change["name"]: change["wanted"] for change in planned["changes"]}
    assert wanted["friction_dynamic"] == 0.25
    assert wanted["cable_segments"] == 10
    assert wanted["segment_length.10"] == pytest.approx(0.2)
    assert wanted["tunnel_half_width"] == pytest.approx(0.1)
    assert wanted["tunnel_angle_source"] == 1
    assert "segment_length.11" not in wanted

    assert main(arguments) == 0
    assert document(capsys)["changes"] == planned["changes"]
    assert main(arguments) == 0
    assert document(capsys)["changes"] == []


@pytest.mark.usefixtures("bus")
def test_configure_refuses_what_the_drive_does_not_have(
    model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["configure", str(model), "--segments", "41"]) == 2
    assert "--segments: found 41; accepted: 1 .. 40" in capsys.readouterr().err
    assert main(["configure", str(model), "--tunnel-stiffness", "-1"]) == 2
    assert "tunnel_stiffness: found -1.0; accepted: 0 .. 100 N m/rad" in capsys.readouterr().err
    model.write_text(model.read_text().replace("mu_d", "mu_dynamic"))
    assert main(["configure", str(model)]) == 2
    shown = capsys.readouterr().err
    assert str(model) in shown
    assert shown.count("\n") == 1


@pytest.mark.usefixtures("bus")
def test_configure_resamples_the_path_and_keeps_its_wrap_angle(
    model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = model.read_text()
    start = text.index("    path:")
    end = text.index("    pretension_n:")
    path = "    path: [{length_m: 0.33, radius_m: .inf}, {length_m: 1.67, radius_m: 0.1}]\n"
    model.write_text(text[:start] + path + text[end:])
    assert main(["configure", str(model), "--json"]) == 0
    wanted = {change["name"]: change["wanted"] for change in document(capsys)["changes"]}
    curvature = [wanted[f"segment_curvature.{n}"] for n in range(1, 21)]
    # Segments of 0.1 m: three straight, one with 0.07 m of the bend, the rest bent; 1/R = 10.
    assert curvature == pytest.approx([0, 0, 0, 7, *[10] * 16], abs=1e-6)
    assert 0.1 * sum(curvature) == pytest.approx(1.67 / 0.1)


def test_record_to_a_capture_and_to_csv(
    bus: VirtualBus, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("run.blf", "run.csv"):
        out = tmp_path / name
        arguments = ["record", str(out), "--duration", "0.2", "--enable", "torque"]
        assert main([*arguments, "--torque", "0.05", "--note", "by hand", "--json"]) == 0
        told = document(capsys)
        assert told["recording"] == str(out)
        assert told["frames_lost"] == 0
        recording = read_recording(out)
        assert recording.time_s.size == told["samples"] >= 200
        assert recording.motor_torque_nm.max() == pytest.approx(0.05, abs=5e-3)
        assert recording.metadata["notes"] == "by hand"
        assert recording.metadata["target_torque_nm"] == "0.05"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.blf", "run.blf.json", "run.csv"]
    assert not bus.bench.actuators.bridge_enabled


def test_record_cut_short_to_csv_keeps_the_samples(
    bus: VirtualBus,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    target = bus.bench.target
    receive = target.receive
    monkeypatch.setattr(target, "receive", lambda: None if 0.5 < bus.time_s < 5.0 else receive())
    out = tmp_path / "run.csv"
    assert main(["record", str(out), "--duration", "3", "--enable", "tunnel"]) == 3
    shown = capsys.readouterr().err.splitlines()[-1]
    assert "node 16 has vanished" in shown
    assert "kept and marked as cut" in shown
    recording = read_recording(out)
    assert "vanished" in recording.metadata["cut"]
    assert recording.time_s.size > 100
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run.txt", "--duration", "1"], "OUT.blf or OUT.csv"),
        (["old.blf", "--duration", "1"], "a new name, or --overwrite"),
        (["run.blf", "--duration", "-1"], "--duration"),
        (["run.blf", "--duration", "1", "--torque", "0.1"], "only with --enable torque"),
        (["run.blf", "--duration", "1", "--enable", "torque", "--torque", "99"], "at most 0.5 N m"),
        (["no/run.blf", "--duration", "1"], "No such file"),
    ],
)
def test_record_refuses_what_it_cannot_do(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    told: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("old.blf").write_bytes(b"precious")
    assert main(["record", *arguments]) == 2
    shown = capsys.readouterr().err
    assert told in shown
    assert Path("old.blf").read_bytes() == b"precious"


@pytest.mark.usefixtures("bus")
def test_another_dictionary_is_refused_unless_forced(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "HASH", 0x12345678)
    assert main(["configure", str(model)]) == 3
    assert "12345678h" in capsys.readouterr().err
    assert main(["configure", str(model), "--force"]) == 0


@pytest.mark.usefixtures("bus")
def test_a_wrong_node_id_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--node", "20"]) == 3
    shown = capsys.readouterr().err
    assert shown == ("bowden info: node 20 is not there; heard from node 16: name it with --node\n")
    assert main(["info", "--node", "0"]) == 2
