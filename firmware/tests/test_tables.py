"""Tables in the drive: looked up exactly, refused by name, and as good as the law they stand for.

Truths: exact fractions for the look-up; a pair with other friction, of the same code but without a
table, for what a factor on the friction does to inversion and estimate.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from bowden.drive.meanings import (
    CompensationLaw,
    TableArgument,
    TableDefect,
    TableDirection,
    TablePlace,
)
from bowden.drive.table_layout import TableFields
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from firmware.tests.controlled import Controlled
from firmware.tests.native import Drive, Pair, ffi, lib, settings

KNOTS = 33
ONE_Q14 = 16384
MU = 0.21


class Tables:
    """tables_t with some tables in it."""

    def __init__(self, *tables: dict[str, Any]) -> None:
        self.raw = ffi.new("tables_t *")
        for i, table in enumerate(tables):
            fields = {"knots": len(table["value"]), **table}
            self.raw.settings[i] = ffi.new("table_settings_t *", fields)[0]
        lib.tables_configure(self.raw)

    def value(self, argument: int, number: int = 0) -> int:
        return int(lib.tables_value(ffi.addressof(self.raw.table[number]), argument))

    def step(self, load: int = 0, motor: int = 0, mdegc: int = 0, ticks: int = 1) -> Any:
        inputs = {
            "load_reading_urad": load,
            "motor_reading_urad": motor,
            "conduit_mdegc": mdegc,
            "ticks_per_s": 4000,
        }
        for _ in range(ticks):
            lib.tables_step(self.raw, ffi.new("tables_inputs_t *", inputs))
        return self.raw.now


def exact(values: list[int], first: int, span: int, argument: int, repeats: bool) -> Fraction:
    past = argument - first
    past = past % span if repeats else min(max(past, 0), span)
    place = Fraction(past * (len(values) - 1), span)
    knot = min(int(place), len(values) - 2)
    return values[knot] + (values[knot + 1] - values[knot]) * (place - knot)


@given(
    st.lists(st.integers(-(2**23) + 1, 2**23 - 1), min_size=2, max_size=KNOTS),
    st.integers(-(10**9), 10**9),
    st.integers(1, 2**30),
    st.integers(-(2**30), 2**30),
    st.booleans(),
)
@hypothesis_settings(max_examples=500, deadline=None)
def test_interpolation_is_within_one_of_the_exact(
    values: list[int], first: int, span: int, past: int, repeats: bool
) -> None:
    if repeats:
        values = [*values[:-1], values[0]]
    tables = Tables({"place": 1, "first": first, "span": span, "value": values, "repeats": repeats})
    truth = exact(values, first, span, first + past, repeats)
    # a place in Q24 is off by half a step and the relative 2^-31 of its ratio: of values up to
    # 2^24 apart that is one, and rounding half of one
    assert abs(tables.value(first + past) - truth) <= Fraction(5, 2)
    small = [v // 16 for v in values]
    of_small = Tables(
        {"place": 1, "first": first, "span": span, "value": small, "repeats": repeats}
    )
    truth = exact(small, first, span, first + past, repeats)
    assert (
        abs(of_small.value(first + past) - truth) <= 1
    )  # up to half a newton metre, or a ppm of 1


def test_knots_are_met_exactly_and_the_ends_are_flat() -> None:
    values = [5, -7, 11, 3]
    tables = Tables({"place": 1, "first": -300, "span": 900, "value": values})
    assert [tables.value(x) for x in (-300, 0, 300, 600)] == values
    assert tables.value(-(2**31) + 1) == 5
    assert tables.value(2**31 - 1) == 3


def test_tables_of_one_place_add_up_by_direction() -> None:
    load = TablePlace.LOAD_TORQUE
    tables = Tables(
        {"place": load, "value": [100]},
        {"place": load, "value": [20], "direction": TableDirection.POSITIVE},
        {"place": load, "value": [3], "direction": TableDirection.NEGATIVE},
        {"place": TablePlace.LOAD_CELL, "value": [-9]},
    )
    now = tables.step(ticks=4)
    assert list(now.load_torque_unm) == [103, 120]
    assert now.load_cell_unm == -9


def test_every_argument_is_the_one_it_is_called() -> None:
    ramp = [-1_000_000, 1_000_000]
    tables = Tables(
        *(
            {"place": TablePlace.LOAD_CELL, "argument": a, "first": -(10**6), "span": 2 * 10**6}
            | {"value": ramp if a is argument else [0]}
            for argument in [TableArgument.LOAD_ANGLE]
            for a in TableArgument
        )
    )
    assert tables.step(load=1234, motor=77, mdegc=55, ticks=9).load_cell_unm == 1234
    for argument, sensors, expected in (
        (TableArgument.MOTOR_ANGLE, {"motor": -4321}, -4321),
        (TableArgument.CONDUIT_TEMPERATURE, {"mdegc": 25_000}, 25_000),
    ):
        one = Tables(
            {"place": TablePlace.LOAD_CELL, "argument": argument, "first": -(10**6)}
            | {"span": 2 * 10**6, "value": ramp}
        )
        assert one.step(**sensors, ticks=3).load_cell_unm == expected
    speed = Tables(
        {"place": TablePlace.LOAD_CELL, "argument": TableArgument.LOAD_SPEED, "first": -(10**6)}
        | {"span": 2 * 10**6, "value": ramp}
    )
    for tick in range(2000):  # 100 urad a tick
        now = speed.step(load=100 * tick)
    assert now.load_cell_unm == pytest.approx(400_000, rel=1e-3)


# ---- what is refused ----

FRICTION_NM = 3.12  # 2 r T0 m of Table I, at the load


def defect(values_nm: list[float], **changes: Any) -> TableDefect:
    table = {
        "place": TablePlace.LOAD_TORQUE,
        "knots": len(values_nm),
        "span": 1_000_000,
        "value": [round(1e6 * v) for v in values_nm],
        **changes,
    }
    bounds = {
        "friction_unm": round(1e6 * FRICTION_NM),
        "limit_unm": 1_500_000,
        "motor_pulley_radius_nm": 20_000_000,
        "load_pulley_radius_nm": 104_000_000,
    }
    found = lib.tables_check(
        ffi.new("table_settings_t *", table), ffi.new("tables_bounds_t *", bounds)
    )
    return TableDefect(found)


STEEPEST = FRICTION_NM / 0.6  # N m/rad at the load


@pytest.mark.parametrize(
    ("values_nm", "changes", "expected"),
    [
        ([0.1], {}, TableDefect.NONE),
        ([], {}, TableDefect.KNOTS),
        ([0.1, 0.2], {"span": 0}, TableDefect.KNOTS),
        ([0.1], {"repeats": True}, TableDefect.KNOTS),
        ([0.0, 1.0, 0.0], {"repeats": True}, TableDefect.NONE),
        ([0.0, 1.0, 0.5], {"repeats": True}, TableDefect.JUMPS),
        ([7.7], {}, TableDefect.NONE),  # 1.5 N m of the motor are 7.8 at the load
        ([7.9], {}, TableDefect.VALUE),
        ([1.6], {"place": TablePlace.MOTOR_TORQUE}, TableDefect.VALUE),
        ([-0.89], {"place": TablePlace.FRICTION_FACTOR}, TableDefect.NONE),
        ([-0.91], {"place": TablePlace.FRICTION_FACTOR}, TableDefect.VALUE),
        ([3.1], {"place": TablePlace.FRICTION_FACTOR}, TableDefect.VALUE),
        ([0.6], {"place": TablePlace.LOAD_ANGLE}, TableDefect.VALUE),
        ([0.0, 0.99 * STEEPEST], {}, TableDefect.NONE),
        ([0.0, 1.01 * STEEPEST], {}, TableDefect.TOO_STEEP),
        ([0.0, 1.01 * STEEPEST], {"argument": TableArgument.CONDUIT_TEMPERATURE}, TableDefect.NONE),
        # at the motor both torque and angle are by the ratio, 5.2, smaller and larger
        (
            [0.0, 0.99 * STEEPEST / 5.2**2],
            {"place": TablePlace.MOTOR_TORQUE, "argument": TableArgument.MOTOR_ANGLE},
            TableDefect.NONE,
        ),
        (
            [0.0, 1.01 * STEEPEST / 5.2**2],
            {"place": TablePlace.MOTOR_TORQUE, "argument": TableArgument.MOTOR_ANGLE},
            TableDefect.TOO_STEEP,
        ),
        ([0.99 * FRICTION_NM], {"direction": TableDirection.POSITIVE}, TableDefect.NONE),
        ([1.01 * FRICTION_NM], {"direction": TableDirection.POSITIVE}, TableDefect.BEYOND_FRICTION),
        (
            [-1.01 * FRICTION_NM, 0.0],
            {"argument": TableArgument.LOAD_SPEED},
            TableDefect.BEYOND_FRICTION,
        ),
    ],
)
def test_a_table_that_cannot_be_right_is_refused(
    values_nm: list[float], changes: dict[str, Any], expected: TableDefect
) -> None:
    assert defect(values_nm, **changes) is expected


def test_a_table_that_does_not_fit_any_more_is_named_and_nothing_is_enabled() -> None:
    """2 N m at the load are 0.38 of the motor's 0.5 when it is taken; then the limit sinks."""
    drive = Drive()
    table = TableFields(TablePlace.LOAD_TORQUE, 0, 0, 0, 0, 0, (2_000_000,))
    assert drive.write_table(5, table.to_raw().to_bytes(148, "little")) == 0
    assert drive.write(0x2107, 0, 100_000, 4)[0] == 0x60
    drive.tick(2)  # the entries, then the table
    assert drive.values.configuration_error == 0x2162 << 8 | 5
    assert drive.values.table_defect == TableDefect.VALUE
    drive.tick(300)
    assert not drive.enable().bridge_enabled
    assert drive.write(0x2107, 0, 500_000, 4)[0] == 0x60
    drive.tick(2)
    assert (drive.values.configuration_error, drive.values.table_defect) == (0, 0)


# ---- a factor on the friction is other friction ----


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.3, 2.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_inversion_with_a_factor_is_that_of_a_pair_with_other_friction(
    factor: float, sign: int
) -> None:
    plain = Pair(settings(mu_d=MU))
    other = Pair(settings(mu_d=MU * factor))
    with_factor = ffi.new("sliding_t *", lib.sliding_of(plain.raw, 0))
    truth = ffi.new("sliding_t *", lib.sliding_of(other.raw, 0))
    lib.sliding_set_factor(with_factor, sign, round(factor * ONE_Q14))
    for load_nm in np.linspace(-12.0, 12.0, 49):  # taut, and either cable slack
        arguments = (round(1e6 * load_nm), sign)
        found = lib.sliding_motor_torque_unm(with_factor, *arguments) * 1e-6
        expected = lib.sliding_motor_torque_unm(truth, *arguments) * 1e-6
        assert found == pytest.approx(expected, rel=2e-3, abs=2e-3)
        back = lib.sliding_motor_torque_unm(with_factor, round(1e6 * load_nm), -sign)
        assert back == lib.sliding_motor_torque_unm(
            ffi.new("sliding_t *", lib.sliding_of(plain.raw, 0)), round(1e6 * load_nm), -sign
        )  # the other direction is as it was


def stroke(cycles: float = 3.0, ticks: int = 12_000) -> NDArray[np.float64]:
    swell = np.minimum(1.0, np.linspace(0.0, 6.0, ticks))
    return np.asarray(0.35 * swell * np.sin(np.linspace(0.0, 2 * math.pi * cycles, ticks)))


INVERSION = CompensationLaw.MODEL_INVERSION


def error_nm(
    rig_mu: float, model_mu: float, factor: float, law: CompensationLaw = INVERSION
) -> float:
    """RMS of the rendered torque, of a tunnel's wall at 0.5 N m, after the first cycle."""
    friction = ffi.new("uint32_t[2]", [round(factor * ONE_Q14)] * 2)
    loop = Controlled(
        rig=settings(mu_d=rig_mu),
        model=settings(mu_d=model_mu, motor_dead_band_unm=500, load_dead_band_nm=65_345),
    )
    loop.inputs.friction_q14 = friction
    loop.inputs.law = law
    angle = stroke()
    wanted = -1.0 * np.sin(angle / 0.35 * math.pi / 2)
    found = loop.run(wanted, angle)
    return float(np.sqrt(np.mean((found - wanted)[4000:] ** 2)))


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_a_factor_renders_as_well_as_the_true_friction(factor: float) -> None:
    """The rig has other friction than the drive's model; the table says by how much."""
    truth = error_nm(MU * factor, MU * factor, 1.0)
    without = error_nm(MU * factor, MU, 1.0)
    found = error_nm(MU * factor, MU, factor)
    assert found <= 1.2 * truth
    assert found < 0.75 * without


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_feed_forward_takes_the_factor_as_other_friction(factor: float) -> None:
    """Coulomb feed-forward knows nothing of the pair but its friction: the error is the truth's."""
    law = CompensationLaw.COULOMB
    truth = error_nm(MU * factor, MU * factor, 1.0, law)
    # The closed form for one radius, F = 2 T0 m, and the path's own sum differ by a thousandth.
    assert error_nm(MU * factor, MU, factor, law) == pytest.approx(truth, rel=0.01)
    assert error_nm(MU * factor, MU, 1.0, law) > 3.0 * truth


@pytest.mark.parametrize(
    "law", [CompensationLaw.SMOOTH_INVERSE, CompensationLaw.ADAPTIVE_HYSTERESIS]
)
def test_the_published_laws_take_the_factor_too(law: CompensationLaw) -> None:
    for factor in (0.7, 1.4):
        assert error_nm(MU * factor, MU, factor, law) < 0.8 * error_nm(MU * factor, MU, 1.0, law)


def test_a_factor_of_one_changes_no_bit() -> None:
    runs = []
    for friction in (ffi.NULL, ffi.new("uint32_t[2]", [ONE_Q14, ONE_Q14])):
        loop = Controlled()
        loop.inputs.friction_q14 = friction
        runs.append(loop.run(0.5, stroke(ticks=3000)))
    assert np.array_equal(*runs)


# ---- in the drive ----


def configured(law: CompensationLaw = INVERSION) -> Drive:
    drive = Drive()
    drive.values.mode_of_operation = -2
    drive.values.target_torque_unm = 50_000
    drive.values.motor_torque_limit_unm = 8_000_000
    drive.values.compensation_law = law
    drive.values.compensation_use_load_cell = 0
    return drive


def put(drive: Drive, number: int, place: TablePlace, value: int) -> None:
    """A table of one knot."""
    raw = TableFields(place, 0, 0, 0, 0, 0, (value,)).to_raw()
    ffi.memmove(drive.values.table[number], raw.to_bytes(148, "little"), 148)


def commands(drive: Drive, ticks: int = 3000, rests_ua: int = 0) -> list[int]:
    """Current commands while the load is moved to and fro; before that the motor has `rests_ua`."""
    drive.values.motor_torque_slew_unm_per_s = 1_000_000_000
    drive.sensors.motor_current_ua = rests_ua
    drive.enable()
    found = []
    for tick in range(ticks):
        counts = round(300 * math.sin(2 * math.pi * tick / 1500))
        drive.sensors.load_encoder_counts = counts
        drive.sensors.motor_encoder_counts = round(counts * 5.2 / 5)
        found.append(drive.tick().motor_current_ua)
        assert drive.state == 4
    return found


def test_a_table_of_a_constant_is_no_table_and_that_constant() -> None:
    """Motor torque 10 mN m: the current is less by as much, and the model does not see it."""
    plain = configured()
    shifted = configured()
    put(shifted, 2, TablePlace.MOTOR_TORQUE, 10_000)
    constant_ua = round(10_000 / 0.060)
    found, expected = commands(shifted, rests_ua=-constant_ua), commands(plain)
    # once the motor's limit cuts neither; the model's dead band is 500 uN m, 8300 uA
    assert np.abs(np.array(found) + constant_ua - expected)[10:].max() <= 4200

    gained = configured()
    put(gained, 1, TablePlace.MOTOR_GAIN, 250_000)
    off = np.abs(np.array(commands(gained)) * 1.25 - expected)[10:]
    steps = np.abs(np.diff(expected, prepend=0))[10:]
    assert np.all(off <= 8300 + steps)  # what a tick changes may come a tick later


def test_readings_on_the_bus_stay_readings() -> None:
    drive = configured()
    put(drive, 0, TablePlace.LOAD_ANGLE, 100_000)
    put(drive, 1, TablePlace.LOAD_CELL, 70_000)
    drive.tick(3)
    assert drive.values.load_angle_urad == 0
    assert drive.values.load_torque_unm == 0
    assert drive.raw.corrected.load_angle_urad == 100_000
    assert drive.raw.corrected.load_cell_unm == 70_000
    assert drive.raw.corrected.load_arc_nm == 0  # the model starts there
