"""The one error of the offline model; imports nothing of this package.

`cli` and `diagnosis` turn it into the line that the user reads.
"""

from __future__ import annotations

from collections.abc import Sequence


class ModelError(ValueError):
    """A model file, a parameter or an input that describes no possible rig.

    Parameters
    ----------
    problems : str or sequence of str
        Each one line that names the place, what was found and what is accepted.
    source : str
        The file or argument they were found in; empty where the lines say it themselves.
    """

    def __init__(self, problems: str | Sequence[str], source: str = "") -> None:
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        self.source = source
        prefix = f"{source}: " if source else ""
        super().__init__(prefix + "; ".join(self.problems))
