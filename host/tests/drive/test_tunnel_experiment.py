"""The tunnel on a drive, law by law: real firmware and a rig in virtual time; and the figures of it
against a recording of which everything is known.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.diagnosis.rendering import PrescribedTunnel, judge_rendering
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.errors import BadInput
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden_rig.virtual_bus import VirtualBus

TUNNEL = PrescribedTunnel(
    half_width_rad=0.05, stiffness_nm_per_rad=0.5, torque_limit_nm=0.2, ratio=5.2
)


def recording(friction_nm: float, active: int = 5) -> Recording:
    """Ten seconds at 1 kHz of a load moved against dry friction of the cables."""
    time = np.arange(10_000) * 1e-3
    angle = 0.7 * np.sin(np.pi * time)
    felt = TUNNEL.wanted_nm(angle) - friction_nm * np.sign(np.cos(np.pi * time))
    zero = np.zeros_like(time)
    # the bridge is off in the last second, and the cables drag all the more
    enabled = time < 9.0
    felt[~enabled] -= 5.0
    extra = {
        "compensation_active_law": np.where(time < 6.0, active, 1).astype(float),
        "status": np.where(enabled, 0x1237, 0x1250).astype(float),
    }
    return Recording(
        time,
        motor_angle_rad=zero,
        load_angle_rad=angle,
        motor_torque_nm=zero,
        load_torque_nm=felt,
        channels=extra,
    )


def test_the_wanted_torque_is_equation_7_times_the_ratio() -> None:
    angle = np.array([-1.0, -0.25, -0.05, 0.0, 0.05, 0.25, 1.0])
    wanted = 5.2 * np.array([0.2, 0.1, 0.0, 0.0, 0.0, -0.1, -0.2])
    np.testing.assert_allclose(TUNNEL.wanted_nm(angle), wanted, atol=1e-15)


def test_dry_friction_is_found_as_it_was_put_in() -> None:
    figures = judge_rendering(recording(0.3), TUNNEL, law=5, settle_s=3.0)
    assert figures.rms_error_nm == pytest.approx(0.3)
    assert figures.peak_error_nm == pytest.approx(0.3)
    assert figures.dead_zone_friction_nm == pytest.approx(0.3)
    # 4 x 0.7 rad a stroke and back, every two seconds
    assert figures.loss_w == pytest.approx(0.3 * 4 * 0.7 / 2, rel=2e-2)
    assert figures.full_law_share == pytest.approx(0.5, abs=1e-3)


def test_a_perfect_transmission_has_no_error() -> None:
    figures = judge_rendering(recording(0.0), TUNNEL, law=5, settle_s=3.0)
    assert figures.rms_error_nm == figures.peak_error_nm == figures.dead_zone_friction_nm == 0.0
    assert figures.loss_w == pytest.approx(0.0, abs=1e-6)


def test_a_recording_that_ends_too_early_is_refused() -> None:
    with pytest.raises(BadInput, match="less than 10 s"):
        judge_rendering(recording(0.3), TUNNEL, law=5, settle_s=10.0)


def test_each_law_is_run_recorded_and_judged_and_the_drive_left_as_it_was(
    bus: VirtualBus, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["experiment", "tunnel", "--compensation", "coulomb", "--duration", "4", "--json"]
    assert main([*arguments, "--output", str(tmp_path)]) == 0
    shown = capsys.readouterr()
    told = json.loads(shown.out)
    assert [law["law"] for law in told["laws"]] == ["none", "coulomb"]
    assert told["laws"][0]["ratio_to_none"] == 1.0
    for number, law in enumerate(told["laws"]):
        assert law["full_law_share"] == 1.0
        run = read_recording(tmp_path / law["recording"])
        assert set(run["compensation_active_law"]) == {number}
        enabled = run["status"].astype(int) & 0x6F == 0x27
        wanted = TUNNEL.wanted_nm(run.load_angle_rad[enabled])  # the drive's own defaults
        told_nm = run["wanted_load_torque_nm"][enabled]
        np.testing.assert_allclose(told_nm, wanted, atol=20e-6)
        assert run.metadata["compensation"] == law["law"]
    assert "no compensation" in shown.err
    page = (tmp_path / "report.html").read_text()
    assert page.rstrip().endswith("</html>")
    assert told["finding"] in page.replace("&#x27;", "'")
    drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
    assert drive.read_raw("compensation_law") == 0
    assert drive.read_raw("tpdo4_communication.cob_id") >> 31 == 1


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["1a", "--compensation", "all"], "accepted: experiment tunnel"),
        (["tunnel", "--start-rig"], "--compensation"),
        (["tunnel", "--compensation", "magic"], "invalid choice"),
        (["tunnel", "--compensation", "all", "--duration", "2"], "more than 3"),
        (["tunnel", "--compensation", "all", "--duration", "nan"], "more than 0"),
        (["1a", "--on-drive"], "another --output"),
    ],
)
def test_what_makes_no_sense_is_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    complaint: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tunnel").mkdir()
    (tmp_path / "tunnel" / "locked_as_it_is.blf").touch()  # of an earlier run
    try:
        status = main(["experiment", *arguments])
    except SystemExit as left:
        status = left.code
    assert status == 2
    shown = capsys.readouterr().err
    assert complaint in shown
    assert shown.count("\n") == 1


def test_offline_the_tunnel_is_experiment_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experiment", "tunnel", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["experiment"] == "2"


def test_on_a_rig_of_its_own_and_in_real_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["experiment", "tunnel", "--compensation", "none", "--start-rig", "--json"]
    arguments += ["--duration", "5.5", "--output", str(tmp_path)]
    arguments += ["--set", "cable.friction=0.1", "--set", "cable.viscous_s_per_m=0"]
    status = main(arguments)
    shown = capsys.readouterr()
    if "multicast route" in shown.err:
        pytest.skip(shown.err.splitlines()[-1])
    assert status == 0
    (law,) = json.loads(shown.out)["laws"]
    # The dry friction 2 r_load T0 mu L/R at 5 N, felt in the dead zone; 3 %: the inertia of
    # the motor, which the load carries along.
    assert law["dead_zone_friction_nm"] == pytest.approx(1.56 * 0.1 / 0.21, rel=0.03)
    assert "ready" in (tmp_path / "rig.log").read_text()
