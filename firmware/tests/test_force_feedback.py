"""The part of the load cell's error that is added at once, and the operator who turns around.

Closed forms of (P1) in docs/compensation.md on the pair of controlled.py; what both are worth on
rigs unlike the model is measured by hil_tests/render.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from firmware.tests.controlled import COUNT_NM, FRICTION_NM, TICKS_PER_S, Controlled, stroke
from firmware.tests.native import lib, settings

DAMPING_PER_S = 150.0
LATE_S = 3e-3
BELIEVED_KG_M2 = 3e-5  # Controlled tells the drive so
MOST_LATE_TICKS = 8  # of a cell: 2 ms


class LateCell(Controlled):
    """The cell's reading comes some ticks late."""

    def __init__(self, late_ticks: int, **kind: Any) -> None:
        super().__init__(**kind)
        self.readings = [0] * (late_ticks + 1)

    def tick(self, wanted_nm: float, load_angle_rad: float, cell: bool = False) -> float:
        self.cell_error_unm = self.readings[0] - int(lib.transmission_load_torque_unm(self.rig.raw))
        arrives_nm = super().tick(wanted_nm, load_angle_rad, cell)
        self.readings = [*self.readings[1:], round(1e6 * arrives_nm)]
        return arrives_nm


def gain(one: Controlled, inertia_kg_m2: float = BELIEVED_KG_M2) -> float:
    """Half of D/(J omega^2 T), at most one."""
    stiffness = lib.sliding_of(one.model.raw, 0).motor_unm_per_rad * 1e-6
    return min(0.5 * DAMPING_PER_S * inertia_kg_m2 / (stiffness * LATE_S), 1.0)


def test_a_part_of_the_cells_error_is_added_at_once() -> None:
    """While the pair slides, all that the motor gives arrives. A cell that reads c too little then
    makes K c/(1 + K) more arrive; there is no integral here to wait for. (One that reads too much
    looks like a drive that pushes, and less friction is compensated.)"""
    found = []
    for error_nm in (-0.1, -0.3):
        one = Controlled(integral_gain_mhz=0)
        one.run(0.0, stroke(0.0, 0.4, 0.4), cell=True)
        one.cell_error_unm = round(1e6 * error_nm)
        arrives = one.run(0.0, stroke(0.4, 0.6, 0.2), cell=True)
        found.append(float(np.mean(arrives[400:])))
    share = gain(one) / (1.0 + gain(one))
    assert 0.1 < share < 0.5
    # the lag is one of whole ticks, 16 of 15.9; the encoder's counts move what arrives by a tenth
    assert found[1] - found[0] == pytest.approx(0.2 * share, rel=0.1)


@pytest.mark.parametrize("inertia", [0.7, 1.0, 1.4])
@pytest.mark.parametrize("wrong", [0.8, 1.0, 1.2])
def test_a_late_cell_makes_nothing_oscillate(inertia: float, wrong: float) -> None:
    """Half of the gain is left where inertia and friction are as wrong as this, and the cell as
    late as cells are: after steps on a load that slides on, what arrives settles."""
    model = settings(pretension_n=10 * wrong, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = LateCell(MOST_LATE_TICKS, model=model, inertia_kg_m2=inertia * BELIEVED_KG_M2)
    one.run(0.0, stroke(0.0, 0.4, 0.4), cell=True)
    place_rad = 0.4
    for wanted_nm in (0.5, -0.5):
        arrives = one.run(wanted_nm, stroke(place_rad, place_rad + 0.4, 0.4), cell=True)
        place_rad += 0.4
        swings = [np.ptp(part) for part in np.split(arrives[400:], 4)]  # of 75 ms each
        assert swings[-1] < max(0.25 * swings[0], 0.01 * FRICTION_NM)


@pytest.mark.parametrize("back_off", [0, 3])
@pytest.mark.parametrize("wrong", [0.85, 1.0, 1.15])
def test_a_tremor_turns_the_friction_over_each_time(wrong: float, back_off: int) -> None:
    """10 Hz by 20 mrad. A turn is three counts old after 7 ms, one count after 4; by then the error
    has left its dead band, unless that is still the one of changes without a cause."""
    model = settings(pretension_n=10 * wrong, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=model, inertia_kg_m2=BELIEVED_KG_M2)
    one.raw.laws.model_inversion.slip.back_off = back_off
    time_s = np.arange(6000) / TICKS_PER_S
    directions = []
    for place in (0.02 * np.sin(2.0 * math.pi * 10.0 * time_s)).tolist():
        one.tick(0.0, place, cell=True)
        directions.append(int(one.raw.laws.model_inversion.slip.direction))
    going = np.sign(np.cos(2.0 * math.pi * 10.0 * time_s))
    late_ticks = round(8e-3 * TICKS_PER_S)
    for turn in np.flatnonzero(np.diff(going))[5:-1] + 1:
        assert directions[turn + late_ticks] == going[turn + late_ticks]


def test_a_load_that_the_drive_has_pushed_back_is_no_operators() -> None:
    """The same motion, but the cell says that the drive pushes it: the direction keeps its
    back-off, and changes in less than half of the turns."""
    changes = []
    for pushes in (False, True):
        one = Controlled()
        time_s = np.arange(6000) / TICKS_PER_S
        angle = 0.02 * np.sin(2.0 * math.pi * 10.0 * time_s)
        going = np.sign(np.cos(2.0 * math.pi * 10.0 * time_s))
        directions = []
        for place, way in zip(angle.tolist(), going.tolist(), strict=True):
            arrives_nm = float(lib.transmission_load_torque_unm(one.rig.raw)) * 1e-6
            if pushes:
                one.cell_error_unm = round(1e6 * (way * FRICTION_NM - arrives_nm))
            one.tick(0.0, place, cell=True)
            directions.append(int(one.raw.laws.model_inversion.slip.direction))
        changes.append(int(np.count_nonzero(np.diff(directions[2000:]))))
    assert changes[1] < 0.5 * changes[0]
