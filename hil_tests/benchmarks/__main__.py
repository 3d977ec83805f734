"""`python -m hil_tests.benchmarks [--output build/bench.json] [--only NAME]`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from bowden.recording.atomic import replace_whole

from hil_tests.benchmarks import (
    bench_speed,
    board,
    first_call,
    lab_day,
    long_recordings,
    model_speed,
    newton_tendon,
    paced_day,
    paced_pages,
    paced_recording,
    render,
)
from hil_tests.benchmarks.measurement import Figure, machine

SUBJECTS: dict[str, Callable[[], list[Figure]]] = {
    "model": model_speed.figures,
    "first_call": first_call.figures,
    "newton": newton_tendon.figures,
    "long_recordings": long_recordings.figures,
    "bench": bench_speed.figures,
    "lab_day": lab_day.figures,
    "paced_day": paced_day.figures,
    "paced_recording": paced_recording.figures,
    "paced_pages": paced_pages.figures,
    "board": board.figures,
    "render": render.figures,
}


def main() -> int:
    """Run the subjects, say each figure on stderr, write all of them as JSON."""
    parser = argparse.ArgumentParser(prog="python -m hil_tests.benchmarks", description=__doc__)
    parser.add_argument("--output", type=Path, metavar="OUT.json", help="default: stdout")
    parser.add_argument("--only", choices=tuple(SUBJECTS), action="append", help="repeatable")
    args = parser.parse_args()
    found: list[Figure] = []
    for name in args.only or SUBJECTS:
        sys.stderr.write(f"{name} ...\n")
        for figure in SUBJECTS[name]():
            found.append(figure)
            goal = f"   (goal {figure.goal})" if figure.goal else ""
            sys.stderr.write(f"  {figure.name:42} {figure.value:10.4g} {figure.unit}{goal}\n")
    rows = [asdict(figure) | {"machine": machine()} for figure in found]
    document = json.dumps(rows, indent=2, ensure_ascii=False) + "\n"
    if args.output is None:
        sys.stdout.write(document)
        return 0
    args.output.parent.mkdir(parents=True, exist_ok=True)
    with replace_whole(args.output) as temporary:
        temporary.write_text(document, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
