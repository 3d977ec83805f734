"""Where a command's words go: one JSON document to stdout, everything for people to stderr.

Used by every command module; nothing else prints. Rich is imported only when something is shown.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--json`` to a command that reports."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON document to stdout as the result"
    )


def print_json(document: object) -> None:
    """Print the command's one document; NaN and infinity, unknown to JSON, become null."""
    print(json.dumps(_plain(document), indent=2, allow_nan=False, ensure_ascii=False))


def console() -> Console:
    """Return the console for people: stderr, coloured only on a terminal."""
    from rich.console import Console  # noqa: PLC0415  (keeps --help fast)

    return Console(stderr=True, highlight=False)


def say(text: str) -> None:
    """Tell people which step is done now."""
    console().print(f"[green]>[/] {text}")


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


def _plain(value: object) -> object:
    """Turn numpy values, tuples and non-finite numbers into what JSON can hold."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
