"""The fallback levels: which law runs while something that the configured one needs fails, and that
the torque never jumps. Time is counted in ticks. In the whole drive: test_drive_fallback.py.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from bowden.drive.meanings import CompensationFallback, CompensationLevel
from hypothesis import example, given
from hypothesis import strategies as st

from firmware.tests.native import ffi, lib

WITH_CELL, WITHOUT_CELL, COULOMB, NONE = CompensationLevel
REFUSED, BROKEN, END_OF_RANGE, STUCK, IMPLAUSIBLE, SLIPPED, SATURATES = CompensationFallback
TICKS_PER_S = 4000
STEP_UNM, CLEAN_TICKS, TOLERANCE_UNM, SLIP_NM = 500, 4000, 1_500_000, 4_000_000


def fallback_with(**settings: Any) -> Any:
    """A fallback on its best level, with the dictionary's default settings."""
    fallback = ffi.new("fallback_t *")
    defaults = {
        "use_load_cell": True,
        "step_unm": STEP_UNM,
        "clean_ticks": CLEAN_TICKS,
        "tolerance_unm": TOLERANCE_UNM,
        "slip_limit_nm": SLIP_NM,
    }
    lib.fallback_start(fallback, ffi.new("fallback_settings_t *", defaults | settings))
    return fallback


class Cell:
    """A load cell of 0.2 mN m a count that follows the estimate, and never stands still."""

    def __init__(self) -> None:
        self.ticks = 0

    def __call__(self, torque_unm: int, **found: Any) -> Any:
        self.ticks += 1
        counts = torque_unm // 200 + self.ticks % 2
        sane = {
            "cell_counts": counts,
            "cell_torque_unm": torque_unm,
            "model_torque_unm": torque_unm,
        }
        return ffi.new("fallback_found_t *", sane | found)


def run(fallback: Any, ticks: int, cell: Cell, **found: Any) -> None:
    for _ in range(ticks):
        lib.fallback_step(fallback, cell(0, **found))


# ---- what leads down, and up again ----


@pytest.mark.parametrize(
    ("found", "ticks", "cause", "level"),
    [
        ({"cell_torque_unm": TOLERANCE_UNM + 8, "model_margin_unm": 7}, 200, IMPLAUSIBLE, 1),
        ({"innovation_nm": SLIP_NM + 8, "innovation_margin_nm": 7}, 200, SLIPPED, COULOMB),
        ({"cell_broken": True}, 1, BROKEN, WITHOUT_CELL),
        ({"cell_end_of_range": True}, 1, END_OF_RANGE, WITHOUT_CELL),
        ({"cell_torque_unm": TOLERANCE_UNM + 1}, 200, IMPLAUSIBLE, WITHOUT_CELL),  # 50 ms
        ({"innovation_nm": SLIP_NM + 1}, 200, SLIPPED, COULOMB),  # 50 ms
        ({"innovation_nm": -SLIP_NM - 1}, 200, SLIPPED, COULOMB),
        ({"model_saturates": True}, 1, SATURATES, COULOMB),
    ],
)
def test_each_cause_leads_to_its_level_in_its_time_and_back_after_the_clean_time(
    found: dict[str, Any], ticks: int, cause: int, level: int
) -> None:
    fallback, cell = fallback_with(), Cell()
    run(fallback, ticks - 1, cell, **found)
    assert (fallback.level, fallback.causes) == (WITH_CELL, 0)
    run(fallback, 1, cell, **found)
    assert (fallback.level, fallback.causes) == (level, cause)
    run(fallback, CLEAN_TICKS - 1, cell)
    assert fallback.level == level
    run(fallback, 1, cell)
    assert (fallback.level, fallback.causes) == (WITH_CELL, 0)


def test_a_cause_that_returns_starts_the_clean_time_anew() -> None:
    fallback, cell = fallback_with(), Cell()
    run(fallback, 1, cell, cell_broken=True)
    run(fallback, CLEAN_TICKS - 1, cell)
    run(fallback, 1, cell, cell_broken=True)
    run(fallback, CLEAN_TICKS - 1, cell)
    assert fallback.level == WITHOUT_CELL
    run(fallback, 1, cell)
    assert fallback.level == WITH_CELL


def test_the_worst_of_several_causes_decides_and_the_way_up_has_steps() -> None:
    fallback, cell = fallback_with(), Cell()
    run(fallback, 1, cell, cell_broken=True, model_saturates=True)
    assert (fallback.level, fallback.causes) == (COULOMB, BROKEN | SATURATES)
    run(fallback, CLEAN_TICKS, cell, cell_broken=True)
    assert (fallback.level, fallback.causes) == (WITHOUT_CELL, BROKEN)


def test_a_cell_that_stands_still_while_the_estimate_moves_is_stuck() -> None:
    fallback, cell = fallback_with(), Cell()
    run(fallback, 10, cell)
    stuck = {"cell_counts": 0, "cell_torque_unm": 0}
    moved = TOLERANCE_UNM // 4
    run(fallback, 300, cell, **stuck, model_torque_unm=0)  # nothing moves: as it should be
    run(fallback, 1, cell, **stuck, model_torque_unm=moved)
    assert fallback.causes == 0
    run(fallback, 1, cell, **stuck, model_torque_unm=moved + 1)
    assert (fallback.level, fallback.causes) == (WITHOUT_CELL, STUCK)


def test_a_quiet_cell_may_read_the_same_for_a_moment() -> None:
    fallback, cell = fallback_with(), Cell()
    run(fallback, 10, cell)
    stuck = {"cell_counts": 7, "cell_torque_unm": 0}
    run(fallback, 1, cell, **stuck)  # the cell's last move
    moved = {"model_torque_unm": TOLERANCE_UNM // 2}
    run(fallback, 199, cell, **stuck, **moved)  # just under 50 ms
    assert fallback.causes == 0
    run(fallback, 1, cell, **stuck, **moved)
    assert fallback.causes == STUCK


def test_a_motor_that_swings_on_its_cables_is_no_slip() -> None:
    """12 Hz, twice as far as the limit: a light motor that takes up a slack cable. The model has no
    masses; a slip would stay."""
    fallback, cell = fallback_with(), Cell()
    for tick in range(4000):
        innovation_nm = round(2 * SLIP_NM * math.sin(2 * math.pi * 12 * tick / TICKS_PER_S))
        lib.fallback_step(fallback, cell(0, innovation_nm=innovation_nm))
        assert fallback.level == WITH_CELL


def test_a_cell_that_is_not_used_cannot_be_wrong() -> None:
    fallback, cell = fallback_with(use_load_cell=False), Cell()
    assert fallback.level == WITHOUT_CELL
    run(fallback, 400, cell, cell_broken=True, cell_torque_unm=5_000_000)
    assert (fallback.level, fallback.causes) == (WITHOUT_CELL, 0)


def test_without_a_model_nothing_is_compensated_for_ever() -> None:
    fallback, cell = fallback_with(model_refused=True), Cell()
    assert (fallback.level, fallback.causes) == (NONE, REFUSED)
    run(fallback, 2 * CLEAN_TICKS, cell)
    assert (fallback.level, fallback.causes) == (NONE, REFUSED)


# ---- a wrong cell: how far it is used until that is found, and what is reset then ----

torques = st.integers(-8_388_608, 8_388_607)  # an i24


@given(cell_unm=torques, model_unm=torques, margin_unm=st.integers(0, 2**31 - 1))
@example(cell_unm=-8_388_608, model_unm=8_388_607, margin_unm=0)
@example(cell_unm=8_388_607, model_unm=0, margin_unm=2**31 - 1)
def test_a_cell_is_used_as_far_as_the_model_leaves_it_possible(
    cell_unm: int, model_unm: int, margin_unm: int
) -> None:
    """As it reads where that is possible; else the nearest torque that is."""
    found = Cell()(model_unm, cell_torque_unm=cell_unm, model_margin_unm=margin_unm)
    used_unm = lib.fallback_plausible_unm(fallback_with(), found)
    most_unm = TOLERANCE_UNM + margin_unm
    assert used_unm == min(max(cell_unm, model_unm - most_unm), model_unm + most_unm)


OFF_UNM = TOLERANCE_UNM + 1


@pytest.mark.parametrize(
    ("found", "cause", "used_wrong_cell"),
    [
        ({"cell_torque_unm": OFF_UNM}, IMPLAUSIBLE, True),
        ({"cell_torque_unm": -OFF_UNM}, IMPLAUSIBLE, True),
        ({"cell_counts": 7, "cell_torque_unm": 0, "model_torque_unm": 400_000}, STUCK, True),
        ({"cell_broken": True}, BROKEN, False),  # told at once: it was right until then
        ({"cell_end_of_range": True}, END_OF_RANGE, False),
        ({"innovation_nm": SLIP_NM + 1}, SLIPPED, False),
    ],
)
def test_a_wrong_cell_was_used_when_it_was_wrong_before_that_was_found(
    found: dict[str, Any], cause: int, used_wrong_cell: bool
) -> None:
    fallback, cell = fallback_with(), Cell()
    for _ in range(2):  # and again, when it was used again
        run(fallback, 1, cell, cell_counts=found.get("cell_counts", 0))  # the cell's last move
        ticks_of = []
        for tick in range(400):
            run(fallback, 1, cell, **found)
            if fallback.used_wrong_cell:
                ticks_of.append(tick)
                assert fallback.causes == cause
        assert len(ticks_of) == used_wrong_cell  # once, in the tick that finds it
        run(fallback, CLEAN_TICKS, cell)
        assert (fallback.level, fallback.causes) == (WITH_CELL, 0)


def test_what_a_broken_cell_reads_makes_it_no_wrong_cell_that_was_used() -> None:
    """What was learned from it before is right; what it reads since is not used."""
    fallback, cell = fallback_with(), Cell()
    for _ in range(2 * CLEAN_TICKS):
        run(fallback, 1, cell, cell_broken=True, cell_torque_unm=2 * OFF_UNM)
        assert not fallback.used_wrong_cell
    assert fallback.causes == BROKEN | IMPLAUSIBLE


# ---- the blend ----


@given(
    laws=st.lists(st.tuples(torques, torques, st.booleans()), min_size=2, max_size=40),
    step=st.integers(1, 1_000_000),
)
def test_a_change_of_the_level_moves_the_torque_by_no_more_than_the_step(
    laws: list[tuple[int, int, bool]], step: int
) -> None:
    """Each tick brings the torques of two laws; which of them runs changes at any time."""
    fallback = fallback_with(step_unm=step)
    second, before, given_before = False, laws[0], 0
    lib.fallback_idle(fallback)
    given_before = lib.fallback_blend(fallback, laws[0][0], False)
    for now in laws[1:]:
        changed = now[2]
        second ^= changed
        torque = now[second]
        given = lib.fallback_blend(fallback, torque, changed)
        # What the law itself moves is the law's; at a change, nothing of the jump between them.
        own = 0 if changed else torque - before[second]
        assert abs(given - given_before - own) <= step
        before, given_before = now, given


@given(start=torques, end=torques, step=st.integers(1000, 1_000_000))
def test_the_blend_ends_at_the_law_in_the_time_that_the_step_allows(
    start: int, end: int, step: int
) -> None:
    fallback = fallback_with(step_unm=step)
    lib.fallback_blend(fallback, start, False)
    ticks = math.ceil(abs(end - start) / step)
    given = lib.fallback_blend(fallback, end, True)
    for _ in range(ticks):
        given = lib.fallback_blend(fallback, end, False)
    assert given == end
