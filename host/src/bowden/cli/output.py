"""Output of a command: one JSON document to stdout, everything for people to stderr.

Used by every command module; nothing else prints. Rich is imported only when something is shown.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING

import numpy as np

from bowden.cli.warned import WARNINGS
from bowden.errors import BadInput

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress
    from rich.text import Text


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--json`` to a command that reports."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON document to stdout as the result"
    )


def print_json(document: object) -> None:
    """Print the command's one document; NaN and infinity, unknown to JSON, become null.

    Warnings of the command are under ``warnings``.
    """
    if WARNINGS and isinstance(document, dict):
        document = {**document, "warnings": [*document.get("warnings", []), *WARNINGS]}
    text = json.dumps(plain(document), indent=2, allow_nan=False, ensure_ascii=False)
    try:
        print(text, flush=True)
    except BrokenPipeError:  # its reader has closed it: `cli.main` ends quietly
        raise
    except OSError as error:
        where = error.strerror or str(error)
        raise BadInput("stdout", where, "a place that takes the JSON document") from error


def console() -> Console:
    """Return the console for people: stderr, coloured only on a terminal.

    Text is shown as it is: brackets in a file's or a channel's name are no markup (`styled`).
    """
    from rich.console import Console  # noqa: PLC0415  (keeps --help fast)

    class Shown(Console):
        def on_broken_pipe(self) -> None:  # rich would leave with exit status 1
            raise BrokenPipeError

    return Shown(stderr=True, highlight=False, markup=False)


def styled(*parts: str | Text | tuple[str, str]) -> Text:
    """Join parts to a text for `console`; a part in a colour is ``(text, style)``."""
    from rich.text import Text  # noqa: PLC0415  (keeps --help fast)

    return Text.assemble(*parts)


def say(text: str) -> None:
    """Print the current step to stderr."""
    console().print(styled((">", "green"), f" {text}"))


def progress(*columns: str) -> Progress:
    """Return a progress display on stderr: text, bar, percentage, remaining time, then `columns`.

    Parameters
    ----------
    *columns : str
        Rich format strings for further fields, such as ``"{task.fields[lost]} lost"``.
    """
    from rich.progress import (  # noqa: PLC0415  (keeps --help fast)
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        *(TextColumn(column) for column in columns),
        console=console(),
        disable=not sys.stderr.isatty(),
    )


LINE_EVERY_S = 10.0  # without a terminal


@contextmanager
def stages(first: str) -> Iterator[Callable[[str, float], None]]:
    """Show which stage of a long computation runs, and the share of the whole that is done.

    On a terminal a bar; elsewhere, as in a log or under a scheduler, a line every ten seconds.

    Parameters
    ----------
    first : str
        What is shown until the first stage begins.

    Yields
    ------
    callable (stage, share of the whole 0..1)
    """
    if sys.stderr.isatty():
        with progress() as bar:
            task = bar.add_task(first, total=1.0)
            yield lambda stage, share: bar.update(task, description=stage, completed=share)
        return
    began, now = time.monotonic(), (first, 0.0)

    def tell(stage: str, share: float) -> None:
        nonlocal now
        now = stage, share

    def show() -> None:
        stage, share = now
        passed = time.monotonic() - began
        print(f"{passed:.0f} s: {stage}, {100.0 * share:.0f} %", file=sys.stderr, flush=True)

    with _repeated(show, LINE_EVERY_S):
        yield tell


@contextmanager
def _repeated(action: Callable[[], None], every_s: float) -> Iterator[None]:
    """Do something again and again, from a thread: a stage may take minutes."""
    ended = Event()

    def work() -> None:
        while not ended.wait(every_s):
            action()

    thread = Thread(target=work, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def plain(value: object) -> object:
    """Turn numpy values, tuples and non-finite numbers into what JSON can hold."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
