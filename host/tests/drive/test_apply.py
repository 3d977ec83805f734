"""`bowden apply`: what of a model goes to the drive, what is refused, and that it arrives."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from bowden.cli.main import main
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.dictionary import ENTRIES
from bowden.drive.reduced_model import reduced_model
from bowden.errors import BadInput
from bowden.model import format_model, parse_model, table_1
from bowden_rig.virtual_bus import VirtualBus

LAG = "effects:\n- {name: frictional_lag, lag_s: 0.01}\n"


def with_effects(model: Path, effects: str) -> None:
    model.write_text(model.read_text().replace("effects: []\n", effects))


def entries(bus: VirtualBus) -> dict[str, int]:
    """Everything that can be configured, as the drive has it."""
    connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
    drive = Drive(connection)
    return {e.name: drive.read_raw(e.name) for e in ENTRIES if e.role == "config"}


def document(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


# ---- the reduction ----


def test_table_1_is_what_the_drive_has_by_default() -> None:
    reduced = reduced_model(table_1())
    assert reduced.folded == reduced.left_out == ()
    by_name = {e.name: e for e in ENTRIES}
    for name, value in reduced.entries.items():
        assert by_name[name].to_raw(value) == by_name[name].default, name


def test_an_extra_wrap_and_a_soft_conduit_are_folded_into_the_numbers(model: Path) -> None:
    with_effects(
        model,
        "effects:\n- {name: wrap_angle_change, extra_wrap_rad: 1.0}\n"
        "- {name: conduit_compliance, stiffness_n_per_m: 2000}\n",
    )
    reduced = reduced_model(parse_model(model.read_text()), segments=10)
    assert reduced.folded == ("wrap_angle_change", "conduit_compliance")
    entries = reduced.entries
    wrap = sum(
        entries[f"segment_length.{n}"] * entries[f"segment_curvature.{n}"] for n in range(1, 11)
    )
    assert wrap == pytest.approx(2.0 / 0.28 + 1.0)
    # EA/L = 2000 N/m in series with as much again: half of it.
    assert entries["cable_axial_stiffness"] == pytest.approx(2000.0)


def test_a_known_inertia_of_the_motor_is_the_drives_too(model: Path) -> None:
    assert "motor_inertia" not in reduced_model(parse_model(model.read_text())).entries
    with_effects(model, "effects:\n- {name: motor_inertia, inertia_kg_m2: 2.5e-5}\n")
    reduced = reduced_model(parse_model(model.read_text()))
    assert reduced.folded == ("motor_inertia",)
    assert reduced.left_out == ()
    assert reduced.entries["motor_inertia"] == 2.5e-5


def test_what_is_left_out_does_not_change_the_rest(model: Path) -> None:
    plain = reduced_model(parse_model(model.read_text()))
    with_effects(model, LAG)
    reduced = reduced_model(parse_model(model.read_text()))
    (left_out,) = reduced.left_out
    assert left_out.startswith("effects[0] frictional_lag (")
    assert reduced.entries == plain.entries


def test_more_segments_than_the_drive_has_are_refused() -> None:
    with pytest.raises(BadInput, match=r"accepted: 1 \.\. 40"):
        reduced_model(table_1(), segments=41)


# ---- the command ----


def test_a_dry_run_shows_the_difference_and_writes_nothing(
    bus: VirtualBus, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model.write_text(model.read_text().replace("mu_d: 0.21", "mu_d: 0.25"))
    before = entries(bus)
    assert main(["apply", str(model), "--dry-run", "--json"]) == 0
    shown = capsys.readouterr()
    told = json.loads(shown.out)
    assert told["written"] is False
    changes = {c["name"]: (c["before"], c["wanted"], c["unit"]) for c in told["changes"]}
    assert changes["friction_dynamic"] == (0.21, 0.25, "1")
    assert "friction_dynamic" in shown.err
    assert "nothing was written" in shown.err
    assert entries(bus) == before


def test_apply_writes_reads_back_and_then_has_nothing_to_do(
    bus: VirtualBus, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model.write_text(model.read_text().replace("mu_d: 0.21", "mu_d: 0.25"))
    arguments = ["apply", str(model), "--segments", "12", "--yes", "--json"]
    arguments += ["--compensation", "model-inversion"]
    assert main(arguments) == 0
    told = document(capsys)
    assert told["written"] is True
    there = entries(bus)
    assert there["friction_dynamic"] == 250_000
    assert there["cable_segments"] == 12
    assert there["compensation_law"] == 5
    assert main(arguments) == 0
    assert document(capsys)["changes"] == []


@pytest.mark.parametrize("command", [["configure"], ["apply", "--yes"]])
@pytest.mark.parametrize("kept", [True, False])
def test_what_was_stored_survives_a_restart_and_nothing_else_does(
    bus: VirtualBus,
    model: Path,
    capsys: pytest.CaptureFixture[str],
    command: list[str],
    kept: bool,
) -> None:
    changed = table_1().with_values({"rig.cable.pretension_n": 12.0})
    model.write_text(format_model(changed))
    assert main([*command, str(model), "--json", *(["--store"] if kept else [])]) == 0
    assert document(capsys)["stored"] is kept
    drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
    drive.nmt("RESET")
    drive.connection.listen(0.5)
    assert drive.read("cable_pretension") == (12.0 if kept else 10.0)


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(("answer", "written"), [("y\n", True), ("n\n", False), ("", False)])
def test_on_a_terminal_it_asks(
    model: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    answer: str,
    written: bool,
) -> None:
    terminal = io.StringIO(answer)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdin", terminal)
    model.write_text(model.read_text().replace("mu_d: 0.21", "mu_d: 0.25"))
    assert main(["apply", str(model), "--json"]) == 0
    shown = capsys.readouterr()
    assert "[y/N]" in shown.err
    assert json.loads(shown.out)["written"] is written


def test_what_the_drive_cannot_run_is_refused_by_name_or_left_out_knowingly(
    bus: VirtualBus, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with_effects(model, LAG)
    before = entries(bus)
    assert main(["apply", str(model), "--yes"]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    for part in (str(model), "effects[0] frictional_lag", "wrap_angle_change", "--without-unsup"):
        assert part in line
    assert entries(bus) == before
    assert main(["apply", str(model), "--yes", "--without-unsupported", "--json"]) == 0
    (left_out,) = document(capsys)["left_out"]
    assert left_out.startswith("effects[0] frictional_lag (")


@pytest.mark.usefixtures("bus")
def test_nobody_to_ask_writes_nothing(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert main(["apply", str(model)]) == 2
    assert "--yes" in capsys.readouterr().err


def test_a_model_that_the_drive_refuses_leaves_the_old_one(
    bus: VirtualBus, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # 100 N on an EA of 10 N: 20 m of stretch
    text = model.read_text().replace("axial_stiffness_n: 4000.0", "axial_stiffness_n: 10.0")
    model.write_text(text.replace("{value: 10.0, tolerance: 10 %}", "100.0"))
    before = entries(bus)
    assert main(["apply", str(model), "--yes"]) == 3
    line = capsys.readouterr().err.splitlines()[-1]
    assert "cable_pretension" in line
    assert "the old configuration is back" in line
    assert entries(bus) == before


# ---- the command that applies in rounds ----


def test_improve_asks_before_the_motor_moves_and_a_no_ends_it(
    bus: VirtualBus,
    model: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = io.StringIO("q\n")
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdin", terminal)
    folder = model.parent / "rounds"
    assert main(["improve", str(model), "--output", str(folder)]) == 130
    shown = capsys.readouterr().err
    assert "the motor will move the load" in shown
    assert "the same command goes on" in shown
    assert not bus.bench.actuators.bridge_enabled
    assert not list((folder / "round-1").iterdir())
