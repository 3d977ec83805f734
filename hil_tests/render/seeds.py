"""Which rigs a benchmark draws: the options `--seed` and `--rigs` of its command."""

from __future__ import annotations

import argparse


def add_seeds(parser: argparse.ArgumentParser) -> None:
    """Add the options to a command."""
    parser.add_argument("--seed", type=int, default=1, help="of the first rig (default: 1)")
    parser.add_argument("--rigs", type=int, default=10, help="of consecutive seeds (default: 10)")


def seeds_of(parser: argparse.ArgumentParser, options: argparse.Namespace) -> range:
    """Return the seeds that were asked for; the command ends where there are none."""
    if options.rigs < 1 or options.seed < 0:
        parser.error(f"--rigs, --seed: found {options.rigs}, {options.seed}; accepted: >= 1, >= 0")
    return range(options.seed, options.seed + options.rigs)
