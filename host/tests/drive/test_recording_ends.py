"""Beginnings and ends of recordings: the samples are kept and summarised, the drive is safe."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from bowden.cli import main as frame
from bowden.cli import record as record_command
from bowden.cli.main import main
from bowden.drive.capture import Capture, record
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run, enable
from bowden.drive.watch import Progress, Request, SetMark, Span, Stop
from bowden.errors import BadInput
from bowden.recording import capture_writer
from bowden.recording.capture_writer import CaptureWriter, recover
from bowden.recording.read import read_recording
from bowden.recording.side_file import side_path
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
TUNNEL = Run(ModeOfOperation.TUNNEL)


class FullDisk:
    """A file that takes so many bytes and then no more."""

    def __init__(self, file: object, room: int) -> None:
        self._file = file
        self._room = room

    def write(self, data: bytes) -> int:
        self._room -= len(data)
        if self._room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return self._file.write(data)

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    made = capture_writer._Blf.__init__

    def make(self: can.BLFWriter, path: Path) -> None:
        made(self, path)
        self.file = FullDisk(self.file, 20_000)

    monkeypatch.setattr(capture_writer._Blf, "__init__", make)


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_names_the_file_and_leaves_the_drive_safe(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig()
    path = tmp_path / "run.blf"
    ended: list[Capture] = []
    with pytest.raises(BadInput, match=r"run\.blf.*No space left.*run\.blf\.part"):
        record(drive, path, 20.0, run=TUNNEL, on_end=ended.append)
    assert bus.time_s < 5.0  # it does not go on for 20 s without writing
    assert not bus.bench.actuators.bridge_enabled
    assert drive.read_raw("error_code") == 0
    (capture,) = ended
    assert "No space left" in capture.ended
    assert capture.side.samples > 100
    # What is there can be read, and says that it is not all.
    recording = read_recording(capture.path)
    assert "No space left" in recording.metadata["cut"]


@pytest.mark.usefixtures("bus", "full_disk")
def test_the_summary_of_a_full_disk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.blf"
    assert main(["record", str(path), "--duration", "20", "--json"]) == 2
    shown = capsys.readouterr()
    told = json.loads(shown.out)
    assert "No space left" in told["cut"]
    assert told["recording"].endswith("run.blf.part")
    assert "run.blf" in shown.err.splitlines()[-1]


@pytest.mark.usefixtures("bus")
def test_ctrl_c_ends_with_a_summary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []

    def interrupt(keys: str) -> list[Request]:
        calls.append(keys)
        if len(calls) % 5 == 0:
            raise KeyboardInterrupt
        return []

    monkeypatch.setattr(record_command, "_requests", interrupt)
    path = tmp_path / "run.blf"
    arguments = ["record", str(path), "--duration", "5", "--enable", "tunnel", "--json"]
    assert main(arguments) == frame.EXIT_INTERRUPTED
    told = json.loads(capsys.readouterr().out)
    assert told["cut"] == "interrupted by the user"
    assert told["samples"] > 200
    # Without a duration, Ctrl-C is the usual end of a recording.
    path = tmp_path / "open.blf"
    assert main(["record", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["cut"] is None
    assert told["ended"] == "stopped by the user"


def test_an_adapter_that_goes_bus_off_ends_with_a_summary_and_the_drive_stops_itself(
    bus: VirtualBus,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    receive = bus.recv

    def recv(timeout: float | None = None) -> can.Message | None:
        if bus.time_s > 3.0:
            raise can.CanOperationError("bus off")
        return receive(timeout)

    monkeypatch.setattr(bus, "recv", recv)
    path = tmp_path / "run.blf"
    arguments = ["record", str(path), "--duration", "20", "--enable", "tunnel", "--json"]
    assert main(arguments) == frame.EXIT_DRIVE_FAILED
    shown = capsys.readouterr()
    told = json.loads(shown.out)
    assert "bus off" in told["cut"]
    assert "bus off" in shown.err
    assert told["samples"] > 1000
    assert "bus off" in read_recording(Path(told["recording"])).metadata["cut"]
    bus.advance(1.2)  # the drive misses its host's heartbeat
    assert not bus.bench.actuators.bridge_enabled


def test_marks_and_an_end_on_request(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()
    at: list[float] = []
    asked: list[list[Request]] = [[], [], [SetMark("touched")], [], [SetMark("let go")], [Stop()]]

    def requests() -> list[Request]:
        return asked.pop(0) if asked else []

    path = tmp_path / "run.blf"
    capture = record(
        drive,
        path,
        Span(None),
        run=TUNNEL,
        on_progress=lambda progress: at.append(progress.elapsed_s),
        requests=requests,
    )
    assert capture.ended == "stopped by the user"
    assert capture.side.cut is None
    marks = capture.decoded.marks
    assert [mark.text for mark in marks] == ["touched", "let go"]
    # 0.2 s apart by the requests; both lie after the start by what the capture has before the
    # first watched sample.
    assert marks[1].time_s - marks[0].time_s == pytest.approx(at[4] - at[2], abs=2e-3)
    assert "touched" in read_recording(path).metadata["marks"]


def test_motion_starts_the_recording_and_a_time_before_is_kept(
    rig: MakeRig, tmp_path: Path
) -> None:
    drive, bus = rig()  # the operator moves once the bridge is on
    path = tmp_path / "run.blf"
    span = Span(0.5, start_on_motion_rad=0.05, pre_trigger_s=0.2)
    waited: list[Progress] = []
    capture = record(drive, path, span, run=TUNNEL, on_progress=waited.append)
    assert waited[0].waiting
    assert capture.side.trigger.endswith("moved by more than 0.05 rad")
    recording = read_recording(path)
    # 0.2 s before, 0.5 s after, and the samples until the bridge is off (quick stop: 50 ms).
    assert 0.7 <= recording.time_s[-1] + 2e-3 < 0.85
    before = recording.time_s < 0.19
    assert abs(recording.load_angle_rad[before] - recording.load_angle_rad[0]).max() < 0.05
    assert recording.metadata["frames_lost"] == "0"
    assert not bus.bench.actuators.bridge_enabled


def test_a_trigger_that_never_comes_leaves_no_file(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()  # the bridge stays off, so the operator waits
    ended: list[Capture] = []
    record(
        drive,
        tmp_path / "run.blf",
        Span(1.0, start_on_motion_rad=0.05),
        requests=lambda: [Stop()] if drive.connection.clock() > 2.0 else [],
        on_end=ended.append,
    )
    assert ended[0].ended == "stopped by the user before the trigger"
    assert list(tmp_path.iterdir()) == []


def test_a_fault_ends_a_recording_that_waits_for_one(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()
    enable(drive, TUNNEL)  # another program runs the drive; we only listen

    def hang(progress: Progress) -> None:
        if progress.elapsed_s > 0.5:
            drive.connection.stop_heartbeat()

    path = tmp_path / "run.blf"
    capture = record(drive, path, Span(None, stop_on_fault=True), on_progress=hang)
    assert capture.ended.startswith("fault: no command came from the host")
    assert capture.side.cut is None  # this is what it waited for
    assert capture.decoded.duration_s == pytest.approx(1.1, abs=0.15)  # 0.5 s of deadline
    # A fault that is there already is not waited for.
    capture = record(drive, tmp_path / "next.blf", Span(0.2, stop_on_fault=True))
    assert capture.ended == "duration over"


def killed(path: Path, drive: Drive) -> Path:
    """Leave the files of a recorder that is killed after 1 s."""
    done: list[CaptureWriter] = []

    class Killed(BaseException):
        pass

    original = CaptureWriter.close
    try:
        CaptureWriter.close = lambda self: done.append(self)  # noqa: PLW0108  (a method)

        def kill(progress: Progress) -> None:
            if progress.elapsed_s >= 1.0:
                raise Killed

        with pytest.raises(Killed):
            record(drive, path, 5.0, on_progress=kill)
    finally:
        CaptureWriter.close = original
    done[0]._blf.file.close()
    side = side_path(done[0].part)
    assert json.loads(side.read_text())["cut"] == capture_writer.NOT_CLOSED
    return done[0].part


def test_a_killed_recorder_loses_at_most_half_a_second_and_recover_says_so(
    rig: MakeRig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive, _ = rig()
    part = killed(tmp_path / "run.blf", drive)
    # The next recording of that name does not destroy it.
    with pytest.raises(BadInput, match=r"bowden recover .*run\.blf\.part"):
        record(drive, tmp_path / "run.blf", 1.0)
    assert main(["recover", str(part), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["recording"] == str(tmp_path / "run.blf")
    assert told["duration_s"] > 0.5
    assert told["cut"] == capture_writer.NOT_CLOSED
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.blf", "run.blf.json"]
    assert read_recording(tmp_path / "run.blf").metadata["cut"] == capture_writer.NOT_CLOSED


def test_recover_refuses_what_is_no_unfinished_recording(tmp_path: Path, rig: MakeRig) -> None:
    with pytest.raises(BadInput, match=r"NAME\.blf\.part"):
        recover(tmp_path / "run.blf")
    with pytest.raises(BadInput, match=r"run\.blf\.part: found No such file"):
        recover(tmp_path / "run.blf.part")
    (tmp_path / "run.blf.part").touch()
    with pytest.raises(BadInput, match="no side file"):
        recover(tmp_path / "run.blf.part")
    (tmp_path / "run.blf.part").unlink()
    drive, _ = rig()
    part = killed(tmp_path / "run.blf", drive)
    (tmp_path / "run.blf").write_bytes(b"mine")
    with pytest.raises(BadInput, match="--overwrite"):
        recover(part)
    assert (tmp_path / "run.blf").read_bytes() == b"mine"


def test_recovering_onto_a_full_disk_leaves_everything_as_it_was(
    tmp_path: Path, rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive, _ = rig()
    part = killed(tmp_path / "run.blf", drive)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(path: Path, _side: object) -> None:
        raise BadInput(str(path), "No space left on device", "a file that can be written")

    monkeypatch.setattr(capture_writer, "write_side_file", full)
    with pytest.raises(BadInput, match="No space left"):
        recover(part)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_recording_under_way_is_not_recovered(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()
    refused: list[str] = []

    def try_it(_progress: Progress) -> None:
        with pytest.raises(BadInput, match="still running") as error:
            recover(tmp_path / "run.blf.part")
        refused.append(str(error.value))

    record(drive, tmp_path / "run.blf", 0.5, on_progress=try_it)
    assert refused


@pytest.mark.usefixtures("bus")
def test_every_command_says_that_a_capture_was_cut_in_the_middle(
    tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.blf"
    assert main(["record", str(path), "--duration", "1", "--enable", "tunnel"]) == 0
    capsys.readouterr()
    whole = path.read_bytes()
    path.write_bytes(whole[: 2 * len(whole) // 3])
    assert main(["convert", str(path), str(tmp_path / "run.csv"), "--json"]) == 0
    shown = capsys.readouterr()
    assert "warning" in shown.err
    size = f"the file ends after {2 * len(whole) // 3} of {len(whole)} bytes"
    assert size in shown.err
    assert any(size in warning for warning in json.loads(shown.out)["warnings"])
    # The exchange form made of it still says so.
    out = str(tmp_path / "model.csv")
    arguments = ["simulate", str(model), "--input", str(tmp_path / "run.csv")]
    assert main([*arguments, "--mode", "torque-position", "--output", out]) == 0
    assert size in capsys.readouterr().err


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--enable", "torque"], "--torque NM"),
        (["--enable", "torque", "--torque", "nan"], "nan N m; accepted: at most 0.5 N m"),
        (["--enable", "torque", "--torque", "-0.6"], "-0.6 N m; accepted: at most 0.5 N m"),
        (["--pre-trigger", "1"], "--start-on-motion"),
        (["--start-on-motion", "-1"], "--start-on-motion"),
        (["--node", "16", "--node", "16"], "each drive once"),
        (["--foreign", "no.yaml"], "no.yaml"),
    ],
)
def test_what_makes_no_sense_is_refused(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.blf"
    assert main(["record", str(path), "--duration", "1", *arguments]) == 2
    assert told in capsys.readouterr().err
    assert not path.exists()
