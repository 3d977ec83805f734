"""Other numbers in a checked model file, without reading the whole file anew.

A `ModelFile` and numbers by path in, the same file with these numbers out; what is not touched is
shared. `Model.with_values` asks here first, and reads the file anew only for its messages.
"""

# ruff: noqa: ANN401  (parts of a file: models, tuples of them, entries of effects)

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any

from pydantic import TypeAdapter  # its ValidationError is a ValueError
from pydantic_core import PydanticCustomError

from bowden.model.model_file import ModelFile, Part, Quantity

_STEP = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)|\[(\d+)\]")


class DoubtfulChange(Exception):  # noqa: N818  (no error: the whole file is read anew and decides)
    """A number that is impossible at its path, or a path that holds none."""


@lru_cache(maxsize=4096)
def steps_of(path: str) -> tuple[str | int, ...]:
    """Split a path such as ``rig.cable.path[0].radius_m``; into nothing if it is no path."""
    steps = tuple(name or int(index) for name, index in _STEP.findall(path))
    again = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)
    return steps if again.removeprefix(".") == path else ()


def with_numbers(document: ModelFile, values: Mapping[str, float]) -> ModelFile:
    """Return the file with other numbers, each within the limits of its key.

    Parameters
    ----------
    document : ModelFile
    values : mapping of str to float
        By path. Numbers of effects are written and not checked: `effects_in_force` does that.

    Raises
    ------
    DoubtfulChange
        A path that holds no number, a value out of its limits, or values that do not go together.
    """
    changes: dict[str | int, Any] = {}
    try:
        for path, value in values.items():
            *outer, last = steps_of(path)
            place = changes
            for step in outer:
                place = place.setdefault(step, {})
            place[last] = float(value)
        changed: ModelFile = _changed(document, changes)
    except (ValueError, PydanticCustomError, LookupError, AttributeError) as error:
        raise DoubtfulChange from error
    return changed


def _changed(part: Any, changes: dict[str | int, Any]) -> Any:
    if isinstance(part, tuple):
        items = list(part)
        for index, inner in changes.items():
            items[int(index)] = _changed(items[int(index)], inner)
        return tuple(items)
    if isinstance(part, dict):
        return {**part, **{str(key): _written(part[str(key)], new) for key, new in changes.items()}}
    if not isinstance(part, Part):
        raise DoubtfulChange
    update = {}
    for step, new in changes.items():
        name = str(step)
        old = getattr(part, name)
        if isinstance(old, Quantity):
            update[name] = _limits(type(part), name).validate_python(_quantity(old, new))
        else:
            update[name] = _changed(old, new)
    copy = part.model_copy(update=update)
    copy.fits()
    return copy


def _quantity(old: Quantity, value: Any) -> Quantity:
    if not isinstance(value, float) or math.isnan(value):
        raise DoubtfulChange
    return old.model_copy(update={"value": value})


def _written(old: Any, value: Any) -> Any:
    """Return a number of an effect as the file has it, with or without a tolerance; or a list."""
    if isinstance(old, (list, tuple)) and isinstance(value, dict):
        row = list(old)
        for index, new in value.items():
            row[int(index)] = _written(row[int(index)], new)
        return row
    if not isinstance(value, float) or isinstance(old, str):
        raise DoubtfulChange
    return {**old, "value": value} if isinstance(old, dict) else value


@lru_cache(maxsize=256)
def _limits(kind: type[Part], name: str) -> TypeAdapter[Quantity]:
    """Return what checks one number of a part: the annotation of its field."""
    field = kind.model_fields[name]
    annotated: Any = field.annotation
    for limit in field.metadata:
        annotated = Annotated[annotated, limit]
    return TypeAdapter(annotated)
