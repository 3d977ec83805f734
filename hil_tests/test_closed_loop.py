"""The loop closed in virtual time: an effect hidden in the rig is named, applied and compensated.

The drive is the real firmware; the diagnosis sees what was recorded over CAN and the lab's model.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from bowden.cli.demo_diagnosis import HIDDEN, RIG, close_the_loop
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden_rig.bench import Bench
from bowden_rig.rig import parameters
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

HIDDEN_RAD = float(HIDDEN.partition("=")[2])


def test_a_named_effect_reduces_the_rendering_error(tmp_path: Path) -> None:
    rig = parameters.Rig()
    for setting in (*RIG, HIDDEN):
        rig = parameters.changed(rig, setting)
    with VirtualBus(Bench(SimulatedRig(rig, seed=3), make_target("native"))) as bus:
        drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
        loop = close_the_loop(
            drive, tmp_path, duration_s=10.0, seed=3, names=["wrap_angle_change", "load_cell_gain"]
        )
    found = loop.diagnosis
    assert found.verdict == "named"
    (effect,) = found.effects
    assert effect.name == "wrap_angle_change"
    # Only the product of wrap, coefficient and pretension is identifiable; the split follows from
    # the tolerances: 3 % of either is 0.3 of ten radians; two sigmas of both. What friction they
    # make together, T0 mu (L/R + extra), the recording tells.
    extra_rad = effect.parameters["extra_wrap_rad"].value
    assert extra_rad == pytest.approx(HIDDEN_RAD, abs=0.9)
    model = found.model
    made = model.value("rig.cable.pretension_n") * model.value("friction.mu_d")
    made *= 2.0 / 0.28 + extra_rad
    truth = rig.cable.pretension_n * rig.cable.friction * (2.0 / 0.28 + HIDDEN_RAD)
    assert made == pytest.approx(truth, rel=0.02)
    # Nearly all of either is the turn at one end, which periodic strokes repeat at the same part of
    # a count: one sample of that noise, in 95 of 100 recordings within two standard deviations.
    assert found.gap.after <= 2.0 * found.gap.noise_floor
    assert all(run.figures.full_law_share == 1.0 for run in loop.runs)
    none = loop.none.figures.rms_error_nm
    before, after = (
        {run.law: run.figures.rms_error_nm for run in runs} for runs in (loop.before, loop.after)
    )
    # Without a cell the lab's model lacks 30 % of the friction (3 of 10 rad), the diagnosed nothing
    # but reversals; with the cell the drive finds most of it by itself.
    assert before["coulomb"] > 0.25 * none
    assert after["coulomb"] < 0.1 * none
    assert after["model-inversion"] < 0.1 * none
    assert after["model-inversion"] < 1.05 * before["model-inversion"]
