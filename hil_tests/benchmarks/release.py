"""What full information reaches when a handle is let go, beside the law with the load cell.

    python -m hil_tests.benchmarks.release --rigs 10 --seed 1

Both are RMS errors over the uncompensated drive's, on the simulated rig; rigs whose friction alone
takes most of the motor's torque are left out. A rig takes about half a minute on one core.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from hil_tests.render.disturbed import DISTURBED
from hil_tests.render.laws import NAIVE
from hil_tests.render.released import reached_nm
from hil_tests.render.rigs import draw
from hil_tests.render.seeds import add_seeds, seeds_of
from hil_tests.render.tasks import task_named
from hil_tests.render.trial import judge, run


def main() -> int:
    """Print a table; the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_tests.benchmarks.release",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_seeds(parser)
    seeds = seeds_of(parser, parser.parse_args())
    ratios = []
    sys.stdout.write("| rig | law with the cell | full information |\n| ---: | ---: | ---: |\n")
    for seed in seeds:
        rig = draw(seed)
        if rig.apart:
            continue
        naive_nm = judge(run(rig, NAIVE, task_named("release", DISTURBED))).rms_nm
        law_nm, least_nm = reached_nm(rig)
        ratios.append((law_nm / naive_nm, least_nm / naive_nm))
        sys.stdout.write(f"| {seed} | {ratios[-1][0]:.3f} | {ratios[-1][1]:.3f} |\n")
        sys.stdout.flush()
    if ratios:
        law, least = np.median(ratios, axis=0)
        sys.stdout.write(f"| median of {len(ratios)} | {law:.3f} | {least:.3f} |\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
