"""The compensation laws on their own: closed forms of the sliding pair, and laws of any rig.

The pair that is controlled here is of the same code (controlled.py). What is proved: the inversion
is the inverse of the closed forms of test_transmission.py, mirrored exactly, bounded, and gives
friction back when it has been active. What it does at standstill is in
test_compensation_at_standstill.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from bowden.drive.meanings import CompensationLaw
from hypothesis import example, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from firmware.tests.controlled import (
    COUNT_NM,
    DAMPED,
    DISAGREES,
    FRICTION_NM,
    INVERSION,
    LIMITED,
    RATIO,
    Controlled,
    stroke,
)
from firmware.tests.native import Pair, ffi, lib, settings

WRAP = 1.5
LAWS = range(lib.COMPENSATION_LAW_COUNT)
MEASURED = (
    "wanted_unm",
    "motor_arc_nm",
    "load_arc_nm",
    "motor_torque_unm",
    "load_cell_unm",
)


def sliding(pair: Pair, floor_un: int = 0) -> Any:
    return lib.sliding_of(pair.raw, floor_un)


def torque_nm(found: Any, load_nm: float, sign: int) -> float:
    pointer = ffi.new("sliding_t *", found)
    return float(lib.sliding_motor_torque_unm(pointer, round(load_nm * 1e6), sign)) * 1e-6


# ---- the sliding pair, in closed form ----


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("load_nm", [-3.0, -1.04, 0.0, 0.5])
def test_both_taut_the_motor_gives_the_load_torque_and_the_friction(
    load_nm: float, sign: int
) -> None:
    """(S1): tau_m = (tau_l + 2 r_load T0 m sign) / rho."""
    found = torque_nm(sliding(Pair(settings())), load_nm * sign, sign)
    # the mesh of 20 segments has its friction 1e-5 off; two roundings
    assert found == pytest.approx(sign * (load_nm + FRICTION_NM) / RATIO, rel=2e-5, abs=2e-6)


def test_with_a_slack_cable_the_other_alone_is_a_capstan() -> None:
    """(S2), (S3): slack above 0.77233 and below -0.17233 N m at the motor (PHYSICS.md)."""
    found = sliding(Pair(settings()))
    assert torque_nm(found, 2.0, 1) == pytest.approx(2.0 / RATIO * math.exp(WRAP), rel=1e-5)
    assert torque_nm(found, -6.0, 1) == pytest.approx(-6.0 / RATIO * math.exp(-WRAP), rel=1e-5)
    for motor_nm, ratio in ((0.77233, math.exp(-WRAP)), (-0.17233, math.exp(WRAP))):
        at_limit = motor_nm * RATIO * ratio
        assert torque_nm(found, at_limit, 1) == pytest.approx(motor_nm, rel=1e-4)


@hypothesis_settings(max_examples=60, deadline=None)
@given(
    st.floats(-8.0, 8.0),
    st.floats(0.05, 0.3),
    st.floats(1.0, 20.0),
    st.lists(st.floats(0.15, 3.0), min_size=10, max_size=10),
)
def test_what_the_closed_form_asks_for_makes_the_wanted_torque_arrive(
    load_nm: float, mu_d: float, pretension_n: float, radii_m: list[float]
) -> None:
    """Any path: a pair dragged as a whole by its load carries exactly that."""
    pair = Pair(settings(10, mu_d=mu_d, pretension_n=pretension_n, radius_m=radii_m))
    motor_nm = torque_nm(sliding(pair), load_nm, 1)
    angle = stroke(0.0, 1.5)  # beyond any backlash of these rigs
    found = pair.run_torque(np.full_like(angle, motor_nm), angle)
    if abs(motor_nm) < 100:  # tensions within the range of the arithmetic
        # 2 nm of motor arc at EA/dx = 20 kN/m and 104 mm, rho uN m of motor torque
        assert found.load_torque_nm[-1] == pytest.approx(load_nm, rel=2e-5, abs=3e-5)


@hypothesis_settings(max_examples=60, deadline=None)
# The cables of a pair dragged without motor torque have 1.57 N at their slackest end: a higher
# floor would have the motor pull where nothing is wanted, which it does not.
@given(st.integers(-8_000_000, 8_000_000), st.sampled_from([1, -1]), st.integers(0, 1_550_000))
def test_the_slack_floor_keeps_the_cables_taut_and_mirrors(
    load_unm: int, sign: int, floor_un: int
) -> None:
    pair = Pair(settings())
    found = ffi.new("sliding_t *", sliding(pair, floor_un))
    motor_unm = lib.sliding_motor_torque_unm(found, load_unm, sign)
    assert lib.sliding_motor_torque_unm(found, -load_unm, -sign) == -motor_unm
    if floor_un > 0:
        angle = sign * stroke(0.0, 1.0, 0.1)
        run = pair.run_torque(np.full_like(angle, motor_unm * 1e-6), angle)
        # 2 nm of motor arc at EA/dx = 40 kN/m are 80 uN at the motor, exp(m) as much at the far
        # end, and 1 uN m of the limit is 50 uN: together below 1 mN
        assert np.min([series[-1] for series in run[2:6]]) >= floor_un * 1e-6 - 1e-3


# ---- our law ----


STAYS = 0.04  # of the friction, so that lateness of the sensors cannot make it push
STAYS_WITH_CELL = 0.02  # a cell takes back what pushes


@pytest.mark.parametrize("cell", [False, True])
def test_a_moved_load_feels_the_wanted_torque_not_the_friction(cell: bool) -> None:
    angle = np.concatenate([stroke(0.0, 0.5), stroke(0.5, -0.5), stroke(-0.5, 0.5)])
    felt = Controlled().run(0.0, angle, cell=cell)
    plain = Pair(settings()).run_torque(np.zeros_like(angle), angle).load_torque_nm
    settled = slice(4800, 5900)  # the last stroke but its reversal
    assert np.abs(plain[settled]).mean() == pytest.approx(FRICTION_NM, rel=0.01)
    left = np.abs(felt[settled]).mean() / FRICTION_NM
    if cell:
        assert left == pytest.approx(STAYS_WITH_CELL, rel=0.1)
    else:  # two deviations of what the observer knows; its prior's are 24 %
        assert STAYS < left < STAYS + 0.24
    rms = float(np.sqrt(np.mean(felt**2)) / np.sqrt(np.mean(plain**2)))
    assert rms < (0.2 if cell else 0.3)  # the reversals, and without a cell the first stroke


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_the_load_cell_closes_what_the_model_is_wrong_by(factor: float) -> None:
    wrong = settings(pretension_n=10 * factor, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    angle = np.concatenate([stroke(0.0, 0.5), stroke(0.5, -0.5, 1.0)])
    felt = Controlled(model=wrong).run(0.3, angle, cell=True) - 0.3
    # 1 s of integral at 10 1/s
    assert abs(felt[-1]) < (STAYS_WITH_CELL + 0.01) * FRICTION_NM


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.2])
def test_without_a_cell_a_wrong_model_does_not_push(factor: float) -> None:
    """What the encoders say keeps a drive that assumes too much friction from pushing."""
    wrong = settings(pretension_n=10 * factor, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=wrong)
    one.run(0.0, np.concatenate([stroke(0.0, 0.5), stroke(0.5, -0.5), stroke(-0.5, 0.5)]))
    felt = one.run(0.3, stroke(0.5, -0.5, 1.0)) - 0.3
    settled = felt[2000:]  # its reversal is over; the motion is negative: friction is felt positive
    assert np.all(settled > 0.0)
    # 20 % wrong, of which half at least is found; two deviations; what always stays
    assert np.all(settled < (STAYS + 0.1 + 0.24) * FRICTION_NM)


@hypothesis_settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(list(LAWS)),
    st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-0.6, 0.6)), min_size=1, max_size=5),
    st.booleans(),
)
@example(law=5, legs=[(0.0, 0.0), (0.0, 0.125)], cell=True)  # rests before it first moves
def test_the_mirror_image_is_exact_and_the_limit_holds(
    law: int, legs: list[tuple[float, float]], cell: bool
) -> None:
    there, back = (Controlled(inertia_kg_m2=3e-5, torque_limit_unm=500_000) for _ in range(2))
    at = 0.0
    for wanted_nm, angle_rad in legs:
        for angle in stroke(at, angle_rad, 0.05).tolist():
            there.inputs.law = back.inputs.law = law
            there.tick(wanted_nm, angle, cell)
            seen, mirrored = there.inputs, back.inputs
            mirrored.load_cell_valid = cell
            for name in MEASURED:
                setattr(mirrored, name, -getattr(seen, name))
            lib.compensation_step(back.raw, back.model.raw, mirrored)
            assert there.torque_unm == -back.raw.outputs.motor_torque_unm
            assert abs(there.torque_unm) <= 500_000
        at = angle_rad


@pytest.mark.parametrize("law", LAWS)
def test_inactive_asks_for_nothing(law: int) -> None:
    one = Controlled()
    one.inputs.law = law
    one.inputs.active = False
    one.run(1.0, stroke(0.0, 0.5, 0.1))
    assert one.torque_unm == 0


def test_beyond_the_motor_it_saturates_and_says_so() -> None:
    one = Controlled(torque_limit_unm=300_000)
    one.run(-1.0, stroke(0.0, -0.5))
    assert one.torque_unm == -300_000
    assert one.raw.outputs.flags & LIMITED


def test_an_unbelievable_model_is_compensated_less() -> None:
    """The motor encoder runs away from the model: confidence, and with it the share, goes."""
    one = Controlled()
    one.run(0.0, stroke(0.0, 0.5, 1.0))
    trusted = one.torque_unm
    one.encoder_slip_nm = 40_000_000
    one.run(0.0, stroke(0.5, 1.0, 1.0))
    assert one.raw.outputs.flags & DISAGREES
    assert one.raw.outputs.motor_torque_unm < trusted / 2


# ---- passivity and adaptation ----


@hypothesis_settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(-3_000_000, 3_000_000), st.integers(-2_000_000, 2_000_000)),
        min_size=1,
        max_size=40,
    )
)
def test_the_observer_books_every_joule_and_keeps_little_credit(
    steps: list[tuple[int, int]],
) -> None:
    """E is the sum of excess torque times motion, floored at the bank of 2 mrad of friction."""
    observer = ffi.new("passivity_t *", lib.passivity_of(104_000_000, 3_120_000))
    lib.passivity_step(observer, 0, 0)
    at_nm, energy_j = 0, 0.0
    for excess_unm, step_nm in steps:
        at_nm += step_nm
        lib.passivity_step(observer, at_nm, excess_unm)
        energy_j = max(energy_j + excess_unm * 1e-6 * step_nm / 104e6, -FRICTION_NM * 2e-3)
        # a step is rounded to 1 urad: 3 uJ at 3 N m
        assert lib.passivity_energy_uj(observer) * 1e-6 == pytest.approx(
            energy_j, abs=2e-6 * (1 + len(steps))
        )
        back_off = lib.passivity_back_off_q16(observer)
        assert (back_off > 0) <= (energy_j > -1e-4)
        assert 0 <= back_off <= 49152


def test_friction_that_is_too_high_in_the_model_is_given_back() -> None:
    """With a load cell: a free load that the compensation pushes is let go of."""
    wrong = settings(pretension_n=14.0, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=wrong, integral_gain_mhz=0)
    one.run(0.0, stroke(0.0, 0.05, 0.1), cell=True)
    early = one.torque_unm
    one.run(0.0, stroke(0.05, 1.0, 1.9), cell=True)
    assert one.raw.outputs.flags & DAMPED
    assert one.torque_unm < early
    # it ends where the pushing stops: at the true friction, less what the bias leaves
    assert one.torque_unm * 1e-6 * RATIO < 1.02 * FRICTION_NM


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_adaptation_finds_the_friction_and_freezes_without_excitation(factor: float) -> None:
    wrong = settings(pretension_n=10 / factor, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=wrong, adapt=True)
    outputs = one.raw.outputs
    one.run(0.0, np.zeros(400), cell=True)
    assert outputs.friction_factor_ppm == 1_000_000
    for _ in range(6):
        one.run(0.0, np.concatenate([stroke(0.0, 0.7, 1.0), stroke(0.7, 0.0, 1.0)]), cell=True)
    # 12 s against a time constant of 2 s of sliding
    assert outputs.friction_factor_ppm == pytest.approx(factor * 1e6, rel=0.03)
    one.run(0.0, np.zeros(400), cell=True)  # until the stroke counts as over
    learned = outputs.friction_factor_ppm
    one.run(0.5, np.zeros(2000), cell=True)
    one.run(0.0, stroke(0.0, 0.5), cell=False)
    assert outputs.friction_factor_ppm == learned
    assert outputs.pretension_factor_ppm == 1_000_000  # no cable was slack: nothing tells


@pytest.mark.parametrize(("friction", "pretension"), [(1.0, 0.75), (1.2, 1.0), (0.85, 1.25)])
def test_strokes_with_a_slack_cable_tell_pretension_from_friction(
    friction: float, pretension: float
) -> None:
    """A wall of 4 N m takes a cable slack, between the walls both are taut."""
    wrong = settings(
        pretension_n=10 / pretension,
        mu_d=0.2 / friction,
        motor_dead_band_unm=500,
        load_dead_band_nm=COUNT_NM,
    )
    one = Controlled(model=wrong, rig=settings(mu_d=0.2), adapt=True, torque_limit_unm=8_000_000)
    outputs = one.raw.outputs
    path = np.concatenate([stroke(-0.5, 0.5, 1.0), stroke(0.5, -0.5, 1.0)])
    wall_nm = np.clip(-40.0 * (path - np.clip(path, -0.25, 0.25)), -4.0, 4.0)
    one.run(0.0, stroke(0.0, -0.5), cell=True)
    for _ in range(10):
        one.run(wall_nm, path, cell=True)
    assert outputs.friction_factor_ppm == pytest.approx(friction * 1e6, rel=0.04)
    assert outputs.pretension_factor_ppm == pytest.approx(pretension * 1e6, rel=0.06)
    one.run(wall_nm[-1], np.full(400, -0.5), cell=True)  # until the stroke counts as over
    learned = outputs.friction_factor_ppm, outputs.pretension_factor_ppm
    one.run(0.5, np.full(2000, -0.5), cell=True)
    one.run(0.0, stroke(-0.5, 0.5), cell=False)
    assert (outputs.friction_factor_ppm, outputs.pretension_factor_ppm) == learned


def learned_numbers(one: Controlled) -> tuple[int, ...]:
    """Return all that is learned from a load cell."""
    laws, outputs = one.raw.laws, one.raw.outputs
    return (
        *laws.model_inversion.shift_q8_unm,
        laws.adaptive_hysteresis.amplitude_unm,
        one.raw.estimator.correction_q8_unm,
        outputs.friction_factor_ppm,
        outputs.pretension_factor_ppm,
    )


@pytest.mark.parametrize("law", [INVERSION, CompensationLaw.ADAPTIVE_HYSTERESIS])
def test_what_was_learned_from_a_cell_is_reset_and_nothing_else(law: CompensationLaw) -> None:
    """The model's friction is a quarter too high; the cell shows it, and is then found wrong."""
    wrong = settings(pretension_n=12.5, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=wrong, adapt=True)
    one.inputs.law = law
    lib.compensation_restore(one.raw, 1_100_000, 900_000)
    before = learned_numbers(one)
    for _ in range(3):
        one.run(0.0, np.concatenate([stroke(0.0, 0.7, 1.0), stroke(0.7, 0.0, 1.0)]), cell=True)
    after = learned_numbers(one)
    of_the_law = slice(0, 2) if law == INVERSION else slice(2, 3)
    assert after[of_the_law] != before[of_the_law]
    assert after[3] != 0
    assert after[4] != before[4]
    observer = ffi.addressof(one.raw.observer)
    friction_q16 = lib.friction_observer_mean_q16(observer)
    lib.compensation_reset_learned(one.raw)
    assert learned_numbers(one) == before
    # from encoders and current: right without any cell
    assert lib.friction_observer_mean_q16(observer) == friction_q16


def test_adaptation_is_bounded_and_off_unless_asked_for() -> None:
    one = Controlled()
    one.run(0.0, stroke(0.0, 0.5), cell=True)
    assert one.raw.outputs.friction_factor_ppm == 1_000_000
    for given_ppm, kept_ppm in ((0, 500_000), (700_000, 700_000), (2**32 - 1, 1_500_000)):
        lib.compensation_restore(one.raw, given_ppm, given_ppm)
        # Q24: 60 ppb
        assert one.raw.outputs.friction_factor_ppm == pytest.approx(kept_ppm, abs=1)
        assert one.raw.outputs.pretension_factor_ppm == pytest.approx(kept_ppm, abs=1)
