"""Fallback levels of the compensation on the simulated rig, over CAN, on every target.

What leads to which level, to the tick, is tested in firmware/tests/test_fallback; here it is that
the whole drive goes on, says so, and keeps the torque from jumping.
"""

from __future__ import annotations

import struct

import numpy as np
import pytest
from bowden.drive.dictionary import lookup
from bowden.drive.meanings import (
    CompensationFallback,
    CompensationLaw,
    CompensationLevel,
    ModeOfOperation,
)
from bowden_rig.rig.parameters import Cable, Operator, Rig, Sensing
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.benches import Benches
from hil_tests.lockstep_host import LockstepHost, samples

pytestmark = pytest.mark.needs("simulated-rig", "virtual-time")

Host = LockstepHost[VirtualBus]
TUNNEL, TORQUE = ModeOfOperation.TUNNEL, ModeOfOperation.TORQUE
COULOMB, MODEL_INVERSION = CompensationLaw.COULOMB, CompensationLaw.MODEL_INVERSION
WITH_CELL, WITHOUT_CELL, COULOMB_LEVEL, NONE = CompensationLevel
CELL_BROKEN, ENCODER_SLIPPED = (
    CompensationFallback.CELL_BROKEN,
    CompensationFallback.ENCODER_SLIPPED,
)
CELL_CAUSES = (
    CELL_BROKEN
    | CompensationFallback.CELL_END_OF_RANGE
    | CompensationFallback.CELL_STUCK
    | CompensationFallback.CELL_IMPLAUSIBLE
)
STATE, ENABLED = 0x6F, 0x27
WARNING = 0xFF01
SOFT = Cable(pretension_n=5.0)  # 2 r_in T0 m = 0.3 N m: the motor has torque to spare


def read(host: Host, name: str) -> int:
    entry = lookup(name)
    return entry.decode(host.read(entry.index, entry.sub))


def write(host: Host, name: str, value: float) -> None:
    entry = lookup(name)
    host.write(entry.index, entry.sub, entry.to_raw(value), entry.bits // 8)


def compensating(benches: Benches, rig: Rig, law: int = MODEL_INVERSION) -> Host:
    """A drive that knows the rig's pretension and has a law, its bridge still off."""
    host = benches(rig)
    write(host, "cable_pretension", rig.cable.pretension_n)
    write(host, "friction_static", 0.21)
    write(host, "compensation_law", law)
    host.listen(0.06)  # the model starts
    return host


def warnings(host: Host) -> list[tuple[int, int]]:
    """Level and causes of each warning on the wire."""
    told = [
        struct.unpack("<HxHH", f.data[:7])
        for f in host.frames
        if f.arbitration_id == 0x80 + host.node_id
    ]
    return [(level, causes) for code, causes, level in told if code == WARNING]


def test_the_law_that_is_configured_is_the_law_that_runs(benches: Benches) -> None:
    host = compensating(benches, Rig(cable=SOFT))
    host.enable(TUNNEL)
    host.listen(0.3)
    assert read(host, "compensation_active_law") == MODEL_INVERSION
    assert read(host, "compensation_level") == WITH_CELL
    assert read(host, "compensation_fallback") == 0
    wanted = read(host, "wanted_load_torque") * 1e-6
    angle = read(host, "load_angle") * 1e-6
    outside = max(abs(angle) - 0.05, 0.0)
    # eq. (7) times the ratio; the load moves on by 1 mrad between the two answers
    expected = -5.2 * np.sign(angle) * min(0.5 * outside, 0.2)
    assert wanted == pytest.approx(expected, abs=5.2 * 0.5 * 5e-3)


def test_a_load_cell_that_saturates_in_mid_motion_costs_a_fallback_level_and_not_the_tunnel(
    benches: Benches,
) -> None:
    benches.expected = {WARNING}
    # the cell reads 30 times too much: it is at its rail wherever the tunnel pulls
    host = compensating(benches, Rig(cable=SOFT, sensing=Sensing(load_cell_gain_error=29.0)))
    host.enable(TUNNEL)
    host.listen(1.0)
    got = samples(host.frames)
    assert np.all(got.statusword[-500:] & STATE == ENABLED)
    assert read(host, "compensation_level") == WITHOUT_CELL
    assert read(host, "compensation_active_law") == MODEL_INVERSION
    assert read(host, "compensation_fallback") & CELL_CAUSES
    assert warnings(host)
    assert all(level == WITHOUT_CELL and causes & CELL_CAUSES for level, causes in warnings(host))
    slew_nm = 20.0 * 1e-3  # the drive's slew limit in a sample of 1 ms
    converters = host.bus.bench.target.converters
    bound = slew_nm + 2 * (converters.motor_torque_nm + converters.regulation_nm) + 1e-3
    assert np.max(np.abs(np.diff(got.motor_torque_nm))) < bound


def test_an_encoder_that_does_not_fit_the_cables_leaves_coulomb_feed_forward(
    benches: Benches,
) -> None:
    benches.expected = {WARNING}
    # 0.6 rad at the motor: 12 mm of cable that both encoders disagree by
    sensing = Sensing(encoder_eccentricity_rad=0.6, load_cell_gain_error=0.0)
    host = compensating(benches, Rig(cable=SOFT, sensing=sensing))
    write(host, "stretch_tolerance", 0.1)  # else the supervision stops the drive
    host.enable(TUNNEL)
    host.listen(1.2)
    assert read(host, "statusword") & STATE == ENABLED
    assert any(
        level == COULOMB_LEVEL and causes & ENCODER_SLIPPED for level, causes in warnings(host)
    )


@pytest.mark.parametrize(("law", "warns"), [(0, set()), (MODEL_INVERSION, {WARNING})])
def test_an_encoder_that_leaves_the_cables_stops_the_drive(
    benches: Benches, law: int, warns: set[int]
) -> None:
    benches.expected = {0x7320} | warns
    sensing = Sensing(encoder_eccentricity_rad=0.6)
    host = compensating(benches, Rig(cable=SOFT, sensing=sensing), law)
    host.enable(TUNNEL)
    host.listen(1.2)
    assert not host.bus.bench.actuators.bridge_enabled


def test_torque_that_the_cables_hold_when_the_law_starts_is_no_broken_cell(
    benches: Benches,
) -> None:
    """The operator has moved the load without motor torque: friction holds 3 N m in the cables, of
    which a model that starts now knows nothing."""
    operator = Operator(starts="now", frequency_hz=0.1)
    rig = Rig(cable=Cable(pretension_n=10.0), operator=operator)
    host = benches(rig)
    host.listen(2.3)  # it all but rests at the end of its first stroke
    assert abs(read(host, "load_torque")) > 2e6
    write(host, "cable_pretension", rig.cable.pretension_n)
    write(host, "friction_static", 0.21)
    write(host, "compensation_law", MODEL_INVERSION)
    host.listen(0.5)
    assert read(host, "compensation_level") == WITH_CELL
    host.enable(TUNNEL)
    host.listen(1.5)
    assert read(host, "compensation_level") == WITH_CELL
    assert warnings(host) == []


def test_torque_mode_goes_through_the_law_as_well(benches: Benches) -> None:
    host = compensating(benches, Rig(cable=SOFT))
    write(host, "target_torque", 0.05)
    host.enable(TORQUE)
    host.listen(0.2)
    assert read(host, "wanted_load_torque") == pytest.approx(5.2 * 0.05e6, abs=6)
    assert read(host, "compensation_active_law") == MODEL_INVERSION


def test_a_law_cannot_be_changed_while_current_flows(benches: Benches) -> None:
    host = compensating(benches, Rig(cable=SOFT), law=COULOMB)
    host.enable(TUNNEL)
    with pytest.raises(RuntimeError, match="08000022h"):
        write(host, "compensation_law", MODEL_INVERSION)
    assert read(host, "compensation_active_law") == COULOMB
