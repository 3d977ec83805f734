"""What `compare` and `diagnose` share: their figures as files for papers."""

from __future__ import annotations

import argparse
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
    """Refuse, before anything is computed, a form that this installation cannot write.

    Raises
    ------
    BadInput
        PDF without its extra, or a form without a folder.
    """
    from bowden.errors import BadInput  # noqa: PLC0415  (keeps --help fast)
    from bowden.report.figure_files import refuse_missing  # noqa: PLC0415

    if args.figure_form and not args.figures:
        raise BadInput("--figure-form", args.figure_form[0], "--figures DIR, which it is for")
    for form in args.figure_form or ():
        refuse_missing(f".{form}")


def write_figure_files(result: object, args: argparse.Namespace) -> list[Path]:
    """Write the figures that the arguments ask for."""
    from bowden.api.figure_files import write_figures  # noqa: PLC0415  (keeps --help fast)

    if not args.figures:
        return []
    forms = [f".{form}" for form in args.figure_form or ("svg", "csv")]
    return write_figures(result, args.figures, forms)
