"""The flashed ELF: its share of the core, and that it is the native drive bit for bit.

Needs build/stm32f405/bowden.elf (`make firmware`). The table of every interrupt and scenario goes
to stderr; the figures are the worst of them.
"""

from __future__ import annotations

import sys
import time
from typing import Final

from hil_tests.benchmarks.measurement import Figure
from hil_tests.board_bench import HANG, TICK_US, Board, store_to
from hil_tests.board_budget import CYCLES_PER_INSTRUCTION, SCENARIOS, measure, reconfigure, table
from hil_tests.board_parity import EXPERIMENTS, compare
from hil_tests.lockstep_host import NMT_RESET_NODE
from hil_tests.targets.emulated import ELF

HEARTBEAT: Final = (0x710, 127)  # pre-operational
#: Ways to start, and the code that leads to it in a control tick; None: a host's NMT reset.
STARTS: Final[dict[str, bytes | None]] = {
    "power-on": None,
    "NMT reset": None,
    "crash": store_to(0x0800_2000),
    "watchdog": HANG,
}
_TICK: Final = "drive_tick"
_PARITY_S: Final = 60.0
_COUNT_S: Final = 4.0


def figures() -> list[Figure]:
    """Measure; nothing where the ELF has not been built."""
    if not ELF.is_file():
        sys.stderr.write(f"  skipped: {ELF} is missing; run 'make firmware'\n")
        return []
    return [*_budget(), *_parity()]


def _budget() -> list[Figure]:
    found = {scenario.name: measure(scenario, _COUNT_S) for scenario in SCENARIOS}
    sys.stderr.write(table(found))
    by_interrupt = {
        share.interrupt: [shares[i] for shares in found.values()]
        for i, share in enumerate(next(iter(found.values())))
    }
    tick = max(by_interrupt[14], key=lambda s: s.worst)
    loop = max(by_interrupt[16 + 18], key=lambda s: s.worst)
    load = max(sum(s.load for s in shares) for shares in found.values())
    context = f"{len(found)} scenarios of {_COUNT_S:g} s on the emulated chip, 20 segments a cable"
    cycles = f"cycles taken as {CYCLES_PER_INSTRUCTION} x instructions"
    return [
        Figure(
            "drive.tick.worst_instructions",
            float(tick.worst),
            "instructions",
            f"the worst control tick: {context}",
            "14000, half of its 250 us at 168 MHz",
        ),
        Figure(
            "drive.tick.worst_instructions_reconfiguring",
            float(reconfigure()),
            "instructions",
            "the worst control tick while a configuration is written and taken: 40 segments a "
            "cable, all tables, model inversion, bus flood; bridge off",
            "14000, half of its 250 us at 168 MHz",
        ),
        Figure(
            "drive.current_loop.worst_instructions",
            float(loop.worst),
            "instructions",
            f"the worst 20 kHz interrupt: {context}",
            "2800, half of its 50 us at 168 MHz",
        ),
        Figure(
            "drive.core_load", load, "1", f"the busiest scenario of {context}; {cycles}", "0.35"
        ),
        Figure(
            "drive.boot.first_heartbeat_s",
            max(first_heartbeat_s(start) for start in STARTS),
            "s",
            f"from reset to the first heartbeat, emulated chip: {', '.join(STARTS)}; the latest",
            "0.06",
        ),
    ]


def first_heartbeat_s(start: str) -> float:
    """Return the time from one of `STARTS` to the first heartbeat after it."""
    board = Board()
    start_s = board.bench.time_s
    if start != "power-on":
        board.run(0.1)
        start_s = _restart(board, STARTS[start])
    heard = board.run(0.2)
    times_s = [m.timestamp for m in heard if (m.arbitration_id, m.data[0]) == HEARTBEAT]
    return min(t for t in times_s if t > start_s) - start_s


def _restart(board: Board, code: bytes | None) -> float:
    """Have the chip reset by a host or by code that goes wrong; when, within a tick before."""
    sound = board.chip.read_memory(board.chip.image.symbols[_TICK].address, len(code or b""))
    if code is None:
        board.host.nmt(NMT_RESET_NODE)
    else:
        board.patch(_TICK, code)
    before_s = board.bench.time_s
    while not board.restarts():
        before_s = board.bench.time_s
        board.run(TICK_US * 1e-6)
    board.patch(_TICK, sound)  # the start checks the image
    return before_s


def _parity() -> list[Figure]:
    rows = []
    start = time.perf_counter()
    for experiment in EXPERIMENTS:
        found = compare(experiment, _PARITY_S)
        if found.difference:
            sys.stderr.write(f"  Experiment {experiment.name}: {found.difference}\n")
        rows.append(
            Figure(
                f"drive.parity.experiment_{experiment.name[0]}.differences",
                float(bool(found.difference)),
                "1",
                f"Experiment {experiment.name}: actuators of {found.ticks} ticks and "
                f"{found.frames} CAN frames, ELF against native; SHA-256 {found.digest}",
                "0",
            )
        )
    factor = len(rows) * _PARITY_S / (time.perf_counter() - start)
    rows.append(
        Figure(
            "emulated.realtime_factor",
            factor,
            "simulated s per s",
            "emulated board, rig, native drive and comparison in one process",
            "1",
        )
    )
    return rows
