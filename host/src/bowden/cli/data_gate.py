"""Run the data gate before a command fits or compares: warnings on stderr, a refusal as exit 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bowden.cli.output import console

if TYPE_CHECKING:
    from bowden.model import Mode, Model
    from bowden.recording.recording import Recording


def admit_data(model: Model, recordings: Sequence[Recording], mode: Mode) -> None:
    """Print the gate's warnings to stderr.

    Raises
    ------
    bowden.errors.BadInput
        A recording lacks what the mode needs.
    bowden.estimation.gate.finding.BadData
        A finding stops.
    """
    from bowden.estimation.fit import require_mode  # noqa: PLC0415  (keeps --help fast)
    from bowden.estimation.gate.check import admit  # noqa: PLC0415

    for one in recordings:
        require_mode(one, mode, "reading it")
    for finding in admit(model, recordings, mode):
        console().print(f"{finding.severity}: {finding.text}", soft_wrap=True)
