"""How much of the core each interrupt takes, by what the rig and the bus are doing.

Runs the flashed ELF on the emulated chip and counts instructions. A cycle count is these times
`CYCLES_PER_INSTRUCTION`: the emulator has no wait states, no pipeline and no cache misses, and on
the chip branches, loads and flash make an instruction take about one and a half cycles.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import can
from bowden.drive.dictionary import lookup
from bowden.drive.meanings import (
    CompensationLaw,
    ModeOfOperation,
    TableArgument,
    TablePlace,
)
from bowden.drive.table_layout import KNOTS, TableFields
from bowden_rig.rig.parameters import Operator

from hil_tests.board_bench import TARGET_TORQUE, TORQUE_MODE, Board
from hil_tests.board_parity import COMPENSATION_LAW, SETTLE_S
from hil_tests.lockstep_host import CONTROLWORD, NMT_START

CYCLES_PER_INSTRUCTION: Final = 1.5
CORE_HZ: Final = 168_000_000
TICK_CYCLES: Final = CORE_HZ // 4000
SAMPLE_CYCLES: Final = CORE_HZ // 20_000

# Exception numbers: name and period in core cycles, None for what comes when it comes.
INTERRUPTS: Final[dict[int, tuple[str, int | None]]] = {
    14: ("control tick (PendSV)", TICK_CYCLES),
    16 + 18: ("current loop (ADC)", SAMPLE_CYCLES),
    15: ("supervision (SysTick)", TICK_CYCLES),
    16 + 20: ("frame received (CAN1_RX0)", None),
    16 + 23: ("index pulse (EXTI9_5)", None),
    0: ("main loop", None),
}


@dataclass(frozen=True)
class Scenario:
    """What goes on while instructions are counted."""

    name: str
    operator: Operator
    mode: int = ModeOfOperation.TUNNEL
    command: Callable[[Board], None] | None = None  # in every control period
    babbler: can.Message | None = None  # on the bus without a pause
    law: CompensationLaw = CompensationLaw.NONE
    tables: bool = False  # all eight, with all their knots


@dataclass(frozen=True)
class Share:
    """Instructions of one interrupt, or of the main loop from waking to sleeping.

    Without what interrupted it. `load` is its share of the core, 0 .. 1, in cycles.
    """

    interrupt: int
    name: str
    per_second: float
    median: float
    worst: int
    load: float


def _reversals(board: Board) -> None:
    """Turn the motor torque round every 20 ms, so that the cables slide anew."""
    torque = 0.4 if int(board.bench.time_s / 0.02) % 2 == 0 else -0.4
    if board.bench.ticks % 80 == 0:
        board.host.write(TARGET_TORQUE, 0, round(1e6 * torque), 3)


# Place, argument, direction, repeats, first, span and size of each table: what costs most of each.
_TABLES: Final = (
    (TablePlace.FRICTION_FACTOR, TableArgument.LOAD_ANGLE, 1, 0, -800_000, 1_600_000, 200_000),
    (TablePlace.FRICTION_FACTOR, TableArgument.LOAD_ANGLE, 2, 0, -800_000, 1_600_000, 300_000),
    (TablePlace.FRICTION_FACTOR, TableArgument.LOAD_SPEED, 0, 0, -9_000_000, 18_000_000, 250_000),
    (TablePlace.FRICTION_FACTOR, TableArgument.CONDUIT_TEMPERATURE, 0, 0, 0, 80_000, 100_000),
    (TablePlace.LOAD_TORQUE, TableArgument.LOAD_ANGLE, 0, 0, -800_000, 1_600_000, 100_000),
    (TablePlace.MOTOR_TORQUE, TableArgument.MOTOR_ANGLE, 0, 1, 0, 897_598, 5_000),
    (TablePlace.LOAD_ANGLE, TableArgument.LOAD_ANGLE, 0, 1, 0, 6_283_185, 5_000),
    (TablePlace.MOTOR_GAIN, TableArgument.MOTOR_ANGLE, 0, 1, 0, 6_283_185, 10_000),
)


def write_tables(board: Board) -> None:
    """Write all tables, each a sine."""
    for number, table in enumerate(_TABLES, 1):
        place, argument, direction, repeats, first, span, size = table
        sine = [size * math.sin(2.0 * math.pi * knot / (KNOTS - 1)) for knot in range(KNOTS)]
        values = tuple(round(value) for value in sine)
        raw = TableFields(place, argument, direction, repeats, first, span, values).to_raw()
        entry = lookup(f"table.{number}")
        board.host.write(entry.index, entry.sub, raw, entry.bits // 8)
    board.run(SETTLE_S)


# The shortest frame that passes the filters.
_SHORTEST: Final = can.Message(arbitration_id=0x080, is_extended_id=False)

SCENARIOS: Final = (
    Scenario("dwell", Operator(motion="locked")),
    Scenario("tunnel, 40 deg at 0.5 Hz", Operator(motion="sine")),
    Scenario("fast operator, 40 deg at 2 Hz", Operator(motion="sine", frequency_hz=2.0)),
    Scenario("reversals", Operator(motion="locked"), TORQUE_MODE, _reversals),
    # without motor torque the pulled-out cable goes slack in a third of each cycle
    Scenario("slack, 40 deg at 1 Hz", Operator(motion="sine", frequency_hz=1.0), TORQUE_MODE),
    Scenario("bus flood", Operator(motion="sine"), babbler=_SHORTEST),
    Scenario(
        "model inversion, 40 deg at 0.5 Hz",
        Operator(motion="sine"),
        law=CompensationLaw.MODEL_INVERSION,
    ),
    Scenario(
        "model inversion, 40 deg at 2 Hz, bus flood",
        Operator(motion="sine", frequency_hz=2.0),
        babbler=_SHORTEST,
        law=CompensationLaw.MODEL_INVERSION,
    ),
    Scenario(
        "model inversion, all tables, 40 deg at 2 Hz, bus flood",
        Operator(motion="sine", frequency_hz=2.0),
        babbler=_SHORTEST,
        law=CompensationLaw.MODEL_INVERSION,
        tables=True,
    ),
    Scenario(
        "model inversion, reversals",
        Operator(motion="locked"),
        TORQUE_MODE,
        _reversals,
        law=CompensationLaw.MODEL_INVERSION,
    ),
)


def measure(scenario: Scenario, duration_s: float = 2.0) -> list[Share]:
    """Count instructions for a while, with the bridge on.

    Parameters
    ----------
    scenario : Scenario
    duration_s : float
        Counted; boot and enabling are not.
    """
    board = Board(operator=scenario.operator)
    board.run(0.05)
    if scenario.law:
        board.host.write(COMPENSATION_LAW, 0, scenario.law, 1)
        board.run(SETTLE_S)
    if scenario.tables:
        write_tables(board)
    board.host.enable(scenario.mode)
    board.run(0.1)
    board.chip.set_babbling(scenario.babbler)
    chip = board.chip
    chip.reset_accounts()
    last: dict[int, list[int]] = {number: [] for number in INTERRUPTS}
    seen = dict.fromkeys(INTERRUPTS, 0)
    start_us = chip.time_us
    while chip.time_us - start_us < 1e6 * duration_s:
        if scenario.command is not None:
            scenario.command(board)
        board.run(0.00025)
        for number in INTERRUPTS:
            account = chip.account(number)
            if account.activations > seen[number]:
                seen[number] = account.activations
                last[number].append(account.last_exclusive)
    took_s = 1e-6 * (chip.time_us - start_us)
    if not chip.bridge().enabled:
        raise RuntimeError(f"{scenario.name}: the bridge went off: {board.emergencies()}")
    shares = []
    for number, (name, _) in INTERRUPTS.items():
        account = chip.account(number)
        load = account.total_exclusive * CYCLES_PER_INSTRUCTION / (CORE_HZ * took_s)
        median = statistics.median(last[number]) if last[number] else 0.0
        shares.append(
            Share(number, name, account.activations / took_s, median, account.worst_exclusive, load)
        )
    return shares


def table(found: dict[str, list[Share]]) -> str:
    """Markdown: a row an interrupt and scenario."""
    lines = [
        "| scenario | interrupt | a second | median | worst | worst, of its period | core |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for scenario, shares in found.items():
        for s in shares:
            period = INTERRUPTS[s.interrupt][1]
            part = f"{s.worst * CYCLES_PER_INSTRUCTION / period:.1%}" if period else ""
            lines.append(
                f"| {scenario} | {s.name} | {s.per_second:.0f} | {s.median:.0f} | "
                f"{s.worst} | {part} | {s.load:.1%} |"
            )
        total = sum(s.load for s in shares)
        lines.append(f"| {scenario} | **total** | | | | | **{total:.1%}** |")
    return "\n".join(lines) + "\n"


def reconfigure(babbler: can.Message | None = _SHORTEST) -> int:
    """Return the instructions of the worst control tick while a configuration is written and taken.

    The costliest one: all segments, all tables, model inversion; then a step up in mid-work.
    """
    board = Board(operator=Operator(motion="still"))
    board.run(0.05)
    board.chip.reset_accounts()
    board.host.write(COMPENSATION_LAW, 0, CompensationLaw.MODEL_INVERSION, 1)
    segments = lookup("cable_segments")
    board.host.write(segments.index, segments.sub, segments.high, segments.bits // 8)
    write_tables(board)
    slew = lookup("motor_torque_slew")
    for raw in range(1_000_000, 1_000_005):
        board.host.write(slew.index, slew.sub, raw, slew.bits // 8)
        board.chip.set_babbling(babbler)
        board.run(SETTLE_S)
        board.chip.set_babbling(None)
    board.host.nmt(NMT_START)
    board.host.write(CONTROLWORD, 0, 6, 2)
    board.host.write(slew.index, slew.sub, 2_000_000, slew.bits // 8)
    board.host.write(CONTROLWORD, 0, 15, 2)
    board.run(SETTLE_S)
    if not board.chip.bridge().enabled or board.emergencies():
        raise RuntimeError(f"the bridge did not go on: {board.emergencies()}")
    return board.chip.account(14).worst_exclusive
