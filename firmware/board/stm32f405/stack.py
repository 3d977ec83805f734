"""Worst-case stack of the firmware, from the compiler's call graph.

Reads the .ci files that gcc -fcallgraph-info=su writes (one a source: functions with their own
stack, calls between them). Functions without one (libgcc) are measured from the disassembly. The
sum is main() plus every interrupt handler once, each with the frame that the core pushes: all
priorities differ, so that all can nest. Recursion, calls through pointers and stack of unknown size
have no bound and are refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Final

EXCEPTION_FRAME: Final = 32 + 8  # eight words, padding to 8 and a word of slack

THREAD: Final = "reset_handler"
INTERRUPTS: Final = (
    *("systick_handler", "adc_handler", "can_rx0_handler", "exti9_5_handler"),
    "pendsv_handler",
)

NODE: Final = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
EDGE: Final = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
BYTES: Final = re.compile(r"\\n(\d+) bytes \((\w+(?:,\w+)?)\)")
FUNCTION: Final = re.compile(r"^[0-9a-f]+ <([^>]+)>:$", re.MULTILINE)
PUSH: Final = re.compile(r"\t(?:push|stmdb\tsp!,|stmdb\.w\tsp!,)\s*\{([^}]+)\}")
SUBTRACT: Final = re.compile(r"\tsubw?(?:\.w)?\tsp,\s*(?:sp,\s*)?#(\d+)")
PRE_INDEX: Final = re.compile(r"\[sp, #-(\d+)\]!")
BRANCH: Final = re.compile(r"\tbl?(?:\.w|x)?\t[0-9a-f]+ <([^>+]+)>")


class Unbounded(Exception):  # noqa: N818  (a property of the program, not of this one)
    """The stack has no bound that can be proved; says why."""


@dataclass(frozen=True)
class Function:
    """Own stack in bytes and the functions called."""

    own: int
    calls: frozenset[str]


def read_call_graph(folder: Path, linked: Set[str]) -> dict[str, Function]:
    """All functions in the .ci files under a folder, by name.

    For a 64-bit division gcc names all of libgcc's helpers that it might have called; those that
    are not among the names `linked` into the program were not.

    Raises
    ------
    Unbounded
        A function's stack depends on its arguments, or a call goes through a pointer.
    """
    own: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    helpers: set[str] = set()
    for file in sorted(folder.rglob("*.ci")):
        text = file.read_text(encoding="utf-8")
        for title, label in NODE.findall(text):
            size = BYTES.search(label)
            if size is None:  # defined elsewhere
                helpers |= {title} if "<built-in>" in label else set()
                continue
            if "dynamic" in size[2] and "bounded" not in size[2]:
                raise Unbounded(f"{title}: stack of variable size")
            own[title] = int(size[1])
            calls.setdefault(title, set())
        for source, target in EDGE.findall(text):
            if target == "__indirect_call":
                raise Unbounded(f"{source}: calls through a pointer")
            calls.setdefault(source, set()).add(target)
    absent = helpers - linked
    return {name: Function(own[name], frozenset(calls[name] - absent)) for name in own}


def read_disassembly(listing: str) -> dict[str, Function]:
    """Functions of an objdump listing: what they push and subtract, and where they branch to."""
    parts = FUNCTION.split(listing)
    found = {}
    for name, body in zip(parts[1::2], parts[2::2], strict=True):
        pushed = sum(4 * _registers(group) for group in PUSH.findall(body))
        own = pushed + sum(map(int, SUBTRACT.findall(body) + PRE_INDEX.findall(body)))
        found[name] = Function(own, frozenset(BRANCH.findall(body)) - {name})
    return found


def _registers(group: str) -> int:
    count = 0
    for item in group.split(","):
        first, _, last = item.strip().partition("-")
        count += 1 if not last else int(last[1:]) - int(first[1:]) + 1
    return count


def worst(functions: Mapping[str, Function], root: str) -> tuple[int, tuple[str, ...]]:
    """Deepest stack from a function on, in bytes, and the path that needs it."""
    done: dict[str, tuple[int, tuple[str, ...]]] = {}

    def visit(name: str, path: tuple[str, ...]) -> tuple[int, tuple[str, ...]]:
        if name in path:
            raise Unbounded(f"recursion: {' -> '.join((*path, name))}")
        if name not in done:
            if name not in functions:
                raise Unbounded(f"{name}: stack unknown")
            below = [visit(callee, (*path, name)) for callee in functions[name].calls]
            deepest = max(below, default=(0, ()))
            done[name] = (functions[name].own + deepest[0], (name, *deepest[1]))
        return done[name]

    return visit(root, ())


def worst_case(functions: Mapping[str, Function]) -> dict[str, int]:
    """Bytes that thread mode and each interrupt add, frames included."""
    table = {THREAD: worst(functions, THREAD)[0]}
    for handler in INTERRUPTS:
        table[handler] = worst(functions, handler)[0] + EXCEPTION_FRAME
    table["crash_handler"] = EXCEPTION_FRAME  # it has a stack of its own
    return table
