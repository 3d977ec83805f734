"""List the numeric constants that decide a diagnosis, and change one for a while.

They are found in the source of `bowden.diagnosis`: every module that `search` and `verdict` import,
but for those of `OUTSIDE`, is in the decision path, and so is each number at its module level.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final

import bowden.diagnosis
import numpy as np
from numpy.typing import NDArray

PACKAGE: Final = "bowden.diagnosis"
FOLDER: Final = Path(bowden.diagnosis.__file__).parent
OUTSIDE: Final = {
    "result": "holds what is found",
    "material": "steps and meshes, whose error each fit is corrected for; an encoder's half count",
    "law_candidates": "knots and places of learned laws",
}
ODDS: Final = ("SURE",)  # shares whose double would be no share

Numbers = int | float | tuple[float, ...] | NDArray[np.float64]


@dataclass(frozen=True)
class Constant:
    """A number, or several, at the level of a module.

    Parameters
    ----------
    module : str
        ``odds``; in `bowden.diagnosis`.
    name : str
    bounds : str
        The comment beside it.
    """

    module: str
    name: str
    bounds: str

    @property
    def value(self) -> Numbers:
        """What it is."""
        found: Numbers = getattr(_loaded(self.module), self.name)
        return found

    def scaled(self, factor: float) -> Numbers:
        """Return it times a factor: a whole number rounds half up; some shares by their odds."""
        value = self.value
        if isinstance(value, np.ndarray):
            return value * factor
        if isinstance(value, tuple):
            return tuple(_scaled(self.name, one, factor) for one in value)
        return _scaled(self.name, value, factor)

    @contextmanager
    def set_to(self, value: Numbers) -> Iterator[None]:
        """Set it, also in the modules that have imported its name."""
        places = [self.module, *(m for m in modules() if self.name in _imported(m)[self.module])]
        before = self.value
        try:
            for module in places:
                setattr(_loaded(module), self.name, value)
            yield
        finally:
            for module in places:
                setattr(_loaded(module), self.name, before)


def constants() -> list[Constant]:
    """Return every constant of the decision path, by module in the order of its lines."""
    found = []
    for module in sorted(modules() - set(OUTSIDE)):
        source = _source(module)
        for line, name in _assigned(ast.parse(source)):
            one = Constant(module, name, source.splitlines()[line - 1].partition("  # ")[2])
            if _is_number(one.value):
                found.append(one)
    return found


def modules() -> set[str]:
    """Return the modules of `bowden.diagnosis` that `search` and `verdict` reach by imports."""
    return reached_from("search") | reached_from("verdict")


def reached_from(module: str) -> set[str]:
    """Return a module of `bowden.diagnosis` and those that it reaches, not through `OUTSIDE`."""
    found: set[str] = set()
    reached = [module]
    while reached:
        one = reached.pop()
        if one not in found:
            found.add(one)
            reached += [] if one in OUTSIDE else _imported(one)
    return found


class _Names(dict[str, set[str]]):
    """Names that a module imports, by the module of `bowden.diagnosis` that has them."""

    def __missing__(self, module: str) -> set[str]:
        return set()


def _imported(module: str) -> _Names:
    found = _Names()
    for node in ast.walk(ast.parse(_source(module))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{PACKAGE}."):
            names = {alias.name for alias in node.names if alias.asname is None}
            found[str(node.module).removeprefix(f"{PACKAGE}.")] = names
    return found


def _assigned(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and name of what is assigned at the module's level and named as a constant."""
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
        for name in (one for target in targets for one in ast.walk(target)):
            if isinstance(name, ast.Name) and name.id.isupper():
                yield node.lineno, name.id


def _is_number(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_number, value))
    return isinstance(value, int | float | np.ndarray) and not isinstance(value, bool)


def _scaled(name: str, value: float, factor: float) -> float:
    if isinstance(value, int):
        return math.floor(value * factor + 0.5)
    if name in ODDS:
        odds = factor * value / (1.0 - value)
        return odds / (1.0 + odds)
    return value * factor


def _source(module: str) -> str:
    return (FOLDER / f"{module}.py").read_text(encoding="utf-8")


def _loaded(module: str) -> object:
    return import_module(f"{PACKAGE}.{module}")
