"""The two ways in which a command can fail; `cli` turns them into exit status 2 and 3.

Imports nothing. Raised by `recording`, `drive`, `diagnosis` and `report`; caught only in `cli`.
"""

from __future__ import annotations


class BadInput(ValueError):  # noqa: N818  (reads as the sentence the user sees)
    """A file, argument or value from outside that cannot be used: exit status 2.

    Parameters
    ----------
    where : str
        The file and, where there is one, the line or field: ``"rec.csv, line 12"``.
    found : str
        What stands there.
    accepted : str
        What would have been accepted.
    """

    def __init__(self, where: str, found: str, accepted: str) -> None:
        super().__init__(f"{where}: found {found}; accepted: {accepted}")
        self.where = where
        self.found = found
        self.accepted = accepted


class DriveFailed(RuntimeError):  # noqa: N818
    """The drive or the bus did not do what it was asked: exit status 3."""
