"""Are stated intervals true? `python -m hil_tests.benchmarks.calibration [--rigs N --seed N ...]`.

Simulation-based calibration: rigs whose numbers are drawn from the priors of their model files and
recorded by the independent solver are fitted by `calibrate` and `estimate` (`calibration_cases`);
how often the truth is in the 95 % interval, and its rank in the posterior, go to
build/calibration.json, the tables to --page (`calibration_score`). Developing seeds are below 1000;
figures are reported with a seed of 1000 or above that was not used in development. Interrupted, it
keeps what is done.
"""

from __future__ import annotations

import argparse
import datetime
import json
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Final

from bowden.recording.atomic import replace_whole

from hil_tests.benchmarks.calibration_cases import trials
from hil_tests.benchmarks.calibration_score import Trial, markdown
from hil_tests.benchmarks.side_by_side import each

PAGE: Final = """\
# Calibration: are the intervals true?

Written by `{command}`; do not edit.

Version {version}, {date}, seed {seed}, {rigs} rigs. Each rig's pretension, mu_d and EA are drawn
from the tolerances of its model file (10 %, 1 sigma). The independent solver records it
(`hil_tests/hidden_effects`: no code of the model): 15 to 20 s at 500 Hz or 1 kHz, a load encoder of
10000 counts a turn, a motor encoder of 2000, a load cell with 0.5 mN m of noise. `estimate` has no
prior for the numbers that it is asked for, the others keep their tolerances.

Calibrated means: 90 to 98 % of the truths inside, ranks even (p > 0.01), RMS z near 1, and at the
true numbers a chi-squared over its count of 0.5 to 1.1 in 90 % of the blocks of about a second. An
exact covariance leaves 80 % of blocks there, at some 140 observations a block; more means that it
is too wide. Rates carry Wilson's 95 % interval.

{tables}"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.calibration",
        description=(__doc__ or "").split("\n")[0],
        epilog="example: --rigs 20 --seed 7 --jobs 2",
    )
    parser.add_argument("--rigs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="reporting seeds: 1000 and above")
    parser.add_argument("--jobs", type=int, default=2, help="rigs at the same time")
    parser.add_argument("--most-minutes", type=float, default=float("inf"))
    parser.add_argument("--output", type=Path, default=Path("build/calibration.json"))
    parser.add_argument("--page", type=Path, help="write the documentation's page, too")
    args = parser.parse_args(arguments)
    if args.rigs < 1 or args.jobs < 1:
        parser.error(f"--rigs, --jobs: found {args.rigs}, {args.jobs}; accepted: 1 or more")
    args.output.parent.mkdir(parents=True, exist_ok=True)
    found: list[Trial] = []
    start = time.monotonic()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        rigs = ((args.seed, number) for number in range(args.rigs))
        for done, one in enumerate(each(trials, rigs, args.jobs), 1):
            found += one
            _write(args.output, args.page, args.seed, found)
            passed = time.monotonic() - start
            left = passed / done * (args.rigs - done)
            missed = [n.path.rpartition(".")[2] for t in one for n in t.numbers if not n.inside]
            failed = [f"{t.setting}: {t.error}" for t in one if t.error]
            sys.stderr.write(
                f"{done}/{args.rigs} left {left / 60:.0f} min | rig {one[0].rig}, missed: "
                f"{', '.join(missed) or 'none'}{'; '.join(['', *failed])}\n"
            )
            if passed > 60.0 * args.most_minutes:
                break
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
    if not found:
        return 1
    sys.stdout.write(markdown(found))
    return 0


def _write(output: Path, page: Path | None, seed: int, found: Sequence[Trial]) -> None:
    """Write what is done so far, whole or not at all."""
    rigs = len({one.rig for one in found})
    texts = {output: json.dumps({"seed": seed, "trials": [asdict(t) for t in found]}) + "\n"}
    if page is not None:
        command = "python -m hil_tests.benchmarks.calibration"
        texts[page] = PAGE.format(
            command=f"{command} --rigs {rigs} --seed {seed} --page {page}",
            version=version("bowden"),
            date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
            seed=seed,
            rigs=rigs,
            tables=markdown(found),
        )
    for path, text in texts.items():
        with replace_whole(path) as temporary:
            temporary.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
