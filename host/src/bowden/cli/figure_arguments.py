"""What `compare` and `diagnose` share: their figures as files for papers."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

FORMS = ("svg", "pdf", "csv")


def add_figures_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--figures`` and ``--figure-form``."""
    parser.add_argument(
        "--figures", metavar="DIR", type=Path, help="write each figure as a file, too"
    )
    parser.add_argument(
        "--figure-form",
        choices=FORMS,
        action="append",
        metavar="FORM",
        help="of these files: svg, pdf (needs bowden[pdf]) or csv; repeatable (default: svg, csv)",
    )


def refuse_missing_forms(args: argparse.Namespace) -> None:
    """Refuse, before anything is computed, figures that could not be written.

    Raises
    ------
    BadInput
        PDF without its extra, a form without a folder, or a folder that cannot be written to.
    """
    from bowden.errors import BadInput  # noqa: PLC0415  (keeps --help fast)
    from bowden.report.figure_files import refuse_missing  # noqa: PLC0415

    if args.figure_form and not args.figures:
        raise BadInput("--figure-form", args.figure_form[0], "--figures DIR, which it is for")
    if args.figures:
        there = next(
            path for path in (args.figures, *args.figures.absolute().parents) if path.exists()
        )
        if not there.is_dir() or not os.access(there, os.W_OK):
            raise BadInput(str(args.figures), f"{there}, no folder that can be written to", "DIR")
    for form in args.figure_form or ():
        refuse_missing(f".{form}")


def write_figure_files(result: object, args: argparse.Namespace) -> list[Path]:
    """Write the figures that the arguments ask for."""
    from bowden.api.figure_files import write_figures  # noqa: PLC0415  (keeps --help fast)

    if not args.figures:
        return []
    forms = [f".{form}" for form in args.figure_form or ("svg", "csv")]
    return write_figures(result, args.figures, forms)
