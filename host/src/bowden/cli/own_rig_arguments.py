"""--start-rig and what belongs to it: a simulated rig of a command's own, not a connected drive."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import connect_drive
from bowden.cli.output import say
from bowden.cli.rig import add_target_argument
from bowden.drive.bus_options import bus_options

if TYPE_CHECKING:
    from bowden.drive.client import Drive

_LOG_FILE = "rig.log"


def add_own_rig_arguments(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup, *, seed: int, seed_of: str
) -> None:
    """Add ``--start-rig``, ``--set``, ``--seed`` and ``--target``.

    Parameters
    ----------
    parser : ArgumentParser, or a group of one
    seed : int
        The default.
    seed_of : str
        What the seed is of, for the help: ``"that rig's noise"``.
    """
    parser.add_argument(
        "--start-rig",
        action="store_true",
        help="on a simulated rig of its own, not a connected drive",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="PART.FIELD=VALUE",
        help="change that rig (bowden rig --rig-help)",
    )
    parser.add_argument(
        "--seed", type=int, default=seed, metavar="N", help=f"of {seed_of} (default: {seed})"
    )
    add_target_argument(parser)


@contextmanager
def drive_or_own_rig(
    args: argparse.Namespace,
    directory: Path,
    settings: Sequence[str] = (),
    further: Sequence[str] = (),
) -> Iterator[Drive]:
    """Lend the connected drive or, with ``--start-rig``, that of a simulated rig.

    Parameters
    ----------
    args : argparse.Namespace
        With the arguments above and those of `drive_arguments`.
    directory : Path
        Gets the rig's log.
    settings : sequence of str
        What the command itself changes of the rig, ``PART.FIELD=VALUE``; ``--set`` comes after it.
    further : sequence of str
        Other arguments of the rig's program.
    """
    if not args.start_rig:
        with connect_drive(args) as drive:
            yield drive
        return
    say("starting the simulated rig in a process of its own")
    with start_own_rig(args, directory, [*settings, *args.set], further) as drive:
        yield drive


def start_own_rig(
    args: argparse.Namespace,
    directory: Path,
    settings: Sequence[str],
    further: Sequence[str] = (),
) -> AbstractContextManager[Drive]:
    """Start a simulated rig with ``--target`` and ``--seed``, and lend its drive."""
    from bowden.drive.simulated_rig import own_rig  # noqa: PLC0415  (keeps --help fast)

    arguments = ["--target", args.target, "--seed", str(args.seed), *further]
    for setting in settings:
        arguments += ["--set", setting]
    return own_rig(bus_options(args), arguments, directory / _LOG_FILE)
