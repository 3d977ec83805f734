"""Restore a capture from what a killed recorder has left (NAME.blf.part).

After a power cut or `kill -9` the .part file holds all but the last quarter of a second. The
restored capture gets its intended name and is marked as cut. The .part is removed only when the
restored capture is complete.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.output import add_json_argument, print_json
from bowden.cli.record_summary import show_summary, summary
from bowden.drive.capture import Capture
from bowden.recording.capture_writer import recover
from bowden.recording.decode import nothing_decoded

EXAMPLES = """examples:
  bowden recover run.blf.part
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("part", type=Path, metavar="NAME.blf.part", help="what was left")
    parser.add_argument("--overwrite", action="store_true", help="replace NAME.blf if it is there")
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Recover and report what was saved."""
    writer = recover(args.part, overwrite=args.overwrite)
    decoded = writer.decoded or nothing_decoded()
    capture = Capture(writer.path, writer.side, decoded, writer.side.cut or "recovered")
    if args.json:
        print_json(summary(capture, capture.path))
    show_summary(capture, capture.path)
    return 0
