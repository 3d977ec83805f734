"""The simulated rig as a user starts it: its own process, a real bus, real time.

The one place of the host's tests where the reading thread, the kernel's sockets and two processes
meet. Nothing here depends on how fast the machine is.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.request import HTTPCookieProcessor, build_opener

import pytest
from bowden.cli.rig import rig_command, stop
from bowden.drive.bus_options import BusOptions
from bowden.drive.simulated_rig import own_rig
from bowden.errors import BadInput
from bowden.recording.read import read_recording

BOWDEN = [sys.executable, "-m", "bowden.cli.main"]


@pytest.fixture
def flags() -> list[str]:
    """A bus of its own, so that tests and users on one machine do not meet."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        return BusOptions(further={"port": free.getsockname()[1]}).flags()


@pytest.fixture
def rig(flags: list[str]) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([*BOWDEN, "rig", *flags], stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    ready = process.stderr.readline()
    if "multicast route" in ready:
        process.wait()
        pytest.skip(ready.strip())
    assert "ready: node 16" in ready
    yield process
    stop(process)  # type: ignore[arg-type]
    process.stderr.close()


def bowden(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*BOWDEN, *arguments], capture_output=True, text=True, check=False)


@pytest.mark.usefixtures("rig")
def test_scan_and_record(flags: list[str], tmp_path: Path) -> None:
    assert json.loads(bowden("scan", *flags, "--json").stdout)["nodes"][0]["node_id"] == 16
    out = tmp_path / "run.blf"
    done = bowden("record", str(out), "--duration", "0.5", "--enable", "tunnel", "--json", *flags)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    recording = read_recording(out)
    assert recording.time_s.size == told["complete_samples"] >= 500
    assert recording.time_s[-1] >= 0.499  # a busy host stops later: what it got meanwhile is kept
    state = json.loads(bowden("info", *flags, "--json").stdout)
    assert state["power_state"] == "switch on disabled"


def test_the_rig_ends_on_a_signal(rig: subprocess.Popen[str]) -> None:
    rig.send_signal(signal.SIGINT)
    assert rig.wait() == 0


def test_a_recording_whose_rig_is_killed_is_cut_and_kept(
    rig: subprocess.Popen[str], flags: list[str], tmp_path: Path
) -> None:
    out = tmp_path / "run.blf"
    recorder = subprocess.Popen(
        [*BOWDEN, "record", str(out), "--duration", "3600", "--enable", "tunnel", *flags],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert recorder.stderr is not None
    assert "recording node 16" in recorder.stderr.readline()
    rig.send_signal(signal.SIGTERM)
    _, told = recorder.communicate()
    assert recorder.returncode == 3, told
    assert "cut short: node 16 has vanished" in told  # the summary
    told = told.splitlines()[-1] + "\n"
    assert told.startswith("bowden record: ")
    # Killed before or after the drive was enabled: either way nothing is left half-written.
    assert not list(tmp_path.glob("*.part*"))
    assert not list(tmp_path.glob("*.tmp"))


@pytest.mark.usefixtures("rig")
def test_ctrl_c_ends_the_studio_in_one_line(flags: list[str], tmp_path: Path) -> None:
    command = [*BOWDEN, "studio", "--no-browser", "--folder", str(tmp_path), *flags]
    studio = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert studio.stderr is not None
    with studio.stderr:
        address = studio.stderr.readline().split()[1]
        with build_opener(HTTPCookieProcessor()).open(address) as page:  # it serves
            assert page.status == 200
        studio.send_signal(signal.SIGINT)
        told = studio.stderr.read().splitlines()[1:]
    assert studio.wait() == 130
    assert told == ["bowden studio: interrupted"]


def test_a_rig_that_is_not_installed_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bowden.drive.simulated_rig.find_spec", lambda _name: None)
    with pytest.raises(ValueError, match="no simulated rig in this installation"):
        rig_command(BusOptions())


def test_the_rig_gets_the_same_bus() -> None:
    command = rig_command(BusOptions("socketcan", "vcan0", 500_000), 17, ["--operator", "still"])
    text = " ".join(command)
    assert "-m bowden_rig -i socketcan -c vcan0 -b 500000" in text
    assert text.endswith("--node-id 17 --operator still")


def test_a_part_that_the_rig_does_not_have_is_bad_input(tmp_path: Path) -> None:
    with (
        pytest.raises(BadInput, match=r"simulated rig, rig: found 'foo\.bar=3'; accepted: cable, "),
        own_rig(BusOptions(), ["--set", "foo.bar=3"], tmp_path / "rig.log"),
    ):
        pytest.fail("it has started")
