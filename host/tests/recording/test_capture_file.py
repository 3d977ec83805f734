"""Captures: raw frames back to samples; gaps, cuts and damage are reported."""

from __future__ import annotations

import contextlib
import json
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.capture_file import read_capture
from bowden.recording.capture_writer import CaptureWriter
from bowden.recording.decode import decode
from bowden.recording.read import read_recording
from bowden.recording.side_file import PdoField, PdoLayout, SideFile, side_path
from hypothesis import given, settings
from hypothesis import strategies as st

# Written down by hand from the wire facts: sample_counter u16, statusword u16, device time u32 us;
# counter low byte u8, angle i32 urad, torque i24 uNm.
LAYOUTS = [
    PdoLayout(
        name="TPDO1",
        cob_id=0x190,
        fields=[
            PdoField(
                name="sample_counter", bits=16, signed=False, scale=1, column="sample_counter"
            ),
            PdoField(name="statusword", bits=16, signed=False, scale=1, column="status"),
            PdoField(name="device_time", bits=32, signed=False, scale=1e-6, column="device_time_s"),
        ],
    ),
    *(
        PdoLayout(
            name=name,
            cob_id=cob_id,
            fields=[
                PdoField(
                    name="sample_counter_low", bits=8, signed=False, scale=1, column="counter_low"
                ),
                PdoField(
                    name=f"{end}_angle",
                    bits=32,
                    signed=True,
                    scale=1e-6,
                    column=f"{end}_angle_rad",
                ),
                PdoField(
                    name=f"{end}_torque",
                    bits=24,
                    signed=True,
                    scale=1e-6,
                    column=f"{end}_torque_nm",
                ),
            ],
        )
        for name, cob_id, end in (("TPDO2", 0x290, "motor"), ("TPDO3", 0x390, "load"))
    ),
]


def side_file() -> SideFile:
    return SideFile(
        bowden="test",
        git=None,
        dictionary_hash="00000000h",
        node_id=16,
        adapter={},
        started="2026-01-01T00:00:00+00:00",
        sample_period_s=1e-3,
        pdos=LAYOUTS,
        metadata={"rig": "by hand"},
    )


def raw_angle(sample: int, sign: int) -> int:
    return sign * (1_234_567 + 10 * sample)


def frames_of(samples: Iterable[int], start_us: int = 0) -> Iterator[can.Message]:
    """Frames of a drive whose angles and torques follow from the sample's number."""
    for sample in samples:
        time_s = 1.7e9 + sample * 1e-3
        device_us = (start_us + sample * 1000) % (1 << 32)
        yield message(0x190, struct.pack("<HHI", sample % 65536, 0x27, device_us), time_s)
        for cob_id, sign in ((0x290, 1), (0x390, -1)):
            torque = (sign * 8_000_000 + sample).to_bytes(3, "little", signed=True)
            angle = raw_angle(sample, sign).to_bytes(4, "little", signed=True)
            yield message(cob_id, bytes((sample % 256,)) + angle + torque, time_s + 1e-4)


def message(cob_id: int, data: bytes, time_s: float) -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, timestamp=time_s)


def capture(path: Path, frames: Iterable[can.Message]) -> Path:
    with CaptureWriter(path, side_file()) as writer:
        for frame in frames:
            writer.write(frame)
    return path


def test_samples_come_back_with_signs_units_and_time(tmp_path: Path) -> None:
    # Starts just before counter and device time wrap.
    samples = range(65_500, 65_600)
    path = capture(tmp_path / "run.blf", frames_of(samples, start_us=(1 << 32) - 65_550_000))
    recording = read_recording(path)
    assert recording.time_s.tolist() == [round(n * 1e-3, 3) for n in range(100)]
    assert recording.motor_angle_rad.tolist() == [raw_angle(n, 1) / 1e6 for n in samples]
    assert recording.load_angle_rad.tolist() == [raw_angle(n, -1) / 1e6 for n in samples]
    assert recording.motor_torque_nm.tolist() == [(8_000_000 + n) / 1e6 for n in samples]
    assert recording.load_torque_nm.tolist() == [(-8_000_000 + n) / 1e6 for n in samples]
    assert recording["status"].tolist() == [0x27] * 100
    assert recording.metadata["rig"] == "by hand"
    assert recording.metadata["frames_lost"] == "0"
    assert recording.metadata["sample_rate_hz"] == "1000"


def test_a_sample_that_lacks_a_pdo_is_a_gap_and_is_reported(tmp_path: Path) -> None:
    frames = list(frames_of(range(300)))
    del frames[3 * 150 + 2], frames[3 * 100 + 1], frames[3 * 50]  # TPDO3, TPDO2 and TPDO1
    recording = read_capture(capture(tmp_path / "run.blf", frames))
    gone = {50, 100, 150}
    there = [n for n in range(300) if n not in gone]
    assert recording.time_s.tolist() == [round(n * 1e-3, 3) for n in there]
    assert recording.load_angle_rad.tolist() == [raw_angle(n, -1) / 1e6 for n in there]
    assert recording.metadata["frames_lost"] == "3"
    assert recording.metadata["lost_tpdo1"] == "50"
    assert recording.metadata["lost_tpdo2"] == "100"
    assert recording.metadata["lost_tpdo3"] == "150"
    side = json.loads(side_path(tmp_path / "run.blf").read_text())
    assert side["samples"] == 300
    assert side["lost"]["TPDO2"] == {"count": 1, "samples": ["100"]}


@settings(max_examples=100, deadline=None)
@given(
    start=st.integers(65_000, 65_600),
    start_us=st.sampled_from([0, (1 << 32) - 65_550_000]),
    longest=st.integers(1, 60),
    seed=st.integers(0, 1 << 32),
)
def test_frames_dropped_repeated_and_delayed_are_reported_exactly(
    start: int, start_us: int, longest: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    samples = range(start, start + 400)
    sent = list(frames_of(samples, start_us=start_us % (1 << 32)))
    # In units of frames, 3 a sample. The low byte tells 127 samples, for a frame and the TPDO1
    # beside it together, so that each may be 60 late.
    places: list[tuple[float, int]] = []
    for place in range(len(sent)):
        fate = random.choice(["once", "dropped", "repeated", "delayed"], p=[0.85, 0.05, 0.05, 0.05])
        later = place + random.uniform(0, 3 * longest)
        is_kept = place < 3 or place >= len(sent) - 3  # the account needs its two ends
        if is_kept or fate in ("once", "repeated"):
            places.append((place, place))
        if not is_kept and fate in ("repeated", "delayed"):
            places.append((later, place))
    arrived = [place for _, place in sorted(places)]
    expected: dict[str, dict[str, list[int]]] = {"lost": {}, "repeated": {}, "delayed": {}}
    seen: set[int] = set()
    newest = 0
    for place in arrived:
        sample, pdo = samples[place // 3], f"TPDO{place % 3 + 1}"
        kind = "repeated" if place in seen else "delayed" if place // 3 < newest else None
        if kind is not None:
            expected[kind].setdefault(pdo, []).append(sample)
        seen.add(place)
        newest = max(newest, place // 3)
    for place in set(range(len(sent))) - seen:
        expected["lost"].setdefault(f"TPDO{place % 3 + 1}", []).append(samples[place // 3])

    frames = [
        message(sent[place].arbitration_id, bytes(sent[place].data), 1.7e9 + at * 1e-3 / 3)
        for at, place in sorted(places)
    ]
    decoded = decode(frames, side_file(), "run.blf")

    of_kind = {
        "lost": decoded.losses.lost,
        "repeated": decoded.losses.order.repeated,
        "delayed": decoded.losses.order.delayed,
    }
    # Numbers count on from the first frame's 16-bit counter.
    turns = start // 65536 * 65536
    found = {
        kind: {pdo: (numbers + turns).tolist() for pdo, numbers in by_pdo.items() if numbers.size}
        for kind, by_pdo in of_kind.items()
    }
    assert found == {
        kind: {pdo: sorted(numbers) for pdo, numbers in by_pdo.items()}
        for kind, by_pdo in expected.items()
    }
    # Each sample has its own values, whenever its frames came.
    whole = [n for k, n in enumerate(samples) if {3 * k, 3 * k + 1, 3 * k + 2} <= seen]
    assert (decoded.number + turns).tolist() == whole
    assert decoded.channels["motor_angle_rad"].tolist() == [raw_angle(n, 1) / 1e6 for n in whole]
    assert np.allclose(decoded.time_s, (np.array(whole) - whole[0]) * 1e-3, atol=1e-9)


def test_what_came_twice_or_late_stands_in_side_file_and_metadata(tmp_path: Path) -> None:
    frames = list(frames_of(range(50)))
    frames.insert(20, frames[10])  # TPDO2 of sample 3, again
    frames.insert(60, frames.pop(33))  # TPDO3 of sample 10 (one frame has come before), late
    recording = read_capture(capture(tmp_path / "run.blf", frames))
    assert recording.time_s.size == 50
    side = json.loads(side_path(tmp_path / "run.blf").read_text())
    assert side["repeated"] == {"TPDO2": {"count": 1, "samples": ["3"]}}
    assert side["delayed"] == {"TPDO3": {"count": 1, "samples": ["10"]}}
    told = {key: recording.metadata.get(key) for key in ("repeated_tpdo2", "delayed_tpdo3")}
    assert told == {"repeated_tpdo2": "3", "delayed_tpdo3": "10"}
    assert recording.metadata["frames_lost"] == "0"


def test_frames_of_others_short_frames_and_repeats_change_nothing(tmp_path: Path) -> None:
    frames = list(frames_of(range(50)))
    frames.insert(20, message(0x191, bytes(8), 1.7e9))
    frames.insert(20, message(0x290, b"\x00", 1.7e9))
    frames.insert(30, frames[29])
    error = can.Message(is_error_frame=True, timestamp=1.7e9 + 0.01)
    recording = read_capture(capture(tmp_path / "run.blf", [*frames[:10], error, *frames[10:]]))
    assert recording.time_s.size == 50
    assert recording.metadata["frames_lost"] == "0"


def test_while_recording_there_is_only_a_part_and_it_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "run.blf"
    writer = CaptureWriter(path, side_file())
    for frame in frames_of(range(3000)):
        writer.write(frame)
    # As if killed now: what BLF has flushed so far is all there is.
    assert not path.exists()
    part = tmp_path / "run.blf.part"
    recording = read_recording(part)
    assert 1000 < recording.time_s.size < 3000
    assert "without closing" in recording.metadata["cut"]
    writer.close()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.blf", "run.blf.json"]
    assert read_recording(path).time_s.size == 3000


def test_an_error_while_recording_keeps_what_there_is_and_says_so(tmp_path: Path) -> None:
    def frames_then_trouble() -> Iterator[can.Message]:
        yield from frames_of(range(10))
        raise RuntimeError("the roof fell in")

    path = tmp_path / "run.blf"
    with pytest.raises(RuntimeError, match="the roof fell in"):
        capture(path, frames_then_trouble())
    recording = read_capture(path)
    assert recording.time_s.size == 10
    assert recording.metadata["cut"] == "the roof fell in"


def test_nothing_recorded_is_refused(tmp_path: Path) -> None:
    path = capture(tmp_path / "run.blf", [])
    with pytest.raises(BadInput, match="no TPDO1 frame"):
        read_capture(path)


def test_without_its_side_file_a_capture_is_refused(tmp_path: Path) -> None:
    path = capture(tmp_path / "run.blf", frames_of(range(5)))
    side_path(path).unlink()
    with pytest.raises(BadInput, match=r"no side file run\.blf\.json"):
        read_recording(path)


def test_a_damaged_side_file_is_refused_with_its_fields(tmp_path: Path) -> None:
    path = capture(tmp_path / "run.blf", frames_of(range(5)))
    document = json.loads(side_path(path).read_text())
    del document["node_id"]
    document["sample_period_s"] = "soon"
    side_path(path).write_text(json.dumps(document))
    with pytest.raises(BadInput, match=r"node_id.*sample_period_s"):
        read_recording(path)


def test_a_damaged_capture_is_refused_or_read_up_to_the_damage(tmp_path: Path) -> None:
    path = capture(tmp_path / "run.blf", frames_of(range(9000)))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])  # the disk was full
    assert 0 < read_recording(path).time_s.size < 9000
    path.write_bytes(whole[:200] + b"\x00" * 400 + whole[600:])
    with pytest.raises(BadInput, match=r"run\.blf"):
        read_recording(path)


def test_no_damage_gives_a_traceback(tmp_path: Path) -> None:
    path = capture(tmp_path / "run.blf", frames_of(range(3000)))
    whole = path.read_bytes()
    random = np.random.default_rng(5)
    for _ in range(100):
        damaged = bytearray(whole)
        for at in random.integers(4, len(whole), size=random.integers(1, 20)):
            damaged[at] = random.integers(256)
        path.write_bytes(damaged[: random.integers(8, len(whole))])
        with contextlib.suppress(BadInput):
            read_recording(path)


def test_numbers_survive_the_way_through_blf(tmp_path: Path) -> None:
    # The property test of the losses, once through real frames and a real file.
    random = np.random.default_rng(3)
    frames = list(frames_of(range(2000)))
    keep = random.random(len(frames)) >= 0.1
    keep[:3] = keep[-3:] = True
    recording = read_capture(
        capture(tmp_path / "run.blf", [f for f, k in zip(frames, keep, strict=True) if k])
    )
    assert int(recording.metadata["frames_lost"]) == np.count_nonzero(~keep)
    complete = keep.reshape(-1, 3).all(axis=1)
    np.testing.assert_array_equal(np.rint(recording.time_s * 1e3), np.flatnonzero(complete))
