"""The drive on the simulated rig, over CAN, in virtual time: the thread through the whole house.

One list for every target that can be put on the simulated rig. Where a target's own converters are
coarser than the rig's sensors, `converters` says by how much, and the tolerance grows by that.
`test_drive` holds what needs no rig.
"""

from __future__ import annotations

import math
from pathlib import Path

import can
import canopen
import numpy as np
import pytest
from bowden_rig.frame_loss import SeededLoss
from bowden_rig.rig.parameters import Cable, Operator, Rig, Sensing
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.artefacts import directory_of, keep
from hil_tests.benches import Benches
from hil_tests.emulated.records import CanFault
from hil_tests.lockstep_host import (
    MODE,
    NMT_RESET_NODE,
    NMT_START,
    STATUSWORD,
    LockstepHost,
    samples,
)
from hil_tests.targets.emulated import EmulatedTarget

pytestmark = pytest.mark.needs("simulated-rig", "virtual-time")

TUNNEL, TORQUE = -1, -2
ENABLED = 0x27
CAPSTAN = math.exp(1.5)
# the cell reads ten times too much: 3 N m of friction are beyond the range of any target
RAILED = Sensing(load_cell_gain_error=9.0)


def tpdo_1(host: LockstepHost[VirtualBus]) -> list[can.Message]:
    return [f for f in host.frames if f.arbitration_id == 0x180 + host.node_id]


def test_experiment_2_with_the_tunnel_matches_the_closed_forms(benches: Benches) -> None:
    # the rig without its viscous term, so that the Coulomb closed forms apply
    host = benches(Rig(cable=Cable(viscous_s_per_m=0.0)))
    host.enable(TUNNEL)
    host.listen(7.0)
    got = samples(host.frames)
    assert set(np.diff(got.counter)) == {1}
    last = slice(len(got.counter) - 4000, None)  # two whole cycles
    assert np.all(got.statusword[last] & 0x6F == ENABLED)
    angle, torque = got.load_angle_rad[last], got.load_torque_nm[last]
    speed = np.gradient(angle, 1e-3)
    assert np.degrees(np.max(np.abs(angle))) >= 40.0

    # eq. (7), restoring, saturated beyond 0.45 rad, silent inside the half width of 0.05 rad
    commanded = -np.sign(angle) * np.clip(0.5 * (np.abs(angle) - 0.05), 0.0, 0.2)
    # the drive's slew and the amplifier lag by 1 ms: 0.5 N m/rad * 2.3 rad/s; noise of the sense
    converters = host.bus.bench.target.converters
    error = np.abs(got.motor_torque_nm[last] - commanded)
    assert np.max(error) < 2e-3 + converters.motor_torque_nm + converters.regulation_nm
    assert np.sqrt(np.mean(error**2)) < 0.5e-3 + converters.motor_torque_nm

    inside = np.abs(angle) < 0.04
    outside = (np.abs(angle) > 0.47) & (np.abs(angle) < 0.60)
    away = angle * speed > 0.0
    # silent: 2 r_load T0 m = 3.12 N m; 2 %: motor inertia, and the cables still settle from slack
    assert np.median(np.abs(torque[inside])) == pytest.approx(3.12, rel=0.02)
    # saturated, outward: the pulling cable alone, back-driven through the capstan
    outward = np.abs(torque[outside & away])
    assert np.median(outward) == pytest.approx(5.2 * 0.2 * CAPSTAN, rel=0.02)
    # saturated, inward: rho tau_m - 2 r_load T0 m, taken up again only late after the reversal
    inward = np.abs(torque[(np.abs(angle) > 0.3) & (np.abs(angle) < 0.46) & ~away])
    assert 1.5 < np.median(inward) < 3.12


def test_recorded_channels_agree_with_the_truth(benches: Benches) -> None:
    host = benches()
    host.enable(TUNNEL)
    host.listen(3.0)
    got, bench = samples(host.frames), host.bus.bench
    truth, converters = bench.truth(), bench.target.converters
    # The drive's clock starts when it boots. TPDO1 leaves in the tick of its sample: the frame that
    # waited least on the bus tells how much later than the bench's that was.
    heard_s = {int.from_bytes(f.data[:2], "little"): f.timestamp for f in tpdo_1(host)}
    offset_s = min(heard_s[c] - t for c, t in zip(got.counter, got.device_time_s, strict=True))
    # a sample is the state at the end of the tick before the one that sends it
    row = np.rint((got.device_time_s + offset_s) * 4000).astype(int) - 2
    around = row[:, None] + np.arange(-converters.sampling_ticks, converters.sampling_ticks + 1)
    keep = (around[:, 0] >= 0) & (around[:, -1] < len(truth.time_s))
    for seen, true, bound in (
        (got.motor_angle_rad, truth.motor_angle_rad, 0.51 * 2.0 * math.pi / 2000),
        (got.load_angle_rad, truth.load_angle_rad, 0.51 * 2.0 * math.pi / 10000),
        # 5 sigma of noise and half a count, and what changes within the averaging period
        (
            got.motor_torque_nm,
            truth.motor_torque_nm,
            5 * 60e-6 + 30e-6 + 150e-6 + converters.motor_torque_nm + converters.phase_nm,
        ),
        (
            got.load_torque_nm,
            truth.load_torque_nm,
            5 * 0.5e-3 + 0.1e-3 + 60e-3 + converters.load_torque_nm,
        ),
    ):
        window = true[around[keep]]
        assert np.all(seen[keep] > np.min(window, axis=1) - bound)
        assert np.all(seen[keep] < np.max(window, axis=1) + bound)


def test_same_seed_gives_the_same_frames_and_another_seed_others(benches: Benches) -> None:
    def frames(seed: int) -> list[tuple[float, int, bytes]]:
        host = benches(seed=seed)
        host.enable(TUNNEL)
        host.listen(1.5)
        return [(f.timestamp, f.arbitration_id, bytes(f.data)) for f in host.frames]

    assert frames(1) == frames(1)
    assert frames(1) != frames(2)


def test_dropped_frames_are_exactly_the_gaps(benches: Benches) -> None:
    host = benches(drop=SeededLoss(0.02, seed=4))
    host.nmt(NMT_START)
    host.listen(5.0)
    lost = [f for f in host.bus.dropped if f.arbitration_id == 0x190]
    kept = [int.from_bytes(f.data[:2], "little") for f in host.frames if f.arbitration_id == 0x190]
    missing = set(range(kept[0], kept[-1] + 1)) - set(kept)
    dropped = {int.from_bytes(f.data[:2], "little") for f in lost}
    assert missing == {c for c in dropped if kept[0] < c < kept[-1]}
    assert len(missing) > 50


def test_reset_node_opens_the_bridge_and_boots_again(benches: Benches) -> None:
    host = benches()
    host.enable(TUNNEL)
    assert host.bus.bench.actuators.bridge_enabled
    host.nmt(NMT_RESET_NODE)
    host.await_boot()
    host.listen(0.001)
    assert not host.bus.bench.actuators.bridge_enabled
    assert not samples(host.listen(0.1)).counter.size


def test_torque_mode_moves_the_motor_by_the_torque_asked_for(benches: Benches) -> None:
    host = benches(Rig(operator=Operator(motion="locked")))
    host.enable(TORQUE)
    host.write(0x2040, 0, 125_000, 3)
    host.listen(0.5)
    truth = host.bus.bench.truth()
    # the mean of 0.1 s: a real current loop follows the noise of its own converter
    assert np.mean(truth.motor_torque_nm[-400:]) == pytest.approx(0.125, rel=1e-3)
    # Experiment 1: no torque arrives at a locked load behind a conduit of this wrap
    assert abs(truth.load_torque_nm[-1]) < 1e-3
    assert truth.motor_angle_rad[-1] > 7e-3
    host.disable()
    assert not host.bus.bench.actuators.bridge_enabled


def test_silent_host_stops_the_drive(benches: Benches) -> None:
    benches.expected = {0x8130}
    host = benches()
    host.write(0x1016, 1, 127 << 16 | 100, 4)
    heartbeat = host.bus.send_periodic(
        can.Message(arbitration_id=0x77F, is_extended_id=False, data=b"\x05"), 0.05
    )
    host.enable(TUNNEL)
    host.listen(1.0)
    assert host.bus.bench.actuators.bridge_enabled
    heartbeat.stop()
    host.listen(0.15)
    assert not host.bus.bench.actuators.bridge_enabled
    assert int.from_bytes(host.read(STATUSWORD), "little") & 0x08


def test_railed_load_cell_stops_the_drive(benches: Benches) -> None:
    benches.expected = {0x7380}
    host = benches(Rig(sensing=RAILED))
    host.enable(TUNNEL)
    host.listen(2.0)
    assert not host.bus.bench.actuators.bridge_enabled


def test_handle_let_go_comes_to_rest(benches: Benches) -> None:
    free = Rig(operator=Operator(motion="free"))
    host = benches(free)
    host.enable(TUNNEL)
    host.bus.bench.rig.plant.scalars[3] = 5.0  # a knock: load speed, rad/s
    host.listen(2.0)
    truth = host.bus.bench.truth()
    tail = truth.load_angle_rad[-2000:]
    assert np.ptp(tail) < 1e-4
    assert np.ptp(truth.motor_angle_rad[-2000:]) < 1e-3


@pytest.mark.needs("several")
def test_two_drives_live_in_one_process(benches: Benches) -> None:
    one, two = benches(), benches()  # each on a wire of its own
    one.enable(TUNNEL)
    one.listen(0.2)
    assert {f.arbitration_id for f in two.listen(0.05)} <= {0x710}
    two.write(MODE, 0, TORQUE, 1)
    assert int.from_bytes(one.read(MODE), "little", signed=True) == TUNNEL


def test_canopen_package_talks_to_the_drive(benches: Benches) -> None:
    host = benches()
    network = canopen.Network(host.bus)
    network.notifier = None
    network.connect()
    try:
        node = network.add_node(16, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        assert node.sdo.upload(0x1008, 0) == b"bowden drive"
    finally:
        network.disconnect()


def test_verdict_finds_an_error_that_was_not_announced(target_name: str) -> None:
    judged = Benches(target_name)
    host = judged(Rig(sensing=RAILED))
    host.enable(TUNNEL)
    host.listen(2.0)
    assert "unexpected EMCY 7380h" in judged.complaints()
    assert "the drive is in Fault" in judged.complaints()
    judged.expected = {0x7380, 0x8130}
    assert judged.complaints() == ["EMCY 8130h never came"]
    judged.close()


@pytest.mark.needs("chip")
def test_verdict_finds_bus_errors_that_no_frame_tells(target_name: str) -> None:
    judged = Benches(target_name)
    host = judged()
    target = host.bus.bench.target
    assert isinstance(target, EmulatedTarget)  # what the chip's capability means
    target.chip.set_can_fault(CanFault.NO_ACK)
    host.listen(0.06)  # one heartbeat at least, sent again and again
    target.chip.set_can_fault(CanFault.NONE)
    (complaint,) = judged.complaints()
    assert "transmit errors" in complaint
    judged.close()


def test_failed_test_leaves_trace_truth_and_plot(benches: Benches, tmp_path: Path) -> None:
    host = benches()
    host.enable(TORQUE)
    directory = directory_of(tmp_path, "hil_tests/test_bench.py::test_x[a/b c]")
    assert directory == tmp_path / "test_bench-test_x-a-b-c"
    trace, truth, plot = keep(directory, host.bus.bench, 0)
    with can.BLFReader(trace) as reader:
        cob_ids = {message.arbitration_id for message in reader}
    assert {0x000, 0x610, 0x590, 0x710, 0x190} <= cob_ids  # both ways
    with np.load(truth) as kept:
        assert len(kept["load_torque_nm"]) == host.bus.bench.ticks
        assert kept["bridge_enabled"][-1]
    page = plot.read_text(encoding="utf-8")
    assert "tension (N)" in page
    assert "src=" not in page.split("<body>")[1][:200]  # nothing is loaded from elsewhere
