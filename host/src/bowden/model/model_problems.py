"""What is wrong with a model file, in one line a problem: path, what was found, what is accepted.

Turns pydantic's findings into lines; `description` and `model_numbers` raise them in a
`ModelError`.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from bowden.model.model_file import ModelFile


def problem_line(detail: dict[str, Any], tree: Any) -> str:
    """One line for one finding of pydantic."""
    steps = list(detail["loc"])
    # A plain number is checked as the `value` of a quantity: that step is not in the file.
    if steps and steps[-1] == "value" and not isinstance(_at(tree, steps[:-1]), dict):
        steps.pop()
    where = ""
    for step in steps:
        where += f"[{step}]" if isinstance(step, int) else f".{step}" if where else str(step)
    kind, found = detail["type"], detail["input"]
    if kind == "too_short" and found:
        return ""  # pydantic counts only the pieces that are right; those that are not say why
    if kind == "extra_forbidden":
        siblings = _accepted_keys(steps[:-1])
        return f"{where}: unknown key{nearest(str(steps[-1]), siblings)}"
    if kind == "missing":
        return f"{where}: missing"
    if kind in ("model_type", "tuple_type", "dict_type"):
        return f"{where}: found {found!r}, accepted: {'a list' if kind == 'tuple_type' else 'keys'}"
    if "ctx" in detail and "expected" in detail["ctx"]:
        return f"{where}: found {found!r}, accepted: {detail['ctx']['expected']}"
    message = str(detail["msg"])
    if message.startswith("Input should be "):
        message = f"found {found!r}, accepted: {message.removeprefix('Input should be ')}"
    elif not message.startswith("found"):
        message = f"found {found!r}; {message}"
    return f"{where or 'model'}: {message}"


def _at(tree: Any, steps: list[Any]) -> Any:
    for step in steps:
        try:
            tree = tree[step]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def _accepted_keys(steps: list[Any]) -> list[str]:
    """Keys of the schema at a place, found by walking the annotations."""
    schema: dict[str, Any] = ModelFile.model_json_schema()
    defs, here = schema["$defs"], schema
    for step in steps:
        here = here.get("items", {}) if isinstance(step, int) else here["properties"].get(step, {})
        here = next((o for o in here.get("anyOf", [here]) if o.get("type") != "null"), here)
        if "$ref" in here:
            here = defs[here["$ref"].rsplit("/", 1)[1]]
    return list(here.get("properties", {}))


def nearest(key: str, known: Mapping[str, Any] | list[str]) -> str:
    """Return the end of a line that points to the known key meant, or lists all of them."""
    close = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    if close:
        return f", did you mean {close[0]}?"
    return f", accepted: {', '.join(known)}" if known else ""
