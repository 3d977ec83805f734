"""`python -m hil_tests.hidden_effects --seed N [--kind KIND] [--effect NAME]... --output DIR`.

Writes recording.csv, model.yaml and truth.json of one case; the recording does not tell the truth.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hil_tests.hidden_effects import effects, unlisted
from hil_tests.hidden_effects.recordings import KINDS, draw_case


def main() -> int:
    """Draw one case and write it."""
    parser = argparse.ArgumentParser(prog="python -m hil_tests.hidden_effects", description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument(
        "--effect", action="append", choices=[*effects.HIDE, *unlisted.HIDE], metavar="NAME"
    )
    parser.add_argument("--length-s", type=float, default=30.0)
    parser.add_argument("--output", type=Path, required=True, metavar="DIR")
    args = parser.parse_args()
    names = args.effect or []
    kind = args.kind
    if kind is None:
        kind = "complete" if not names else "single" if len(names) == 1 else "pair"
        kind = "unlisted" if names and names[0] in unlisted.HIDE else kind
    case = draw_case(args.seed, kind, names or None, args.length_s)
    case.write(args.output)
    sys.stderr.write(f"{args.output}: {case.truth.kind}, {case.truth.strength:.3g} noise floors\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
