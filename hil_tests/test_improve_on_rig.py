"""A round of `bowden improve` on the simulated rig, and what the next one records.

`test_improve.py` has the rounds' order and ends. Here the drive is the real firmware, and what is
hidden in the rig is found while the drive compensates with the lab's model.
"""

from __future__ import annotations

from pathlib import Path

from bowden.cli.demo_diagnosis import ENTRIES, LAB_MODEL, RIG
from bowden.cli.improve_bench import DriveBench
from bowden.cli.improve_rounds import improve
from bowden.cli.tunnel_experiment import SETTLE_S, TORQUE_CONSTANT_NM_PER_A
from bowden.diagnosis.compare import compare
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.connection import Connection
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import reduced_model
from bowden.estimation.gate.check import check_data
from bowden.model import Mode, parse_model
from bowden.recording.enabled import until_disabled
from bowden_rig.bench import Bench
from bowden_rig.rig import parameters
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

EXTRA_WRAP_RAD = 3.0


def test_a_round_finds_a_hidden_wrap_and_the_next_records_that_nothing_is_left(
    tmp_path: Path,
) -> None:
    rig = parameters.Rig()
    for setting in (*RIG, f"cable.extra_wrap_rad={EXTRA_WRAP_RAD}"):
        rig = parameters.changed(rig, setting)
    with VirtualBus(Bench(SimulatedRig(rig, seed=3), make_target("native"))) as bus:
        drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
        drive.write("torque_constant", TORQUE_CONSTANT_NM_PER_A)
        write(drive, difference(drive, ENTRIES | {"compensation_use_load_cell": 0}))
        bench = DriveBench(
            drive,
            CompensationLaw.COULOMB,
            duration_s=9.0,
            seed=3,
            names=["wrap_angle_change", "load_cell_gain"],
        )
        found = improve(bench, LAB_MODEL, "lab.yaml", tmp_path, rounds=1)
        assert not bus.bench.actuators.bridge_enabled
        page = bench.write_page(found, tmp_path)
        kept = parse_model((tmp_path / "model.yaml").read_text())
        assert difference(drive, reduced_model(kept).entries) == []
        again = bench.record(2, tmp_path / "again.blf")
    (first,) = found.state.rounds
    assert (first.verdict, first.effects) == ("named", ("wrap_angle_change",))
    assert page is not None
    assert "round 1" in page.read_text()
    # With 3 of 10 radians missing, feed-forward lacks a third of the friction. What is left of the
    # error then are reversals.
    assert again.figures.rms_error_nm < 0.4 * first.rendering_error_nm

    # The cables hold 2 N m of the round before, of which virgin ones know nothing; the first
    # strokes erase them. Left is what counts leave open at reversals.
    whole = until_disabled(again.recording)
    recording = whole.since(SETTLE_S)
    figures = compare(kept, [recording]).figures
    assert figures.gap < 1.5 * figures.noise_floor
    assert compare(kept, [whole]).figures.gap > 5.0 * figures.noise_floor
    # Nor does the data gate take a good recording for one of another rig.
    assert check_data(kept, [recording], Mode.TORQUE_POSITION) == ()
    assert check_data(kept, [whole], Mode.TORQUE_POSITION) != ()
