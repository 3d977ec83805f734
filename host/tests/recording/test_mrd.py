"""The importer of surgical-tool recordings: on hand-made files of known truth, and on real ones."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.mrd import TORQUE_NM_PER_COUNT, read_mrd, read_mrd_folder

ALL_MEASURED = Path(__file__).resolve().parents[4] / "shared" / "measured"
MEASURED = ALL_MEASURED / "mrd_da_vinci_tool"
ROLL_PITCH = ALL_MEASURED / "mrd_roll_pitch"
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
    starts_at: int = 0,
) -> Path:
    """Write 4 s of a passive rig: 0.1 N m of friction at the motor, 0.02 N m taken by the load."""
    t = np.arange(4000) * 1e-3
    phase = 2 * np.pi * (t + starts_at * 1e-3)
    angle = 0.5 * (1 - np.cos(phase))
    direction = np.sign(np.sin(phase))
    time = t / time_unit
    if wrap_at is not None:
        time = np.where(np.arange(4000) >= wrap_at, time - time[wrap_at], time)
    torque_m = 315.0 + motor_sign * (0.1 * direction + 0.05) / TORQUE_NM_PER_COUNT
    torque_l = -12.0 + load_sign * (0.02 * direction + 0.05) / TORQUE_NM_PER_COUNT
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
    zeros = "%torque0AverageTorque=315.00\n%torque2ZeroLoad=-12.00\n"
    text = f"%made by hand\n%a note\n%idxPulse_1=-299\n{zeros}{rows}\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
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
    shift = read_mrd(path, distal_zero_counts=88.0).load_torque_nm - read_mrd(path).load_torque_nm
    np.testing.assert_allclose(shift, -100.0 * TORQUE_NM_PER_COUNT, atol=1e-12)


def test_all_runs_of_a_set_share_the_counters_zero(tmp_path: Path) -> None:
    """The same motion, cut differently: where both runs saw it, the angles are the same."""
    early = read_mrd(stand_file(tmp_path / "a.TXT"), startup_s=0.0)
    late = read_mrd(stand_file(tmp_path / "b.TXT", starts_at=250), startup_s=0.0)
    for name in ("motor_angle_rad", "load_angle_rad"):
        np.testing.assert_allclose(early[name][250:], late[name][:-250], atol=1e-6)  # last digit
    assert early.motor_angle_rad[0] == pytest.approx(1365 * 2 * np.pi / 8192)
    assert "idxPulse_1=-299" in early.metadata["import_angles"]


def test_a_folder_shares_signs_and_says_what_its_runs_share(tmp_path: Path) -> None:
    for name in ("T_4_Roll_1_000.TXT.gz", "T_4_Roll_1_001.TXT", "T_4_Roll_3_000.TXT"):
        stand_file(tmp_path / name, angle_sign=-1)
    (tmp_path / "readme_Roll_1.txt").write_text("a roll of -90 degrees\n\nand more")
    recordings, session = read_mrd_folder(tmp_path)
    assert [one.source.rpartition("/")[2] for one in recordings] == sorted(
        ("T_4_Roll_1_000.TXT.gz", "T_4_Roll_1_001.TXT", "T_4_Roll_3_000.TXT")
    )
    assert session.shared.tool == "T_4"
    assert [one.path for one in session.recordings] == ["Roll_1", "Roll_1", "Roll_3"]
    assert [one.zeros for one in session.recordings] == ["T_4_Roll_1", "T_4_Roll_1", "T_4_Roll_3"]
    assert session.recordings[0].file == "T_4_Roll_1_000.csv"
    assert session.recordings[0].notes == "a roll of -90 degrees"
    # One run in which the load was moved from outside: alone it would get the other sign.
    odd = stand_file(tmp_path / "T_4_Roll_3_001.TXT", angle_sign=-1, load_sign=-1)
    alone = read_mrd(odd).load_torque_nm
    together = read_mrd_folder(tmp_path)[0][-1].load_torque_nm
    np.testing.assert_allclose(together, -alone)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ([], "no run of the test stand"),
        (["readme.TXT"], "no run of the test stand"),
        (["T_4_00.TXT", "T_5_00.TXT"], "runs of T_4, T_5; accepted: runs of one tool"),
    ],
)
def test_folders_that_are_no_session_are_refused(
    tmp_path: Path, names: list[str], told: str
) -> None:
    for name in names:
        stand_file(tmp_path / name)
    with pytest.raises(BadInput, match=told):
        read_mrd_folder(tmp_path)


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
@pytest.mark.parametrize("folder", [MEASURED, ROLL_PITCH], ids=lambda folder: folder.name)
def test_real_sets_have_one_sign_each_and_one_zero(folder: Path) -> None:
    """All runs of a folder have the same signs alone, and end their strokes at the same angle."""
    recordings, session = read_mrd_folder(folder)
    assert len(recordings) == (12 if folder == MEASURED else 24)
    for one in recordings:
        alone = read_mrd(one.source)
        for name in ("load_angle_rad", "motor_torque_nm", "load_torque_nm"):
            np.testing.assert_array_equal(alone[name], one[name])
        assert "doubtful" not in one.metadata["import_load_torque"]
    # Every run follows one commanded sine of the counters: 60 degrees between the same two ends.
    # The controller misses them by up to 40 counts (0.03 rad) at the highest load.
    ends = np.array([[one.motor_angle_rad.min(), one.motor_angle_rad.max()] for one in recordings])
    assert np.ptp(ends, axis=0).max() < 0.035
    paths = [entry.path or session.shared.path for entry in session.recordings]
    assert len(set(paths)) == (1 if folder == MEASURED else 6)
    if folder == ROLL_PITCH:
        assert "-90 degrees" in str(session.recordings[paths.index("Roll_1")].notes)


@needs_measured
def test_the_real_first_sample_is_no_zero_of_the_distal_torque() -> None:
    """Within one set of tool 5 it agrees to 0.4 mN m; over the sets of tool 4 it does not."""

    def first(folder: Path) -> np.ndarray:
        paths = sorted(folder.glob("*.TXT*"))
        return np.array([read_mrd(path, startup_s=0.0).load_torque_nm[0] for path in paths])

    assert np.std(first(MEASURED)) < 0.5e-3
    assert np.ptp(first(ROLL_PITCH)) > 6e-3
