"""`import bowden` as a script uses it: lazy, flat, safe with a drive."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bowden
import numpy as np
import plotly.graph_objects as go
import pytest
from bowden.api import live
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.meanings import CompensationLaw, ModeOfOperation
from bowden.drive.power import Run, enable
from bowden_rig.bench import Bench
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

TIME = np.arange(0.0, 2.0, 1e-3)


@pytest.fixture(scope="module")
def moved() -> bowden.Recording:
    """A run that the model itself has made: it explains it."""
    given = bowden.Recording(
        TIME,
        motor_torque_nm=0.2 * np.sin(np.pi * TIME),
        load_angle_rad=0.3 * np.sin(np.pi * TIME),
        source="made.csv",
    )
    return bowden.simulate(bowden.table_1(), given)


def test_importing_loads_nothing_heavy_and_every_name_is_there() -> None:
    program = (
        "import sys, bowden; heavy = {'numba', 'numpy', 'plotly', 'scipy', 'pandas', 'can'};"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules);"
        "[getattr(bowden, name) for name in bowden.__all__]"
    )
    subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=True)
    assert set(bowden.__all__) == set(dir(bowden))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = bowden.nonsense


def test_a_simulation_is_a_recording_with_tensions(moved: bowden.Recording) -> None:
    table = bowden.to_dataframe(moved)
    assert table.index.name == "time_s"
    assert len(table) == TIME.size
    # pretension of Table I, before anything has moved
    assert table["motor_tension_a_n"].iloc[0] == pytest.approx(10.0)
    assert np.all(table["load_tension_b_n"] >= 0.0)


def test_a_model_explains_what_it_has_made(moved: bowden.Recording, tmp_path: Path) -> None:
    model_path, run_path = tmp_path / "rig.yaml", tmp_path / "run.csv"
    bowden.write_model(bowden.table_1(), model_path)
    bowden.write_csv(moved, run_path)
    for run in (moved, run_path, [str(run_path)]):
        comparison = bowden.compare(model_path, run)
        assert comparison.figures.gap < 1e-6  # the CSV keeps nine digits
    table = bowden.to_dataframe(comparison)
    assert list(table["recording"]) == [str(run_path)]
    assert table["gap"].iloc[0] == comparison.figures.gap
    drawn = bowden.figures(comparison)
    assert set(drawn) == {"time", "loop", "conditions"}
    assert all(isinstance(figure, go.Figure) for figure in drawn.values())


def test_every_channel_of_a_recording_is_drawn() -> None:
    run = bowden.Recording(TIME, {"load_angle_rad": TIME, "handle_force_n": TIME, "status": TIME})
    figure = bowden.figures(run)["time"]
    axes = sorted(axis for axis in figure.layout if axis.startswith("yaxis"))
    titles = [figure.layout[axis].title.text for axis in axes]
    assert titles == ["load angle (°)", "handle force (N)"]


def test_a_calibration_is_a_table_of_parameters(moved: bowden.Recording) -> None:
    found = bowden.calibrate(bowden.table_1(), moved, free=["rig.cable.pretension_n"], widen=True)
    table = bowden.to_dataframe(found)
    assert table["path"].tolist() == ["rig.cable.pretension_n"]
    assert table["value"].iloc[0] == pytest.approx(10.0, rel=0.01)


def test_errors_name_what_was_found_and_what_is_accepted(tmp_path: Path) -> None:
    with pytest.raises(bowden.BadInput, match=r"no-such\.yaml.*a readable model file"):
        bowden.read_model(tmp_path / "no-such.yaml")
    with pytest.raises(bowden.BadInput, match="to_dataframe: found int; accepted: Recording"):
        bowden.to_dataframe(1)
    with pytest.raises(bowden.BadInput, match="figures: found int"):
        bowden.figures(1)
    with pytest.raises(bowden.BadInput, match=r"no load_angle_rad.*mode torque-position"):
        bowden.simulate(bowden.table_1(), bowden.Recording(TIME, motor_torque_nm=0.0 * TIME))


def drive_on(bus: VirtualBus) -> Drive:
    return Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))


@pytest.mark.parametrize("fails", [False, True])
def test_a_block_leaves_the_bridge_off_however_it_ends(fails: bool) -> None:
    with VirtualBus(Bench(SimulatedRig(), make_target("native"))) as bus:
        drive = drive_on(bus)
        try:
            with live.left_safe(drive):
                enable(drive, Run(ModeOfOperation.TUNNEL))
                bus.advance(0.1)
                assert bus.bench.actuators.bridge_enabled
                if fails:
                    raise ZeroDivisionError
        except ZeroDivisionError:
            assert fails
        bus.advance(0.01)
        assert not bus.bench.actuators.bridge_enabled


def test_configure_and_record_in_virtual_time(tmp_path: Path) -> None:
    with VirtualBus(Bench(SimulatedRig(), make_target("native"))) as bus:
        drive = drive_on(bus)
        assert bowden.configure(drive, bowden.table_1(), segments=10) > 0
        assert bowden.configure(drive, bowden.table_1(), segments=10) == 0
        run = bowden.record(drive, 0.5, tmp_path / "run.blf", enable="tunnel")
        assert 0.5 <= np.ptp(run.time_s) < 0.7  # and the steps until the bridge is on
        assert (tmp_path / "run.blf.json").is_file()
        bus.advance(0.01)
        assert not bus.bench.actuators.bridge_enabled


def test_apply_writes_the_model_and_says_what_the_drive_leaves_out() -> None:
    lagging = bowden.table_1().with_effect("frictional_lag", {"lag_s": 0.05})
    with VirtualBus(Bench(SimulatedRig(), make_target("native"))) as bus:
        drive = drive_on(bus)
        with pytest.raises(bowden.BadInput, match="frictional_lag"):
            bowden.apply(drive, lagging)
        taken = bowden.apply(
            drive, lagging, compensation="coulomb", without_unsupported=True, segments=10
        )
        assert taken.changed > 0
        assert taken.left_out[0].startswith("effects[0] frictional_lag")
        assert taken.forecast.drive_error_nm > 0.0  # what the lag does
        assert drive.read("cable_segments") == 10
        assert drive.read_raw("compensation_law") == CompensationLaw.COULOMB
