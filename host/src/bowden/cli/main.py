"""`bowden COMMAND ...`: finds the command's module, runs it, turns failures into an exit status.

Each command is one module of `bowden.cli` with a docstring (its ``--help`` text), `add_arguments`,
`run`, and examples in `EXAMPLES`. Only the module of the command that was asked for is imported,
so that `bowden --help` answers at once. Exit status: 0 done; 1 `verify` rejects; 2 bad input or
usage; 3 the drive or the bus failed; 130 interrupted (143 terminated), after the command has
cleaned up.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import NoReturn, Protocol, cast

from bowden.cli.warned import WARNINGS
from bowden.errors import BadInput, DriveFailed

# Fits spread simulations over all cores themselves: threads inside of small matrix products would
# only compete for the cores. Read when numpy is first imported, so set before any command is.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

#: Every command, in the order in which a newcomer meets them.
COMMANDS = {
    "demo": "simulated rig, drive, recording over CAN, comparison and report in one go",
    "demo-diagnosis": "diagnose a hidden effect of a simulated rig, apply the model, measure again",
    "rig": "run the simulated rig on a CAN bus",
    "scan": "list the CANopen nodes on the bus",
    "info": "show identity, state and error history of a drive",
    "faults": "list a drive's faults, present and latched, and what to do",
    "stop": "switch a drive's bridge off, or those of all nodes",
    "node": "show or set node id and bit rate, also of drives that share a node id",
    "home": "set the zero of a drive's angles to where the rig stands",
    "doctor": "check adapter, bus, drive and sensors; say what to do next",
    "commission": "from box to model: wiring, scales, stiffness, friction, step by step",
    "od": "read and write single values of the drive by name",
    "config": "keep a drive's configuration in a file: dump, diff, apply, restore",
    "configure": "write a model's rig into the drive and read it back",
    "apply": "write a model, reduced to what the drive supports, to the drive",
    "improve": "record, diagnose and apply in rounds, until the model explains the rig",
    "watch": "watch a drive live in the terminal; stop, start, mark by key",
    "studio": "the bench in a browser: live loop, stop, record, compare, diagnose",
    "record": "record both encoders, motor torque and load cell over CAN",
    "recover": "restore a capture from what a killed recorder has left",
    "replay": "send a recording onto a bus as its drives sent it",
    "simulate": "run the offline model on a recording's inputs",
    "compare": "compare recordings with the offline model",
    "calibrate": "fit named parameters of a model to recordings",
    "verify": "check whether a model explains recordings that it has not seen",
    "diagnose": "name the effect that a model lacks to explain recordings",
    "experiment": "run one of the paper's experiments on the offline model",
    "estimate": "stiffness, friction or pretension from recordings, with intervals",
    "sweep": "run an experiment over a grid or random draws of parameters",
    "export-fmu": "write a model as an FMU (FMI 3.0) for Simulink, Modelica tools or C",
    "convert": "turn recordings into the exchange form (CSV), Parquet, MAT, MCAP or MF4",
}

EXIT_DONE, EXIT_BAD_INPUT, EXIT_DRIVE_FAILED = 0, 2, 3
EXIT_INTERRUPTED, EXIT_BROKEN_PIPE, EXIT_TERMINATED = 130, 141, 143

_Handler = Callable[[int, FrameType | None], object] | int | None


class Command(Protocol):
    """What a command's module offers. `EXAMPLES` (str) is shown under its ``--help``."""

    __doc__: str | None

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Do it and return the exit status."""


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP, raised like Ctrl-C: every ``finally`` runs, the drive ends disabled."""


class OneLineParser(argparse.ArgumentParser):
    """An argument parser whose usage errors are one line, as every other error here."""

    def error(self, message: str) -> NoReturn:
        """Leave with status 2 and one line on stderr."""
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments after the program's name; `sys.argv` when not given.

    Returns
    -------
    int
        The exit status.
    """
    _open_closed_streams()
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = arguments[0] if arguments and arguments[0] in COMMANDS else None
    try:
        parser = build_parser([name] if name else [])
        args = parser.parse_args(arguments)
        if args.print_completion:
            return _print_completion(args.print_completion)
        if name is None:
            parser.print_help(sys.stderr)
            return EXIT_BAD_INPUT
    except ModuleNotFoundError as missing:
        return _fail(name, f"this installation lacks {missing.name}", EXIT_BAD_INPUT)
    except KeyboardInterrupt:  # loading a command takes a second on a busy machine
        return _fail(name, "interrupted", EXIT_INTERRUPTED)
    return run_command(name, args, _load(name).run)


def build_parser(load: Sequence[str]) -> argparse.ArgumentParser:
    """Make the parser; only the commands named in `load` are imported and get their arguments."""
    parser = OneLineParser(
        prog="bowden",
        description="An open drive for cable-conduit (Bowden) transmissions: host tools.",
        epilog="bowden COMMAND --help shows the command's arguments and examples.",
    )
    parser.add_argument("--version", action="version", version=f"bowden {_version()}")
    parser.add_argument(
        "--print-completion",
        choices=("bash", "zsh", "tcsh"),
        help="print the shell's completion script",
    )
    commands = parser.add_subparsers(metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        if name not in load:
            commands.add_parser(name, help=summary, add_help=False)
            continue
        command = _load(name)
        command_parser = commands.add_parser(
            name,
            help=summary,
            description=(command.__doc__ or summary).strip(),
            epilog=getattr(command, "EXAMPLES", None),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(command_parser)
    return parser


def run_command(
    name: str, args: argparse.Namespace, run: Callable[[argparse.Namespace], int]
) -> int:
    """Run one command; every failure that a user can cause or meet becomes one line on stderr."""
    try:
        with _SignalsUnwind(), _WarningsShown(name):
            status = run(args)
            sys.stdout.flush()
            return status
    except DriveFailed as failure:
        return _fail(name, str(failure), EXIT_DRIVE_FAILED)
    except BrokenPipeError:
        # The reader of the output has closed it; without this, Python reports that again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE
    except Terminated:
        return _fail(name, "terminated", EXIT_TERMINATED)
    except KeyboardInterrupt:
        return _fail(name, "interrupted", EXIT_INTERRUPTED)
    except BadInput as problem:
        return _fail(name, str(problem), EXIT_BAD_INPUT)
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        return _fail(name, f"{where}{problem.strerror or problem}", EXIT_BAD_INPUT)
    except ValueError as problem:
        if not _is_model_error(problem):
            raise
        return _fail(name, str(problem), EXIT_BAD_INPUT)


class _SignalsUnwind:
    """While a command runs, SIGINT, SIGTERM and SIGHUP unwind it, so that its clean-up runs.

    SIGINT too, because shells have background jobs ignore it. A hang-up that is ignored (nohup)
    stays ignored. Only the main thread may set handlers.
    """

    def __enter__(self) -> None:
        self._previous: dict[int, _Handler] = {}
        if threading.current_thread() is not threading.main_thread():
            return
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                self._previous[number] = signal.signal(number, self._unwind)

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    @staticmethod
    def _unwind(number: int, _frame: FrameType | None) -> NoReturn:
        raise KeyboardInterrupt if number == signal.SIGINT else Terminated


class _WarningsShown(logging.Handler):
    """While a command runs, a warning of the library is a line on stderr and in the JSON document.

    `output.print_json` adds the collected lines.
    """

    def __init__(self, name: str) -> None:
        super().__init__(logging.WARNING)
        self._name = name

    def emit(self, record: logging.LogRecord) -> None:
        text = " ".join(record.getMessage().split())
        if text not in WARNINGS:
            WARNINGS.append(text)
            print(f"bowden {self._name}: warning: {text}", file=sys.stderr)

    def __enter__(self) -> None:
        WARNINGS.clear()
        logging.getLogger("bowden").addHandler(self)

    def __exit__(self, *_: object) -> None:
        logging.getLogger("bowden").removeHandler(self)


def _load(name: str) -> Command:
    return cast(Command, importlib.import_module(f"bowden.cli.{name.replace('-', '_')}"))


def _version() -> str:
    from importlib.metadata import version  # noqa: PLC0415  (only --version and the parser need it)

    return version("bowden")


def _print_completion(shell: str) -> int:
    import shtab  # noqa: PLC0415  (rarely wanted)

    print(shtab.complete(build_parser(list(COMMANDS)), shell))
    return EXIT_DONE


def _is_model_error(problem: ValueError) -> bool:
    # The model is slow to import; where it has not been, the problem cannot be one of its errors.
    errors = sys.modules.get("bowden.model.errors")
    return errors is not None and isinstance(problem, errors.ModelError)


def _open_closed_streams() -> None:
    """Give a program that was started with a closed stream (``>&-``) one that loses its text."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            nowhere = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115  (until the end)
            setattr(sys, name, nowhere)


def _fail(name: str | None, text: str, status: int) -> int:
    line = " ".join(text.split())
    with suppress(OSError):  # a full or closed stderr does not change the status
        print(f"bowden {name}: {line}" if name else f"bowden: {line}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
