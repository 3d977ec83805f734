"""Which files come out, and their texts, formatted as the repository formats its own."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

from shared.dictionary import (
    c_laws,
    c_meanings,
    c_supervision,
    c_table,
    dbc,
    docs_page,
    eds,
    host_meanings,
    host_module,
)
from shared.dictionary.dictionary import Dictionary, expand
from shared.dictionary.lint import lint, lint_text
from shared.dictionary.schema import SchemaError, parse_file

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "shared" / "object_dictionary.yaml"


def outputs(source: Path) -> dict[Path, str]:
    """Text of every generated file by its path; `SchemaError` for a bad source."""
    return render(load(source))


def load(source: Path) -> Dictionary:
    """Read, expand and lint the source; `SchemaError` with every problem found."""
    return build(source.read_text(encoding="utf-8"), source.name)


def build(text: str, source: str) -> Dictionary:
    """Make the dictionary from the text of its file; `SchemaError` with every problem found."""
    file = parse_file(text, source)
    dictionary = expand(file)
    problems = lint_text(file) + lint(dictionary)
    if problems:
        raise SchemaError([f"{source}: {problem}" for problem in problems])
    return dictionary


def render(dictionary: Dictionary) -> dict[Path, str]:
    """Text of every generated file by its path in the repository."""
    drive = Path("firmware/drive")
    return {
        drive / "dictionary.h": _clang_format(c_table.header(dictionary)),
        drive / "dictionary.c": _clang_format(c_table.source(dictionary)),
        Path("firmware/core/laws.h"): _clang_format(c_laws.header(dictionary)),
        Path("firmware/core/laws.c"): _clang_format(c_laws.source(dictionary)),
        drive / "supervision/table.h": _clang_format(c_supervision.header(dictionary)),
        drive / "supervision/table.c": _clang_format(c_supervision.source(dictionary)),
        Path("firmware/meanings.h"): _clang_format(c_meanings.header(dictionary)),
        Path("host/src/bowden/drive/dictionary.py"): host_module.module(dictionary),
        Path("host/src/bowden/drive/meanings.py"): host_meanings.module(dictionary),
        Path("host/src/bowden/drive", eds.STRICT): eds.text(dictionary),
        Path("host/src/bowden/drive", eds.WITH_UNITS): eds.text(dictionary, eds.WITH_UNITS),
        Path("shared/generated/bowden.eds"): eds.text(dictionary),
        Path("shared/generated", eds.WITH_UNITS): eds.text(dictionary, eds.WITH_UNITS),
        Path("shared/generated/bowden.dbc"): dbc.text(dictionary),
        Path("docs/object-dictionary.md"): docs_page.text(dictionary),
    }


def _clang_format(text: str) -> str:
    """Pipe text through this environment's formatter, so that every user's agrees."""
    tool = Path(sysconfig.get_path("scripts")) / "clang-format"
    command = [str(tool), "--style=file", "--assume-filename=drive/dictionary.c"]
    return subprocess.run(
        command, input=text, capture_output=True, encoding="utf-8", check=True, cwd=ROOT
    ).stdout
