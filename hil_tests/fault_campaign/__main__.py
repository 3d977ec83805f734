"""Runs the single-fault campaign and writes its table.

    python -m hil_tests.fault_campaign      everything; exit status as below
    python -m hil_tests.fault_campaign --output docs/fault-campaign.md
    python -m hil_tests.fault_campaign --target native --situation tunnel-none
    python -m hil_tests.fault_campaign --fault load_encoder-frozen --json build/faults.json
    python -m hil_tests.fault_campaign --update     after a change: rows that hold leave the list

Exit status 1: a row breaks a ceiling and is not in exceptions.yaml, or is in it and holds.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from hil_tests.fault_campaign.campaign import TARGETS, batches, run_all
from hil_tests.fault_campaign.exceptions import disagreements, load, save, updated
from hil_tests.fault_campaign.outcome import Outcome
from hil_tests.fault_campaign.page import page


def read_rows(file: Path) -> list[Outcome]:
    """Read what --json has written."""
    rows = json.loads(file.read_text(encoding="utf-8"))
    return [Outcome(**{k: v for k, v in row.items() if k != "holds"}) for row in rows]


def main(arguments: list[str] | None = None) -> int:
    """Run, show the progress on stderr, write the requested files."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.fault_campaign",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--target", action="append", choices=list(TARGETS), default=[])
    parser.add_argument("--situation", action="append", default=[], metavar="NAME")
    parser.add_argument("--fault", action="append", default=[], metavar="LINE-KIND")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default 1)")
    parser.add_argument("--json", type=Path, metavar="OUT.json", help="also write every row")
    parser.add_argument("--output", type=Path, metavar="OUT.md", help="write the page")
    parser.add_argument(
        "--update", action="store_true", help="bring exceptions.yaml in line with what was run"
    )
    parser.add_argument(
        "--rows",
        type=Path,
        action="append",
        default=[],
        metavar="IN.json",
        help="take the rows of an earlier --json instead of running any; may be given again",
    )
    options = parser.parse_args(arguments)
    outcomes = [outcome for file in options.rows for outcome in read_rows(file)]
    work = batches(options.target or list(TARGETS), options.situation, options.fault)
    if not work or not work[0].faults:
        parser.error("no row of that target, situation and fault")
    work = [] if options.rows else work
    for batch, found in zip(work, run_all(work, options.jobs), strict=True):
        outcomes += found
        broken = sum(not outcome.holds for outcome in found)
        sys.stderr.write(
            f"{batch.target}/{batch.situation}: {len(found)} rows, {broken} break a ceiling\n"
        )
    reasons = load()
    if options.update:
        reasons = updated(outcomes, reasons)
        save(reasons)
    if options.json:
        rows = [asdict(o) | {"holds": o.holds} for o in outcomes]
        options.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    if options.output:
        options.output.write_text(page(outcomes, reasons), encoding="utf-8")
    problems = disagreements(outcomes, reasons)
    for problem in problems:
        sys.stderr.write(f"{problem}\n")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
