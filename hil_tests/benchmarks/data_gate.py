"""Does the data gate name faults, and leave good recordings alone? `python -m ...data_gate`.

Recordings of the independent solver (`hil_tests.hidden_effects`: no code of the model) of rigs
within the tolerances of their model files, models complete or lacking effects: half of them strokes
at 1 kHz, half a locked load, a tunnel, nested strokes or a multisine at 200 Hz to 2 kHz. Each fault
of `data_gate_faults` is put into some of them; the others count false stops. The table goes into
the page between its two marks. Developing seeds are below 1000, reported ones 1000 and above.
"""

from __future__ import annotations

import argparse
import datetime
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np
from bowden.estimation.gate.check import check_data
from bowden.model import Mode, Model, parse_model
from bowden.recording.atomic import replace_whole
from bowden.recording.recording import Recording

from hil_tests.benchmarks.data_gate_faults import FAULTS
from hil_tests.benchmarks.diagnosis import recordings_of
from hil_tests.benchmarks.side_by_side import each
from hil_tests.hidden_effects import sets
from hil_tests.hidden_effects.recordings import KINDS, draw_case

BEGIN: Final = "<!-- table: python -m hil_tests.benchmarks.data_gate -->"
END: Final = "<!-- end of table -->"
LENGTH_S: Final = 30.0
LACKS: Final = {
    "complete": "complete",
    "single": "lacks one effect",
    "pair": "lacks two",
    "several": "lacks four",
    "unlisted": "lacks one that no catalogue has",
    "smooth_law": "lacks a smooth law",
}


@dataclass(frozen=True)
class Trial:
    """One recording: what the gate said of it without a fault and with each.

    Parameters
    ----------
    kind : str
        What the model lacks.
    hidden : tuple of str
    stopped : str
        The finding that stopped it although nothing is wrong; empty where none did.
    named : dict of str to bool
        By fault, where it was tried.
    """

    kind: str
    hidden: tuple[str, ...]
    stopped: str
    named: dict[str, bool] = field(default_factory=dict)


def trial(seed: int, number: int, faults: bool) -> Trial | None:
    """Draw one recording and ask the gate; None where the rig cannot be drawn."""
    kind, strokes = KINDS[number % len(KINDS)], number // len(KINDS) % 2 == 0
    try:
        if strokes or kind not in sets.KINDS:
            case = draw_case(seed + number, kind, length_s=LENGTH_S)
        else:
            case = sets.draw_set(seed + number, kind, length_s=LENGTH_S, count=1)
    except ArithmeticError:
        return None
    recording, *_ = recordings_of(case)
    model = parse_model(case.model_yaml)
    stops = _stops(model, recording)
    named = {}
    moves = bool(np.ptp(recording["load_angle_rad"]) > 0.0)  # a constant has no unit
    for fault in FAULTS if faults and moves else ():
        found = check_data(model, [fault.change(recording)], Mode.TORQUE_POSITION)
        named[fault.name] = fault.named(found)
    return Trial(kind, tuple(name for name, _ in case.truth.effects), stops, named)


def _stops(model: Model, recording: Recording) -> str:
    found = check_data(model, [recording], Mode.TORQUE_POSITION)
    return next((one.text for one in found if one.severity == "stop"), "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.data_gate", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--clean", type=int, default=200, help="recordings without a fault")
    parser.add_argument("--faulty", type=int, default=20, help="of them, with each fault, too")
    parser.add_argument("--seed", type=int, default=1, help="reporting seeds: 1000 and above")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--most-minutes", type=float, default=float("inf"))
    parser.add_argument("--page", type=Path, help="write the table into this page")
    args = parser.parse_args(arguments)
    if min(args.clean, args.faulty, args.jobs) < 1:
        parser.error("--clean, --faulty, --jobs: accepted: 1 or more")
    found: list[Trial] = []
    start = time.monotonic()
    rigs = ((args.seed, number, number < args.faulty) for number in range(args.clean))
    for one in each(trial, rigs, args.jobs):
        if one is None:
            continue
        found.append(one)
        sys.stderr.write(f"{len(found)} {one.kind} {'+'.join(one.hidden)} {one.stopped}\n")
        if args.page is not None:
            _write(args.page, args.seed, found)
        if time.monotonic() - start > 60.0 * args.most_minutes:
            break
    sys.stdout.write(table(found))
    return 0


def table(found: Sequence[Trial]) -> str:
    """Return the tables: false stops, then each fault."""
    kinds = [kind for kind in KINDS if any(one.kind == kind for one in found)]
    every = Counter(one.kind for one in found)
    stopped = Counter(one.kind for one in found if one.stopped)
    heads = [LACKS[kind] for kind in kinds]
    lines = ["| recordings | " + " | ".join(heads) + " |", "|---" * (len(kinds) + 1) + "|"]
    counts = " | ".join(f"{stopped[kind]} of {every[kind]}" for kind in kinds)
    lines += [f"| good ones that were stopped | {counts} |", ""]
    lines += ["| fault, recognised by name | " + " | ".join(heads) + " |"]
    lines += ["|---" * (len(kinds) + 1) + "|"]
    for fault in FAULTS:
        cells = []
        for kind in kinds:
            mine = [one.named[fault.name] for one in found if one.kind == kind and one.named]
            cells.append(f"{sum(mine)} of {len(mine)}" if mine else "-")
        lines.append(f"| {fault.name} | " + " | ".join(cells) + " |")
    wrong = [one for one in found if one.stopped]
    if wrong:
        lines += ["", "Stopped although good:", ""]
        lines += [f"- {'+'.join(one.hidden) or 'complete'}: {one.stopped}" for one in wrong]
    return "\n".join(lines) + "\n"


def _write(page: Path, seed: int, found: Sequence[Trial]) -> None:
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    today = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    made = (
        f"Version {version('bowden')}, {today}, seed {seed}: {len(found)} recordings of "
        f"{LENGTH_S:g} s, mode torque-position.\n\n"
    )
    with replace_whole(page) as temporary:
        temporary.write_text(
            f"{before}{BEGIN}\n\n{made}{table(found)}\n{END}{after}", encoding="utf-8"
        )


if __name__ == "__main__":
    sys.exit(main())
