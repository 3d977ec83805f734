"""The CANopen node in a shared library, driven through cffi in virtual time.

Builds firmware/canopen with the generated table (undefined behaviour traps) into
build/native/libcanopen_test.so. The declarations come from the headers themselves.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cffi
import pytest

FIRMWARE = Path(__file__).resolve().parents[2]
BUILD = FIRMWARE.parent / "build" / "native"
SOURCES = [*sorted((FIRMWARE / "canopen").glob("*.c")), FIRMWARE / "drive" / "dictionary.c"]
HEADERS = '#include "canopen/node.h"\n#include "drive/dictionary.h"\n'
NODE_ID = 16

Frame = tuple[int, bytes]


def declarations() -> str:
    """What our own headers declare, preprocessed; the system's are left out."""
    text = subprocess.run(
        ["gcc", "-std=c11", "-E", f"-I{FIRMWARE}", "-"],
        input=HEADERS,
        capture_output=True,
        encoding="utf-8",
        check=True,
    ).stdout
    kept, ours = [], False
    for line in text.splitlines():
        marker = re.match(r'# \d+ "([^"]*)"', line)
        if marker:
            ours = marker[1].startswith(str(FIRMWARE))
        elif ours:
            kept.append(line)
    return "\n".join(kept)


@pytest.fixture(scope="session")
def library() -> tuple[cffi.FFI, Any]:
    BUILD.mkdir(parents=True, exist_ok=True)
    path = BUILD / "libcanopen_test.so"
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Werror"]
    sanitizer = ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
    command = ["gcc", "-std=c11", "-O1", "-g", "-shared", "-fPIC", *warnings, *sanitizer]
    fresh = path.with_suffix(f".{os.getpid()}")  # another worker may be loading the old one
    subprocess.run([*command, "-o", str(fresh), *map(str, SOURCES)], check=True)
    fresh.replace(path)
    ffi = cffi.FFI()
    ffi.cdef(declarations())
    return ffi, ffi.dlopen(str(path))


class Node:
    """One node on a bus of its own; frames are (COB-ID, data)."""

    def __init__(self, ffi: cffi.FFI, lib: Any, node_id: int, now_us: int) -> None:
        self.ffi, self.lib, self.id, self.now_us = ffi, lib, node_id, now_us
        self.values = ffi.new("dictionary_t *")
        self.node = ffi.new("node_t *")
        lib.node_init(self.node, lib.DICTIONARY, len(lib.DICTIONARY), self.values, node_id, now_us)
        self.count_samples = False

    def send(self, cob_id: int, data: bytes, length: int | None = None) -> None:
        frame = self.ffi.new("can_frame_t *")
        frame.cob_id, frame.length = cob_id, len(data) if length is None else length
        frame.data = data.ljust(8, b"\0")
        self.lib.node_receive(self.node, frame)

    def frames(self) -> list[Frame]:
        """Everything that waits to be sent."""
        out, frame = [], self.ffi.new("can_frame_t *")
        while self.lib.node_transmit(self.node, frame):
            out.append((int(frame.cob_id), bytes(frame.data)[: frame.length]))
        return out

    def tick(self, step_us: int = 250) -> None:
        """One control tick, as the drive does it."""
        self.now_us = (self.now_us + step_us) % 2**32
        if self.count_samples and self.lib.node_sample_due(self.node, self.now_us):
            self.values.sample_counter = (self.values.sample_counter + 1) % 2**16
            self.values.sample_counter_low = self.values.sample_counter % 256
            self.values.device_time_us = self.now_us
        self.lib.node_tick(self.node, self.now_us)

    def run(self, duration_us: int, step_us: int = 250) -> list[tuple[int, int, bytes]]:
        """Tick for a while; what was sent: (time in us since the call, COB-ID, data)."""
        out = []
        for elapsed in range(step_us, duration_us + 1, step_us):
            self.tick(step_us)
            out += [(elapsed, cob_id, data) for cob_id, data in self.frames()]
        return out

    def nmt(self, command: int, target: int | None = None) -> None:
        self.send(0, bytes([command, self.id if target is None else target]))

    def sdo(self, data: bytes, length: int | None = None) -> bytes | None:
        """Send an SDO frame; the server's answer, or None."""
        self.frames()
        self.send(0x600 + self.id, data.ljust(8, b"\0"), length)
        answers = [data for cob_id, data in self.frames() if cob_id == 0x580 + self.id]
        assert len(answers) <= 1
        return answers[0] if answers else None

    def read(self, index: int, sub: int = 0) -> bytes | int:
        """Expedited read: the value's bytes, or the abort code."""
        answer = self.sdo(bytes([0x40, *index.to_bytes(2, "little"), sub]))
        assert answer is not None
        assert answer[1:4] == bytes([*index.to_bytes(2, "little"), sub])
        if answer[0] == 0x80:
            return int.from_bytes(answer[4:], "little")
        assert answer[0] & 0xE3 == 0x43
        return answer[4 : 8 - (answer[0] >> 2 & 3)]

    def write(self, index: int, sub: int, value: bytes) -> int:
        """Expedited write: 0, or the abort code."""
        command = 0x23 | (4 - len(value)) << 2
        answer = self.sdo(bytes([command, *index.to_bytes(2, "little"), sub]) + value)
        assert answer is not None
        assert answer[1:4] == bytes([*index.to_bytes(2, "little"), sub])
        if answer[0] == 0x80:
            return int.from_bytes(answer[4:], "little")
        assert answer == bytes([0x60, *answer[1:4], 0, 0, 0, 0])
        return 0

    def write_u(self, index: int, sub: int, value: int, size: int) -> int:
        return self.write(index, sub, value.to_bytes(size, "little"))


@pytest.fixture(scope="session")
def make_node(library: tuple[cffi.FFI, Any]) -> Callable[..., Node]:
    def make(node_id: int = NODE_ID, now_us: int = 0) -> Node:
        return Node(*library, node_id, now_us)

    return make


@pytest.fixture
def node(make_node: Callable[..., Node]) -> Node:
    """A node in pre-operational whose boot-up message has been sent."""
    fresh = make_node()
    assert fresh.frames() == [(0x700 + NODE_ID, b"\0")]
    return fresh


@pytest.fixture
def operational(node: Node) -> Node:
    node.nmt(1)
    return node
