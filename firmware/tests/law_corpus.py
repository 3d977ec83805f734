"""What the compensation laws answer on a fixed corpus, as digests: the guard of refactorings.

`python -m firmware.tests.law_corpus` compares the native build with law_corpus.json and says which
cases differ; with ``--write`` it freezes the present answers. A change that is meant to alter what
a law does freezes anew and says so in its commit.

A case is a law, with or without the load cell, on a pair that differs from the law's model, in one
of the scenarios below: strokes, set-point changes, friction wrong both ways, a weak motor, a motor
with inertia, a cell that dies, and changes to another law and back.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from firmware.tests.controlled import TICKS_PER_S, Controlled
from firmware.tests.native import settings

FILE: Final = Path(__file__).with_suffix(".json")
LAWS: Final = range(6)
TICKS: Final = 1600
INVERSION: Final = 5


class Case(NamedTuple):
    """One run; `answers` makes it."""

    name: str
    answers: Callable[[], bytes]


def _hand(seed: int, amplitude_rad: float) -> Any:
    """Angles of an operator's strokes, stops and reversals; the same numbers on every machine."""
    random = np.random.default_rng(seed)
    knots = np.concatenate([[0.0], random.uniform(-amplitude_rad, amplitude_rad, 8)])
    knots[3] = knots[2]  # a standstill
    knots[6] = knots[5]
    return np.interp(np.arange(TICKS), np.linspace(0, TICKS, len(knots)), knots)


def _wanted(seed: int, size_nm: float) -> Any:
    """Wanted torque: steps, and a slow sine."""
    random = np.random.default_rng(seed + 1)
    steps = np.repeat(random.uniform(-size_nm, size_nm, 4), TICKS // 4)
    return steps + 0.2 * size_nm * np.sin(2.0 * np.pi * np.arange(TICKS) / TICKS_PER_S)


def _creep(seed: int) -> tuple[Any, Any]:
    """Mostly standstill: a slow hand that now and then gives way, and a set point that swings."""
    random = np.random.default_rng(seed + 2)
    ticks = np.arange(4 * TICKS)
    moves = random.uniform(-0.02, 0.02, 9) * (np.arange(9) % 3 == 2)
    angles = np.interp(
        ticks, np.linspace(0, len(ticks), 10), np.concatenate([[0], np.cumsum(moves)])
    )
    wanted = np.zeros(len(ticks))
    for hertz, size_nm in ((0.7, 2.5), (1.9, 0.8), (5.3, 0.5)):
        wanted += size_nm * np.sin(2.0 * np.pi * hertz * ticks / TICKS_PER_S + random.uniform(0, 6))
    return angles, wanted


def _record(
    run: Controlled, law_of: Callable[[int], int], cell_until: int, paths: tuple[Any, Any]
) -> bytes:
    rows = []
    angles, wanted = paths
    for tick in range(len(angles)):
        run.inputs.law = law_of(tick)
        run.inputs.active = tick % 1500 < 1480  # the bridge goes off now and then
        run.tick(float(wanted[tick]), float(angles[tick]), cell=tick < cell_until)
        out = run.raw.outputs
        rows.append(
            (
                *(out.motor_torque_unm, out.load_torque_unm, out.innovation_nm, out.flags),
                *(out.slip, out.confidence, out.energy_uj, out.friction_unm),
            )
        )
    return np.array(rows, dtype="<i4").tobytes()


SCENARIOS: Final[dict[str, dict[str, Any]]] = {
    "as-modelled": {},
    "friction-too-low": {"rig": {"mu_d": 0.30}},
    "friction-too-high": {"rig": {"mu_d": 0.14}, "changes": {"adapt": 1}},
    "weak-motor": {"changes": {"torque_limit_unm": 400_000}},
    "heavy-motor": {"inertia_kg_m2": 3.0e-5},
    "slack-floor": {"changes": {"slack_floor_un": 3_000_000, "standstill_band_unm": 40_000}},
}


def cases() -> Iterator[Case]:
    """Every case, in a fixed order."""
    for place, (scenario, given) in enumerate(SCENARIOS.items()):
        strokes = (_hand(place, 0.3), _wanted(place, 2.0))
        for law in LAWS:
            for cell in (TICKS, 0):
                name = f"{scenario}/law-{law}/{'cell' if cell else 'no-cell'}"
                yield Case(name, _answers(given, lambda _, law=law: law, cell, strokes))
        for cell in (4 * TICKS, 0):
            for seed in range(4):
                name = f"{scenario}/creep-{seed}/{'cell' if cell else 'no-cell'}"
                paths = _creep(10 * place + seed)
                yield Case(name, _answers(given, lambda _: INVERSION, cell, paths))
        name = f"{scenario}/cell-dies"
        yield Case(name, _answers(given, lambda _: INVERSION, TICKS // 2, strokes))
        name = f"{scenario}/falls-back-and-returns"
        yield Case(
            name, _answers(given, lambda t: INVERSION if t % 800 < 500 else 1, TICKS, strokes)
        )


def _answers(
    given: dict[str, Any],
    law_of: Callable[[int], int],
    cell_until: int,
    paths: tuple[Any, Any],
) -> Callable[[], bytes]:
    def run() -> bytes:
        rig = settings(**given["rig"]) if "rig" in given else None
        controlled = Controlled(
            rig=rig, inertia_kg_m2=given.get("inertia_kg_m2", 0.0), **given.get("changes", {})
        )
        return _record(controlled, law_of, cell_until, paths)

    return run


def digests() -> dict[str, str]:
    """SHA-256 of every case's answers."""
    return {case.name: hashlib.sha256(case.answers()).hexdigest() for case in cases()}


def main(arguments: list[str] | None = None) -> int:
    """Compare or, with --write, freeze."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="freeze the present answers")
    options = parser.parse_args(arguments)
    found = digests()
    if options.write:
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        return 0
    frozen = json.loads(FILE.read_text(encoding="utf-8"))
    different = [name for name in found if frozen.get(name) != found[name]]
    for name in different:
        sys.stderr.write(f"{name}: differs\n")
    return 1 if different or frozen.keys() != found.keys() else 0


if __name__ == "__main__":
    sys.exit(main())
