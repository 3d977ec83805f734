"""`bowden doctor`: each fault is found and comes with advice."""

from __future__ import annotations

import json
from collections.abc import Callable

import can
import numpy as np
import pytest
from bowden.cli import doctor
from bowden.cli.main import main
from bowden.drive import checks
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.errors import DriveFailed
from bowden.recording.recording import Recording
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus


def states(found: dict) -> dict[str, str]:
    return {one["check"]: one["state"] for one in found["checks"]}


@pytest.mark.usefixtures("bus")
def test_a_fresh_drive_is_well_but_not_configured(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert states(found) == {
        "adapter": "ok",
        "bus": "ok",
        "node": "ok",
        "dictionary": "ok",
        "firmware": "ok",
        "configuration": "warning",
        "faults": "ok",
        "zero": "ok",
        "supply": "ok",
        "sensors": "ok",
        "signs": "not checked",
    }
    assert "bowden configure" in found["next"]


@pytest.mark.usefixtures("bus")
def test_a_wrong_node_id_ends_with_what_was_received(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--node", "20", "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["failed"] == ["node"]
    assert "heard from node 16" in found["checks"][-1]["found"]


@pytest.mark.usefixtures("bus")
def test_another_dictionary_is_a_failed_check(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks, "HASH", 0x12345678)
    assert main(["doctor", "--json"]) == 3
    assert states(json.loads(capsys.readouterr().out))["dictionary"] == "failed"


def test_no_adapter_is_a_failed_check(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_options: object) -> Connection:
        raise DriveFailed("cannot open the CAN bus")

    monkeypatch.setattr(doctor, "open_connection", fail)
    assert main(["doctor", "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["failed"] == ["adapter"]


@pytest.mark.parametrize(("frames", "state"), [(None, "ok"), (253, "warning"), (80_000, "ok")])
def test_a_socket_that_holds_few_frames_is_a_warning_with_the_cure(
    silent: Callable[..., tuple], frames: int | None, state: str
) -> None:
    connection, _ = silent()
    connection.receive_buffer_frames = frames
    finding = checks.check_adapter(connection)
    assert finding.state == state
    assert ("net.core.rmem_max" in finding.todo) == (state == "warning")


def test_error_frames_point_at_the_bit_rate(silent: Callable[..., tuple]) -> None:
    connection, _ = silent(frames=[can.Message(is_error_frame=True) for _ in range(5)])
    finding = checks.check_bus(Drive(connection))
    assert finding.state == "failed"
    assert "-b 1000000" in finding.todo


def moved_by_hand() -> tuple[Recording, float]:
    operator = Operator(motion="sine", starts="now")
    bench = Bench(SimulatedRig(Rig(operator=operator)), make_target("native"), trace=True)
    bus = VirtualBus(bench)
    bus.advance(4.0)
    truth = bench.truth()
    keep = slice(None, None, 4)
    return (
        Recording(
            truth.time_s[keep],
            motor_angle_rad=truth.motor_angle_rad[keep],
            load_angle_rad=truth.load_angle_rad[keep],
            load_torque_nm=truth.load_torque_nm[keep],
        ),
        0.104 / 0.020,
    )


def test_signs_from_a_load_moved_by_hand() -> None:
    recording, ratio = moved_by_hand()
    assert [one.state for one in checks.check_signs(recording, ratio)] == ["ok", "ok"]

    swapped = recording.with_channels(motor_angle_rad=-recording.motor_angle_rad)
    assert [one.state for one in checks.check_signs(swapped, ratio)] == ["failed", "ok"]
    negated = recording.with_channels(load_torque_nm=-recording.load_torque_nm)
    assert [one.state for one in checks.check_signs(negated, ratio)] == ["ok", "failed"]
    assert checks.check_signs(recording, 2 * ratio)[0].state == "warning"
    still = recording.with_channels(load_angle_rad=np.zeros(recording.time_s.size))
    assert checks.check_signs(still, ratio)[0].state == "not checked"
