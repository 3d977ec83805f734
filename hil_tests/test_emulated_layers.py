"""The emulator's C files are in layers: each includes its own layer's header and those below only.

The compiler refuses a call of a function that no header declared, so what holds for the includes
holds for the calls; `ports.h` lists the calls that go up.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil_tests.emulated.build import FLAGS, SOURCES

#: From the lowest to the highest; a file belongs to the folder that it is in.
LAYERS = ("", "services", "core", "chip", "board", "system")
FILES = sorted(path.relative_to(SOURCES) for path in SOURCES.rglob("*.[ch]"))
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
DECLARED = re.compile(r"^[\w ]+[ *]+(\w+)\([^;{]*\);", re.MULTILINE)


def layer(path: Path) -> int:
    return LAYERS.index(path.parent.name)


def included(path: Path) -> Iterator[Path]:
    """What a file includes of ours, as `-I` and its own folder find it."""
    for name in INCLUDE.findall((SOURCES / path).read_text(encoding="utf-8")):
        here = path.parent / name
        yield here if (SOURCES / here).exists() else Path(name)


def test_every_layer_has_files() -> None:
    assert {path.parent.name for path in FILES if path.suffix == ".h"} == set(LAYERS)
    assert not [path for path in FILES if path.suffix == ".c" and not path.parent.name]


@pytest.mark.parametrize("path", FILES, ids=str)
def test_a_file_includes_no_higher_layer(path: Path) -> None:
    for other in included(path):
        assert (SOURCES / other).exists(), other
        assert layer(other) <= layer(path), f"{path} includes {other}"


def test_what_goes_up_is_defined_above() -> None:
    ports = DECLARED.findall((SOURCES / "ports.h").read_text(encoding="utf-8"))
    assert len(ports) == 12  # one more is a decision, not an accident
    for name in ports:
        defined = re.compile(rf"^[\w ]+[ *]+{name}\([^;]*?\) {{", re.MULTILINE)
        [path] = [p for p in FILES if defined.search((SOURCES / p).read_text(encoding="utf-8"))]
        assert path.parent.name in ("board", "system")


def test_the_compiler_refuses_undeclared_functions() -> None:
    assert {"-Wall", "-Werror"} <= set(FLAGS)
