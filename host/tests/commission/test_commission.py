"""From box to model on a rig with swapped wires and wrong scales, in virtual time."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from bowden.cli.main import main
from bowden.commission.job import Declined, Facts
from bowden.commission.run import MODEL_FILE, STEPS, commission, steps_for
from bowden.commission.state import (
    STATE_FILE,
    CommissioningState,
    DoneStep,
    DriveIdentity,
    open_state,
    save_state,
)
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.homing import home_at_index, home_here
from bowden.errors import BadInput, DriveFailed
from bowden.model import parse_model
from bowden.recording.yaml_file import read_yaml
from bowden_rig.rig.parameters import Cable, Operator, Rig

from hil_tests.workshop import Fitter, Wiring, open_workshop
from tools.lent_rig import lent_rig

NOMINAL = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 3500
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 5.5
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
  load_cell_noise_nm: 0.005
friction: {law: coulomb, mu_d: 0.23}
numerics: {solver: mesh_free}
"""
FACTS = Facts(
    angle_rad=1.4,
    angle_tolerance_rad=0.0175,
    weights_kg=(0.5, 1.0, 2.0),
    lever_m=0.1,
    by_hand_s=7.0,
)
#: 5 N, so that the drive's 0.5 N m get through the pulled cable.
#: What the rig is off by: it has 32 masses a cable where the model has a continuum.
OF_THE_RIG = 0.003
CABLE = Cable(pretension_n=5.0, viscous_s_per_m=0.0)


@pytest.fixture
def nominal(tmp_path: Path) -> Path:
    path = tmp_path / "nominal.yaml"
    path.write_text(NOMINAL)
    return path


class Tired(Fitter):
    """Goes home before the torque constant."""

    def ask(self, title: str, moves: str, todo: str) -> None:
        if title == "Torque constant":
            raise Declined
        super().ask(title, moves, todo)


def test_every_wrong_sign_and_scale_is_named_and_the_model_is_right(
    nominal: Path, tmp_path: Path
) -> None:
    wiring = Wiring(
        motor_encoder=-1.0,
        load_encoder=-2.0,
        motor_leads=-1,
        current_gain=1 / 1.12,
        cell_gain=-0.93,
        cell_zero_counts=120,
    )
    folder = tmp_path / "bench"
    drive, bus, fitter = open_workshop(wiring, CABLE)
    tired = Tired(bus, fitter.bench, wiring)
    with pytest.raises(Declined):
        commission(drive, nominal, folder, tired, FACTS)
    found = tired.findings
    assert tired.mended == [
        "load encoder direction: it counts backwards",
        "motor encoder direction: it counts backwards",
        "motor direction: a positive torque turns it backwards",
    ]
    assert found["load cell sign"].verdict == "corrected"
    assert found["load encoder counts"].verdict == "corrected"
    assert drive.read("load_encoder_resolution") == 20000.0
    assert found["motor encoder counts"].verdict == "as stated"
    assert found["load cell gain"].verdict == "corrected"
    assert drive.read("load_cell_gain") == pytest.approx(-200e-6 / 0.93, rel=1e-3)
    assert drive.read("load_cell_zero") == pytest.approx(120.0, abs=1.0)
    # Nothing moves before it was said what will.
    assert [bool(moves) for _, moves, _ in tired.asked][-2:] == [True, True]
    with_motor = {"Winding", "Direction of the motor"}
    assert {title for title, moves, _ in tired.asked if moves} == with_motor
    assert found["winding"].found.startswith("not measured")  # the native drive has none

    # Another day, with a drive that has stored nothing; the wires are as they were mended.
    drive, bus, fitter = open_workshop(wiring, CABLE)
    wiring.hung_nm = None
    state = commission(drive, nominal, folder, fitter, FACTS)
    assert [step.name for step in state.steps] == [step.name for step in steps_for(FACTS)]
    assert fitter.asked[0][0] == "Torque constant"
    assert drive.read("load_cell_zero") == pytest.approx(120.0, abs=1.0)
    constant = fitter.findings["torque constant"]
    assert constant.verdict == "corrected"
    assert constant.low is not None
    assert constant.high is not None
    assert constant.low < 0.060 * 1.12 < constant.high

    model = parse_model((folder / MODEL_FILE).read_text())
    assert model.document.posterior is not None
    assert model.document.posterior.fitted[0].file == "cables.blf"
    truth = {
        "rig.cable.axial_stiffness_n": 4000.0,
        "rig.cable.pretension_n": 5.0,
        "friction.mu_d": 0.21,
    }
    for path, value in truth.items():
        found = fitter.findings[path]
        assert found.low is not None
        assert found.high is not None
        assert found.low * (1 - OF_THE_RIG) < value < found.high * (1 + OF_THE_RIG)
        assert found.high - found.low < 0.05 * value
    assert drive.read("cable_axial_stiffness") == pytest.approx(
        model.value("rig.cable.axial_stiffness_n"), rel=1e-6
    )
    for name in (*state.steps[-2].recordings, STATE_FILE):
        assert (folder / name).exists()
    drive.nmt("RESET")
    bus.advance(0.5)
    assert drive.read("torque_constant") == pytest.approx(constant.value, rel=1e-4)
    bus.shutdown()


def test_a_rig_as_stated_is_left_as_it_is(nominal: Path, tmp_path: Path) -> None:
    drive, bus, fitter = open_workshop(Wiring(), CABLE)
    tired = Tired(bus, fitter.bench, fitter.wiring)
    with pytest.raises(Declined):
        commission(drive, nominal, tmp_path / "bench", tired, FACTS)
    assert tired.mended == []
    verdicts = {what: finding.verdict for what, finding in tired.findings.items()}
    verdicts.pop("current zero")
    assert set(verdicts.values()) == {"as stated"}
    steps = read_yaml(tmp_path / "bench" / STATE_FILE, CommissioningState, "state").steps
    taken = {name: value for step in steps for name, value in step.facts.items()}
    assert taken == FACTS.named(["angle_rad", "angle_tolerance_rad", "weights_kg", "lever_m"])
    bus.shutdown()


def ended(folder: Path, nominal: Path, drive: Drive, facts: Facts = FACTS) -> None:
    """Leave a folder as a commissioning without --learn-index does."""
    identity = DriveIdentity(
        node_id=drive.node_id, serial_number=drive.read_raw("identity.serial_number")
    )
    state = open_state(folder, nominal, identity)
    steps = tuple(
        DoneStep(name=step.name, ended="", facts=facts.named(step.takes))
        for step in steps_for(facts)
    )
    folder.mkdir()
    save_state(folder, state.model_copy(update={"steps": steps}))
    (folder / MODEL_FILE).write_text(NOMINAL)


@pytest.mark.parametrize("homed", [False, True])
def test_index_pulses_are_learned_from_the_zero_that_was_shown_and_stored(
    homed: bool, nominal: Path, tmp_path: Path
) -> None:
    """Also later, by the same command: the zero is asked for again unless it still holds."""
    wants = replace(FACTS, learn_index=True)
    drive, bus, fitter = open_workshop(Wiring(), CABLE)
    ended(folder := tmp_path / "bench", nominal, drive)
    if homed:
        home_here(drive)
    state = commission(drive, nominal, folder, fitter, wants)
    zero = [] if homed else ["Zero of the angles"]
    assert [title for title, _, _ in fitter.asked] == [*zero, "Index pulses", "Keep"]
    assert not any(moves for _, moves, _ in fitter.asked)
    assert [step.name for step in state.steps[-2:]] == ["index", "keep"]
    assert len(state.steps) == len(STEPS)
    learned = {name: drive.read(f"index_position.{name}") for name in ("motor", "load")}
    assert state.steps[-2].written == {f"index_position.{n}": at for n, at in learned.items()}

    target = cast(Any, bus.bench.target)
    target._identity.reset = target._lib.RESET_CAUSE_BROWN_OUT
    target.reset()
    fitter.ask("Home", "", "turn the load to and fro")
    home_at_index(drive)
    moved = bus.bench.rig.sensors.load_encoder_counts + learned["load"]
    # 5 ms of an answer at up to 2.2 rad/s
    assert drive.read("load_angle") == pytest.approx(moved * 2 * math.pi / 10_000, abs=0.011)
    fitter.asked.clear()
    commission(drive, nominal, folder, fitter, wants)
    assert fitter.asked == []
    bus.shutdown()


def test_the_command_adds_the_index_to_what_was_commissioned(
    nominal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "bench"
    weights = ["--weights", "1", "2", "--lever", "0.1", "--yes"]
    command = ["commission", str(nominal), "--output", str(folder), *weights]
    stated = Facts(math.radians(80.0), math.radians(1.0), (1.0, 2.0), 0.1)
    with lent_rig(Rig(operator=Operator(motion="sine", starts="now"))) as bus:
        drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
        ended(folder, nominal, drive, stated)
        assert main([*command, "--learn-index", "--json"]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    assert [step["name"] for step in steps[-2:]] == ["index", "keep"]
    assert set(steps[-2]["written"]) == {"index_position.motor", "index_position.load"}


def test_a_rig_without_index_pulses_is_told_and_keeps_what_is_done(
    nominal: Path, tmp_path: Path
) -> None:
    drive, bus, fitter = open_workshop(Wiring(), CABLE)
    ended(folder := tmp_path / "bench", nominal, drive)
    fitter.bench.amplitude_rad = 0.0  # the load does not come past its pulse
    with pytest.raises(DriveFailed, match=r"no index pulse .* does the encoder have an index"):
        commission(drive, nominal, folder, fitter, replace(FACTS, learn_index=True))
    fitter.asked.clear()
    commission(drive, nominal, folder, fitter, FACTS)
    assert fitter.asked == []
    bus.shutdown()


def test_a_step_that_is_done_is_not_mixed_with_other_facts(nominal: Path, tmp_path: Path) -> None:
    drive, bus, fitter = open_workshop(Wiring(), CABLE)
    ended(folder := tmp_path / "bench", nominal, drive)
    with pytest.raises(BadInput, match=r"weights_kg: found 1 3; accepted: 0.5 1 2, by which load_"):
        commission(drive, nominal, folder, fitter, replace(FACTS, weights_kg=(1.0, 3.0)))
    with pytest.raises(BadInput, match=r"angle_rad: found 1.5; accepted: 1.4, by which counts"):
        commission(drive, nominal, folder, fitter, replace(FACTS, angle_rad=1.5))
    commission(drive, nominal, folder, fitter, FACTS)
    bus.shutdown()


def test_a_fact_of_another_version_is_left_alone(nominal: Path, tmp_path: Path) -> None:
    drive, bus, fitter = open_workshop(Wiring(), CABLE)
    ended(folder := tmp_path / "bench", nominal, drive)
    state = read_yaml(folder / STATE_FILE, CommissioningState, "state")
    steps = tuple(one.model_copy(update={"facts": {"spring_n": (1.0,)}}) for one in state.steps)
    save_state(folder, state.model_copy(update={"steps": steps}))
    assert commission(drive, nominal, folder, fitter, FACTS).steps == steps
    bus.shutdown()


def test_a_folder_belongs_to_one_drive_and_one_model(nominal: Path, tmp_path: Path) -> None:

    drive = DriveIdentity(node_id=16, serial_number=1)
    save_state(tmp_path, open_state(tmp_path, nominal, drive))
    assert open_state(tmp_path, nominal, drive).steps == ()
    other = DriveIdentity(node_id=16, serial_number=2)
    with pytest.raises(BadInput, match=r"serial number 1; accepted: .*serial number 2"):
        open_state(tmp_path, nominal, other)
    nominal.write_text(NOMINAL.replace("3500", "3600"))
    with pytest.raises(BadInput, match="of another model"):
        open_state(tmp_path, nominal, drive)
    (tmp_path / STATE_FILE).write_text("commissioning: 1\nsteps: [{name: 3}]\n")
    with pytest.raises(BadInput, match="drive: missing"):
        open_state(tmp_path, nominal, drive)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--weights", "1", "--lever", "0.1"], "--weights: found 1; accepted: at least two"),
        (["--weights", "1", "1", "--lever", "0.1"], "at least two different weights"),
        (["--weights", "1", "2", "--lever", "0"], "--lever: found 0; accepted: a number above 0"),
        (["--weights", "1", "2", "--lever", "1", "--marks", "5"], "--marks: found 5 deg"),
        (["--weights", "1", "2", "--lever", "1"], "a terminal, or --yes"),
    ],
)
def test_what_cannot_work_is_refused_before_the_bus_is_opened(
    nominal: Path, arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["commission", str(nominal), *arguments]) == 2
    assert told in capsys.readouterr().err.replace("\n", " ")
