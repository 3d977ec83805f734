"""User-defined effects: from an installed package or from a file.

A package names them as entry points of the group ``bowden.effects``, each an `Effect`; a file
(``--effects my_effects.py``) lists them in ``EFFECTS``. Both run their author's code. What is added
is searched, simulated and reported like the catalogue's own.
"""

from __future__ import annotations

import runpy
from collections.abc import Iterable, MutableMapping
from importlib.metadata import entry_points
from pathlib import Path

from bowden.model.effects.effect import Effect
from bowden.model.errors import ModelError

GROUP = "bowden.effects"
LISTED = "EFFECTS"


def installed() -> list[Effect]:
    """Return the effects that installed packages offer.

    Raises
    ------
    ModelError
        An entry point that is no `Effect`.
    """
    found = []
    for point in entry_points(group=GROUP):
        effect = point.load()
        if not isinstance(effect, Effect):
            raise ModelError(f"{point.name}: found {effect!r}, accepted: an Effect", GROUP)
        found.append(effect)
    return found


def effects_in(path: Path) -> tuple[Effect, ...]:
    """Run a file of the user's and return the effects that it lists.

    Raises
    ------
    ModelError
        A file that cannot be read or run, or that lists no effects.
    """
    try:
        listed = runpy.run_path(str(path)).get(LISTED)
    except OSError as error:
        raise ModelError(f"found {error.strerror}, accepted: a Python file", str(path)) from error
    except (Exception, SystemExit) as error:  # the user's code may raise anything
        raise ModelError(
            f"found {type(error).__name__}: {error}, accepted: code that runs", str(path)
        ) from error
    if not isinstance(listed, (list, tuple)) or not listed:
        raise ModelError(
            f"{LISTED}: found {listed!r}, accepted: {LISTED} = (effect, ...)", str(path)
        )
    for one in listed:
        if not isinstance(one, Effect):
            raise ModelError(f"{LISTED}: found {one!r}, accepted: an Effect", str(path))
    return tuple(listed)


def add_to(catalogue: MutableMapping[str, Effect], effects: Iterable[Effect], source: str) -> None:
    """Add effects to a catalogue, none of a name that it has.

    Raises
    ------
    ModelError
        A name that is taken.
    """
    for one in effects:
        if one.name in catalogue and catalogue[one.name] != one:
            raise ModelError(
                f"found an effect called {one.name}, which is taken, accepted: another name",
                source,
            )
        catalogue[one.name] = one
