"""Read and write the small YAML files beside recordings: checked against a schema, whole or not.

All that is wrong with a file is told at once, each problem with its field, what was found and what
is accepted. `session` and `column_map` define the schemas.
"""

from __future__ import annotations

import difflib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.recording.source_bytes import read_text


class FilePart(BaseModel):
    """A piece of such a file: no unknown key, never changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


_File = TypeVar("_File", bound=FilePart)


def read_yaml(path: Path, schema: type[_File], what: str) -> _File:
    """Read a file of a schema.

    Parameters
    ----------
    path : Path
    schema : type of FilePart
        What it must hold.
    what : str
        What such a file is called, for messages: ``"a session file (YAML)"``.

    Raises
    ------
    BadInput
        Not readable, not YAML (with the line), or not of the schema (all problems, with fields).
    """
    text = read_text(path, what)
    try:
        tree = YAML(typ="safe", pure=True).load(text)
    except MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise BadInput(f"{path}{line}", error.problem or "no YAML", what) from error
    except (YAMLError, ValueError, RecursionError) as error:
        raise BadInput(str(path), f"no YAML ({str(error).splitlines()[0]})", what) from error
    if not isinstance(tree, Mapping):
        raise BadInput(str(path), "no keys", f"{what} with {', '.join(schema.model_fields)}")
    try:
        return schema.model_validate(tree)
    except ValidationError as error:
        problems = "; ".join(_problem(one) for one in error.errors())
        raise BadInput(str(path), problems, what) from error


def write_yaml(path: Path, content: FilePart) -> None:
    """Write a file of a schema, whole or not at all; what is not set is left out."""
    text = io.StringIO()
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 4096  # one recording a line
    yaml.dump(content.model_dump(exclude_none=True, exclude_defaults=True, mode="json"), text)
    with replace_whole(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")


def _problem(one: ErrorDetails) -> str:
    where = ""
    for step in one["loc"]:
        where += f"[{step}]" if isinstance(step, int) else f".{step}" if where else str(step)
    match one["type"]:
        case "missing":
            return f"{where}: missing"
        case "extra_forbidden":
            return f"{where}: unknown key"
        case "value_error":
            text = one["msg"].removeprefix("Value error, ")
            return f"{where}: {text}" if where else text
    accepted = one["msg"].removeprefix("Input should be ")
    return f"{where}: {str(one['input'])[:60]!r}, accepted: {accepted}"


def nearest(found: str, known: list[str], limit: int = 12) -> str:
    """Return the known name that was probably meant, or a list of them: the end of a message."""
    close = difflib.get_close_matches(found, known, n=1, cutoff=0.6)
    if close:
        return f"{', '.join(known[:limit])}: did you mean {close[0]}?"
    return ", ".join(known[:limit]) + (", ..." if len(known) > limit else "")
