"""The bench in a browser: live loop over the prescribed tunnel, stop, record, compare, diagnose.

Opens a page on this machine only (127.0.0.1); the printed address works once, in one browser. The
large stop is always in sight and on the space bar. The motor runs only while the page is there:
closing it, losing it or hiding its tab for a second stops the drive.
"""

from __future__ import annotations

import argparse
import socket
import webbrowser
from contextlib import closing
from pathlib import Path

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.model_arguments import read_model
from bowden.cli.output import console
from bowden.drive.live import LiveSession
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden rig &
  bowden studio --model rig.yaml --folder recordings
  bowden studio --port 8765 --no-browser -i socketcan -c can0
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--folder", type=Path, default=Path(), metavar="DIR", help="where recordings and reports go"
    )
    parser.add_argument(
        "--model", type=Path, metavar="MODEL.yaml", help="what recordings are compared with"
    )
    parser.add_argument("--port", type=int, default=0, metavar="N", help="default: a free one")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    if not args.folder.is_dir():
        todo = f"a folder for recordings that is there (mkdir {args.folder})"
        raise BadInput(str(args.folder), "no folder", todo)
    if args.model is not None:
        read_model(args.model)  # a mistake in it is said now, not after the first recording
    try:
        import uvicorn  # noqa: PLC0415  (an extra)

        from bowden.studio.access import HOST, Access  # noqa: PLC0415
        from bowden.studio.bench import StudioBench  # noqa: PLC0415
        from bowden.studio.serve import serve  # noqa: PLC0415
    except ImportError as error:
        todo = "pip install 'bowden[studio]'"
        raise BadInput("bowden studio", f"no package {error.name}", todo) from error
    assert uvicorn
    with closing(_listen(HOST, args.port)) as listening:
        access = Access(listening.getsockname()[1])
        with connect_drive(args) as drive, closing(LiveSession(drive)) as session:
            bench = StudioBench(session, args.folder, args.model)
            console().print(f"open {access.address}", soft_wrap=True)
            console().print("it works once, on this machine only; Ctrl-C ends")
            if not args.no_browser:
                webbrowser.open(access.address)
            serve(bench, access, listening)
            if bench.failure is not None:
                raise bench.failure
    return 0


def _listen(host: str, port: int) -> socket.socket:
    """Take the port before anything else is done."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen()  # a browser that is faster than the server waits
    except (OSError, OverflowError) as error:
        listening.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise BadInput("--port", f"{port} ({reason})", "a free port, or none given") from error
    return listening
