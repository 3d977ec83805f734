"""What the commands that run the offline model share: the model file and the mode.

Reads model files; everything else is in the commands.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.errors import BadInput

if TYPE_CHECKING:
    from bowden.model import Mode, Model

MODES = ("torque-position", "position-torque", "position-position")


def add_model_argument(parser: argparse.ArgumentParser) -> None:
    """Add the positional model file."""
    parser.add_argument("model", metavar="MODEL", type=Path, help="model file (YAML)")
    parser.add_argument(
        "--effects",
        metavar="FILE.py",
        action=_OwnEffects,
        help="effects of your own, listed in EFFECTS; runs the code of that file",
    )


class _OwnEffects(argparse.Action):
    """Adds the effects of a file to the catalogue."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Run the file."""
        from bowden.model import ModelError  # noqa: PLC0415  (keeps --help fast)
        from bowden.model.effects import CATALOGUE  # noqa: PLC0415
        from bowden.model.effects.own import add_to, effects_in  # noqa: PLC0415

        del parser, option_string
        path = Path(str(values))
        try:
            add_to(CATALOGUE, effects_in(path), str(path))
        except ModelError as error:
            raise argparse.ArgumentError(self, str(error)) from error
        setattr(namespace, self.dest, path)


def add_mode_argument(parser: argparse.ArgumentParser, *, required: bool = False) -> None:
    """Add ``--mode``."""
    parser.add_argument(
        "--mode",
        choices=MODES,
        required=required,
        default=None if required else MODES[0],
        help="what the model takes from the recording, motor first; it predicts the rest"
        + ("" if required else " (default: %(default)s)"),
    )


def mode_of(args: argparse.Namespace) -> Mode:
    """Return the mode that was asked for."""
    from bowden.model import Mode  # noqa: PLC0415  (keeps --help fast)

    return Mode(args.mode)


def add_settle_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--settle``."""
    parser.add_argument(
        "--settle",
        type=float,
        default=0.0,
        metavar="S",
        help="the model runs through the first S seconds of each recording, and nothing in them is "
        "judged: for a rig whose cables hold tension from earlier strokes (default: 0, a rig "
        "whose cables do not)",
    )


def settle_of(args: argparse.Namespace) -> float:
    """Return the seconds at the start of each recording that are not judged."""
    from bowden.errors import BadInput  # noqa: PLC0415  (keeps --help fast)

    if not 0.0 <= args.settle < float("inf"):
        raise BadInput("--settle", f"{args.settle:g} s", "0 s or more")
    return float(args.settle)


def read_model(path: Path) -> Model:
    """Read and check a model file.

    Raises
    ------
    BadInput
        The file cannot be read.
    bowden.model.ModelError
        What it says describes no rig; all problems at once.
    """
    from bowden.model import parse_model  # noqa: PLC0415  (keeps --help fast)

    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(
            str(path), error.strerror or str(error), "a readable model file (YAML)"
        ) from error
    except UnicodeDecodeError as error:
        raise BadInput(str(path), "bytes that are not UTF-8 text", "a model file (YAML)") from error
    return parse_model(text, source=str(path))
