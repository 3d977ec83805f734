"""The importer of surgical-tool recordings: on hand-made files of known truth, and on real ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.mrd import TORQUE_NM_PER_COUNT, read_mrd

MEASURED = Path(__file__).resolve().parents[4] / "shared" / "measured" / "mrd_da_vinci_tool"
needs_measured = pytest.mark.skipif(
    not MEASURED.is_dir(), reason=f"measured data not there: {MEASURED}"
)


def stand_file(
    path: Path,
    *,
    motor_sign: int = 1,
    load_sign: int = 1,
    angle_sign: int = 1,
    time_unit: float = 1.0,
    wrap_at: int | None = None,
) -> Path:
    """Write 4 s of a passive rig: 0.1 N m of friction at the motor, 0.02 N m taken by the load."""
    t = np.arange(4000) * 1e-3
    angle = 0.5 * (1 - np.cos(2 * np.pi * t))
    direction = np.sign(np.sin(2 * np.pi * t))
    time = t / time_unit
    if wrap_at is not None:
        time = np.where(np.arange(4000) >= wrap_at, time - time[wrap_at], time)
    torque_m = 315.0 + motor_sign * (0.1 * direction + 0.05) / TORQUE_NM_PER_COUNT
    torque_l = -210.0 + load_sign * (0.02 * direction + 0.05) / TORQUE_NM_PER_COUNT
    torque_l[0] = -210.0
    columns = np.stack(
        [
            time,
            1365 + angle * 8192 / (2 * np.pi),
            torque_m,
            0 * t,
            300 + angle_sign * 0.8 * angle * 4000 / (2 * np.pi),
            torque_l,
            0 * t,
            0 * t,
            0 * t,
            0 * t,
        ],
        axis=1,
    )
    rows = "\n".join(",".join(f"{value:.6f}" for value in row) for row in columns)
    path.write_text(f"%made by hand\n%a note\n%torque0AverageTorque=315.00\n{rows}\n")
    return path


@pytest.mark.parametrize("motor_sign", [1, -1])
@pytest.mark.parametrize("load_sign", [1, -1])
@pytest.mark.parametrize("angle_sign", [1, -1])
def test_signs_follow_from_motion_and_power_flow(
    tmp_path: Path, motor_sign: int, load_sign: int, angle_sign: int
) -> None:
    path = stand_file(
        tmp_path / "run.TXT", motor_sign=motor_sign, load_sign=load_sign, angle_sign=angle_sign
    )
    recording = read_mrd(path)
    assert np.corrcoef(recording.motor_angle_rad, recording.load_angle_rad)[0, 1] > 0.99
    outward = np.gradient(recording.motor_angle_rad) > 1e-4
    # Whichever way the sensors count, the motor pushes and the load resists in the direction of
    # motion, and the constant torque on top goes with them.
    assert recording.motor_torque_nm[outward].mean() == pytest.approx(0.15, abs=2e-3)
    assert recording.load_torque_nm[outward].mean() == pytest.approx(0.07, abs=2e-3)
    assert "sign" in recording.metadata["import_motor_torque"]


def test_time_in_milliseconds_reads_as_in_seconds(tmp_path: Path) -> None:
    seconds = read_mrd(stand_file(tmp_path / "s.TXT"))
    milliseconds = read_mrd(stand_file(tmp_path / "ms.TXT", time_unit=1e-3))
    np.testing.assert_allclose(milliseconds.time_s, seconds.time_s, atol=1e-9)
    assert "milliseconds" in milliseconds.metadata["import_time"]


def test_a_clock_that_wraps_is_joined(tmp_path: Path) -> None:
    recording = read_mrd(stand_file(tmp_path / "wrap.TXT", wrap_at=2500))
    np.testing.assert_allclose(np.diff(recording.time_s), 1e-3, atol=1e-9)
    assert "1 wraps" in recording.metadata["import_time"]


def test_the_distal_zero_can_be_given(tmp_path: Path) -> None:
    path = stand_file(tmp_path / "run.TXT")
    shift = read_mrd(path, distal_zero_counts=-110.0).load_torque_nm - read_mrd(path).load_torque_nm
    np.testing.assert_allclose(shift, -100.0 * TORQUE_NM_PER_COUNT, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("%only a header\n", "no rows"),
        ("%h\n0,1,2\n", "line 2"),
        ("%h\n" + "0,1,2,3,4,5,6,7,8,9\n" * 3 + "0,1,2,3,4,five,6,7,8,9\n", "line 5"),
        ("%h\n0,1,nan,3,4,5,6,7,8,9\n", "line 2"),
        ("%h\n" + "".join(f"{k * 1e-3},1,2,3,4,5,6,7,8,9\n" for k in range(520)), "s of data"),
    ],
)
def test_bad_files_are_refused_with_the_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "bad.TXT"
    path.write_text(text)
    with pytest.raises(BadInput, match=complaint):
        read_mrd(path)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.TXT"):
        read_mrd(tmp_path / "none.TXT")


@needs_measured
@pytest.mark.parametrize("name", ["00", "05", "25", "48"])
def test_real_runs(name: str) -> None:
    recording = read_mrd(MEASURED / f"Tool_5_Maryland_L_3_{name}.TXT")
    rows = {"00": 20000, "05": 20000, "25": 19986, "48": 20000}[name]
    assert recording.time_s.size == rows - 500  # the start-up of 0.5 s at 1 kHz
    assert recording.time_s[-1] == pytest.approx((rows - 501) * 1e-3, abs=1e-6)
    # All twelve runs are of one rig: the signs must come out alike.
    assert "reversed" in recording.metadata["import_angles"]
    assert "reversed" in recording.metadata["import_motor_torque"]
    assert "sign kept" in recording.metadata["import_load_torque"]
    # The trajectory was a sine of 30 degrees; the first half second is cut off.
    assert np.degrees(np.ptp(recording.motor_angle_rad)) == pytest.approx(60.0, abs=2.0)


@needs_measured
def test_real_distal_zeros_agree_between_runs() -> None:
    """The load is off in the first sample of every run, so all must show the sensor's one zero."""
    first_rows = []
    for path in sorted(MEASURED.glob("*.TXT")):
        lines = [line for line in path.read_text().splitlines() if not line.startswith("%")]
        first_rows.append(float(lines[0].split(",")[5]))
    assert len(first_rows) == 12
    assert np.std(first_rows) * TORQUE_NM_PER_COUNT < 0.5e-3  # loaded, they range over 0.12 N m
