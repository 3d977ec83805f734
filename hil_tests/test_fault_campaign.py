"""The single-fault campaign's own instruments, and a part of its rows on every run of the tests.

The whole campaign is `make bench-faults`; which rows may break a ceiling stands in exceptions.yaml.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.drive.meanings import CompensationLaw
from bowden_rig.bench import TICKS_PER_S

from hil_tests.board_bench import NEEDS_ELF
from hil_tests.fault_campaign.campaign import Batch, run_batch
from hil_tests.fault_campaign.exceptions import Reason, disagreements, load, updated
from hil_tests.fault_campaign.faults import FAULTS, Fault, Kind, Line, Stream
from hil_tests.fault_campaign.outcome import (
    ENERGY_CEILING_J,
    IMPULSE_CEILING_NMS,
    Outcome,
    judge,
)
from hil_tests.fault_campaign.situations import SITUATIONS, situation
from hil_tests.fault_campaign.trial import NativeFork, Trace, runner
from hil_tests.targets.emulated import EmulatedTarget

pytestmark = pytest.mark.timeout(600)  # a busy machine runs a batch of rows eight times slower

PERIOD_S = 1.0 / TICKS_PER_S
PROTOCOL_ERROR = 0x8200
TORQUE = situation("torque-none")
WRONG_ANGLE = Fault(Line.LOAD_ENCODER, Kind.OFFSET)

# Those that reach the operator soonest, one of every line; all rows are `make bench-faults`.
EVERY_TIME = (
    *("load_encoder-stuck", "load_encoder-frozen", "load_encoder-sign", "motor_encoder-stuck"),
    *("load_cell-stuck", "load_cell-sign", "motor_current-stuck", "bus_voltage-gain"),
    *("temperature-stuck", "motor_line-stuck", "motor_line-sign", "bridge_line-stuck"),
    *("target-sign", "commands-dropout", "commands-offset", "heartbeat-dropout"),
)
ON_THE_CHIP = (
    *("motor_current-stuck", "motor_current-frozen", "motor_current-sign", "motor_line-stuck"),
    *("load_encoder-frozen", "commands-dropout", "commands-offset"),
)
HOW_TO_UPDATE = (
    "look at the rows; then python -m hil_tests.fault_campaign --update, or a new reason"
)


def named(names: tuple[str, ...]) -> tuple[Fault, ...]:
    return tuple(fault for fault in FAULTS if fault.name in names)


# ---- instruments ----


@pytest.mark.parametrize(
    ("kind", "arrives"),
    [
        (Kind.STUCK, [2000, 2000, 2000]),
        (Kind.FROZEN, [10, 10, 10]),
        (Kind.OFFSET, [1010, 1020, 1030]),
        (Kind.GAIN, [15, 30, 45]),
        (Kind.SIGN, [-10, -20, -30]),
        (Kind.LATE, [10, 10, 10]),  # 20 ms late: the value from before
    ],
)
def test_a_broken_line_does_what_its_name_says(kind: Kind, arrives: list[int]) -> None:
    stream = Stream(Fault(Line.LOAD_ENCODER, kind), PERIOD_S)
    assert [stream(value) for value in (10, 20, 30)] == arrives


def test_a_late_line_is_late_by_its_time() -> None:
    stream = Stream(Fault(Line.LOAD_ENCODER, Kind.LATE), PERIOD_S)
    arrives = [stream(value) for value in range(200)]
    late = round(0.02 * TICKS_PER_S)
    assert arrives[late:] == list(range(200 - late))


def test_a_dropout_loses_half_of_the_samples_at_random() -> None:
    stream = Stream(Fault(Line.LOAD_ENCODER, Kind.DROPOUT), PERIOD_S)
    arrives = [stream(7) for _ in range(1000)]
    assert set(arrives) == {0, 7}
    assert 400 < arrives.count(0) < 600  # 6 sigma of a fair coin is 95


def trace(torque_nm: float, on: bool = True, speed: float = 1.0) -> Trace:
    ticks = TICKS_PER_S // 10
    return Trace(
        np.full(ticks, torque_nm), np.full(ticks, speed), np.full(ticks, on), emergencies=()
    )


def test_torque_between_going_on_and_stopping_is_no_excess() -> None:
    healthy, cut = trace(1.0), trace(-0.2, on=False)
    for torque_nm in (1.0, 0.3, 0.0, -0.2):
        found = judge("x", TORQUE, WRONG_ANGLE, trace(torque_nm), (healthy, cut))
        assert (found.impulse_nms, found.energy_j) == (0.0, 0.0)
        assert found.holds


@pytest.mark.parametrize(("torque_nm", "speed"), [(1.5, 1.0), (-0.7, -1.0)])
def test_impulse_and_energy_are_those_of_a_constant_excess(torque_nm: float, speed: float) -> None:
    healthy, cut = trace(1.0), trace(-0.2, on=False)
    run = trace(torque_nm, speed=speed)
    found = judge("x", TORQUE, WRONG_ANGLE, run, (healthy, cut))
    assert found.impulse_nms == pytest.approx(0.5 * 0.1)  # 0.5 N m for 0.1 s
    assert found.energy_j == pytest.approx(0.5 * 0.1 * 1.0)
    assert found.off_s is None


def test_excess_counts_until_20_ms_after_the_bridge_is_off() -> None:
    run = trace(1.5)
    run.bridge_on[TICKS_PER_S // 100 :] = False
    found = judge("x", TORQUE, WRONG_ANGLE, run, (trace(1.0), trace(0.0, on=False)))
    assert found.off_s == pytest.approx(0.01 + PERIOD_S)  # at the end of that tick
    assert found.impulse_nms == pytest.approx(0.5 * 0.03)


def test_a_bridge_that_goes_on_by_itself_never_holds() -> None:
    still = trace(0.0, on=False)
    run = trace(0.0, on=False)
    run.bridge_on[5] = True
    ready = situation("ready-to-switch-on")
    found = judge("x", ready, WRONG_ANGLE, run, (still, still))
    assert found.switched_on
    assert not found.holds


def outcome(name: str, holds: bool) -> Outcome:
    target, where, fault = name.split("/")
    impulse = IMPULSE_CEILING_NMS * (0.5 if holds else 2.0)
    return Outcome(target, where, fault, None, None, None, impulse, 0.0, 0.0, False)


def reason(*rows: str) -> Reason:
    text = "nothing tells a wrong angle from a right one"
    return Reason(reason=text, remedy=text, covers=["*/encoder-*"], rows=list(rows))


def test_exceptions_are_neither_missing_nor_stale() -> None:
    broken, holding = outcome("native/a/encoder-x", False), outcome("native/a/encoder-y", True)
    assert disagreements([broken, holding], [reason("native/a/encoder-x")]) == []
    (missing,) = disagreements([broken], [reason()])
    assert "no reason" in missing
    (stale,) = disagreements([holding], [reason("native/a/encoder-y")])
    assert "take it out" in stale


def test_an_update_moves_rows_that_were_run_and_no_others() -> None:
    ran = [outcome("native/a/encoder-x", False), outcome("native/a/encoder-y", True)]
    ran.append(outcome("native/a/cell-z", False))  # covered by no reason
    (found,) = updated(ran, [reason("native/a/encoder-y", "native/b/encoder-x")])
    assert found.rows == ["native/a/encoder-x", "native/b/encoder-x"]


def test_every_reason_covers_its_rows_and_every_row_exists() -> None:
    faults = {fault.name for fault in FAULTS}
    places = {where.name for where in SITUATIONS}
    for found in load():
        assert updated([], [found]) == [found]
        for row in found.rows:
            target, where, fault = row.split("/")
            assert target in ("native", "emulated")
            assert where in places
            assert fault in faults


def test_a_fork_starts_from_the_same_bits() -> None:
    fork = NativeFork(TORQUE)
    first = fork.run()
    fork.run(WRONG_ANGLE)
    again = fork.run()
    assert np.array_equal(first.load_torque_nm, again.load_torque_nm)
    assert first.bridge_on.all()
    assert not fork.run(stop=True).bridge_on.any()


def test_ceilings_are_those_of_the_page() -> None:
    assert pytest.approx(0.052) == IMPULSE_CEILING_NMS
    assert ENERGY_CEILING_J == 0.05


# ---- the campaign ----


@pytest.mark.parametrize("where", SITUATIONS, ids=lambda where: where.name)
def test_native_rows_hold_or_are_listed_with_their_reason(where: object) -> None:
    assert hasattr(where, "name")
    outcomes = run_batch(Batch("native", where.name, named(EVERY_TIME)))
    assert disagreements(outcomes, load()) == [], HOW_TO_UPDATE


@pytest.mark.parametrize("name", ["torque-none", "tunnel-none", "tunnel-adaptive-hysteresis"])
def test_a_host_that_is_silent_or_late_stays_below_the_ceilings_with_the_deadline_of_safety_md(
    name: str,
) -> None:
    """20 ms, as the ceiling's 20 ms of the motor's limit; the host sends every 10 ms."""
    where = replace(situation(name), command_deadline_s=0.02)
    run = NativeFork(where).run
    healthy = run()
    assert healthy.bridge_on.all()
    assert not healthy.emergencies
    stopped = run(stop=True), run(stop=True, cut=True)
    for fault in named(("commands-dropout", "commands-late")):
        found = judge("native", where, fault, run(fault, stop=True), stopped)
        assert found.off_s is not None
        assert found.off_s <= 0.02
        assert found.holds


TARGETS = ("target-stuck", "target-offset", "target-gain", "target-sign", "target-noise")


@pytest.mark.parametrize("law", list(CompensationLaw))
def test_no_wrong_target_reaches_the_operator_of_a_host_that_guards_its_commands(
    law: CompensationLaw,
) -> None:
    """All rows of exceptions.yaml about targets hold, at the default deadline."""
    where = replace(situation(f"torque-{law.word}"), guarded=True)
    run = NativeFork(where).run
    references = run(), run(cut=True)
    assert references[0].bridge_on.all()
    assert not references[0].emergencies
    for fault in named(TARGETS):
        found = judge("native", where, fault, run(fault), references)
        assert found.holds, fault.name
        assert found.told == PROTOCOL_ERROR


@pytest.mark.parametrize("name", ["torque-none", "tunnel-none", "tunnel-model-inversion"])
def test_a_host_that_repeats_its_last_frame_is_noticed_by_the_guard(name: str) -> None:
    """With the deadline of 20 ms; without the guard the frame is a sign of life for ever."""
    where = replace(situation(name), guarded=True, command_deadline_s=0.02)
    run = NativeFork(where).run
    (fault,) = named(("commands-frozen",))
    found = judge(
        "native", where, fault, run(fault, stop=True), (run(stop=True), run(stop=True, cut=True))
    )
    assert found.off_s is not None
    assert found.off_s <= 0.03  # one frame more of 10 ms had been taken
    assert found.holds


@NEEDS_ELF
def test_the_guard_on_the_flashed_elf() -> None:
    where = replace(situation("torque-none"), guarded=True)
    run = runner(where, EmulatedTarget)
    (fault,) = named(("target-stuck",))
    found = judge(
        "emulated",
        where,
        fault,
        run(fault, False, False),
        (run(None, False, False), run(None, False, True)),
    )
    assert found.holds
    assert found.told == PROTOCOL_ERROR


@NEEDS_ELF
@pytest.mark.parametrize("name", ["torque-none", "tunnel-model-inversion"])
def test_rows_on_the_flashed_elf_hold_or_are_listed_with_their_reason(name: str) -> None:
    outcomes = run_batch(Batch("emulated", name, named(ON_THE_CHIP)))
    assert disagreements(outcomes, load()) == [], HOW_TO_UPDATE
