"""Rows that break a ceiling, each with its reason: exceptions.yaml, and whether it is up to date.

A row that breaks a ceiling must be listed; a listed row that holds must be taken out.
"""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase
from io import StringIO
from pathlib import Path
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field
from ruamel.yaml import YAML

from hil_tests.fault_campaign.outcome import Outcome

FILE: Final = Path(__file__).with_name("exceptions.yaml")


class Reason(BaseModel):
    """Why rows break a ceiling.

    Attributes
    ----------
    reason, remedy : str
        Why the firmware does not see to it, and what has to be done, hardware included.
    covers : list of str
        Patterns (`fnmatch`) of the rows that may have this reason.
    rows : list of str
        Names of the rows that have it, `Outcome.name`, each one alone.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    reason: Annotated[str, Field(min_length=20)]
    remedy: Annotated[str, Field(min_length=20)]
    covers: Annotated[list[str], Field(min_length=1)]
    rows: list[str]


def load(file: Path = FILE) -> list[Reason]:
    """Read the reasons; pydantic's ValidationError where the file is not as described."""
    raw = YAML(typ="safe", pure=True).load(file.read_text(encoding="utf-8"))
    return [Reason.model_validate(item) for item in raw]


def disagreements(outcomes: Iterable[Outcome], reasons: Iterable[Reason]) -> list[str]:
    """List rows that break a ceiling without a reason, and reasons whose row holds."""
    listed = [row for reason in reasons for row in reason.rows]
    found = [f"{row}: listed twice" for row in sorted(set(listed)) if listed.count(row) > 1]
    for outcome in outcomes:
        if outcome.holds and outcome.name in listed:
            found.append(f"{outcome.name}: holds; take it out of {FILE.name}")
        elif not outcome.holds and outcome.name not in listed:
            found.append(
                f"{outcome.name}: {1e3 * outcome.impulse_nms:.0f} mN m s, "
                f"{1e3 * outcome.energy_j:.0f} mJ, and no reason in {FILE.name}"
            )
    return found


def updated(outcomes: Iterable[Outcome], reasons: Iterable[Reason]) -> list[Reason]:
    """Return the reasons with the rows that were run and break a ceiling, without those that hold.

    A row goes to the first reason that covers it; rows that were not run stay where they are. A row
    that no reason covers stays unlisted: `disagreements` tells it.
    """
    broken = {outcome.name: outcome.holds for outcome in outcomes}
    left = {row for row, holds in broken.items() if not holds}
    found = []
    for reason in reasons:
        mine = {r for r in left if any(fnmatchcase(r, pattern) for pattern in reason.covers)}
        left -= mine
        kept = {row for row in reason.rows if row not in broken}
        found.append(reason.model_copy(update={"rows": sorted(mine | kept)}))
    return found


def save(reasons: Iterable[Reason], file: Path = FILE) -> None:
    """Write the reasons back, under the same comment."""
    text = file.read_text(encoding="utf-8")
    comment = "".join(f"{line}\n" for line in text.splitlines() if line.startswith("#"))
    stream = StringIO()
    yaml = YAML()
    yaml.width = 110
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.dump([reason.model_dump() for reason in reasons], stream)
    file.write_text(comment + stream.getvalue(), encoding="utf-8")
