"""Laws of the node under arbitrary use: the dictionary behaves as a checked map, noise as noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bowden.drive.dictionary import ENTRIES
from bowden.drive.meanings import BitRate
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

# A domain is taken by the drive, not by the node: firmware/tests/test_table_write.py
WRITABLE = [e for e in ENTRIES if e.access == "rw" and e.index >= 0x2000 and e.type != "domain"]
LOCKED_ROLES = {"config", "calibration"}
BLOCK_TRANSFER = range(3, 9)  # of sdo_t.transfer: not every frame is answered
VOLATILE = (0x1000, 0x2000)  # the protocol's own area changes as frames arrive


def machine(make_node: Callable[..., Any]) -> type[RuleBasedStateMachine]:
    class Dictionary(RuleBasedStateMachine):
        """Random writes and reads against a mirror in Python."""

        def __init__(self) -> None:
            super().__init__()
            self.node = make_node()
            self.mirror = {e.name: int(e.default) for e in WRITABLE}
            self.accepted = 0

        @rule(entry=st.sampled_from(WRITABLE), data=st.data(), segmented=st.booleans())
        def write(self, entry: Any, data: st.DataObject, segmented: bool) -> None:
            size = entry.bits // 8
            half = 1 << entry.bits - 1
            whole = st.integers(-half, half - 1) if entry.signed else st.integers(0, 2 * half - 1)
            inside = st.integers(entry.low, entry.high)
            edges = st.sampled_from([entry.low - 1, entry.low, entry.high, entry.high + 1])
            value = data.draw(inside | edges | whole)
            if not (-half <= value < half if entry.signed else 0 <= value < 2 * half):
                return
            expected = 0
            locked = self.node.node.od.config_locked and entry.role in LOCKED_ROLES
            if segmented and locked:  # before its value is known
                expected = 0x08000022
            elif value < entry.low:
                expected = 0x06090032
            elif value > entry.high:
                expected = 0x06090031
            elif entry.meaning is BitRate and value not in set(BitRate):  # the bus has but these
                expected = 0x06090030
            elif locked:
                expected = 0x08000022
            raw = value.to_bytes(size, "little", signed=entry.signed)
            if segmented:
                code = self.write_segments(entry, raw)
            else:
                code = self.node.write(entry.index, entry.sub, raw)
            assert code == expected
            if code == 0:
                self.mirror[entry.name] = value
                self.accepted += entry.role in LOCKED_ROLES

        def write_segments(self, entry: Any, raw: bytes) -> int:
            head = bytes([0x21, *entry.index.to_bytes(2, "little"), entry.sub])
            answer = self.node.sdo(head + len(raw).to_bytes(4, "little"))
            for i, byte in enumerate(raw):  # one byte a segment
                if answer[0] == 0x80:
                    break
                last = i == len(raw) - 1
                answer = self.node.sdo(bytes([(i % 2) << 4 | 6 << 1 | last, byte]))
            return int.from_bytes(answer[4:], "little") if answer[0] == 0x80 else 0

        @rule(locked=st.booleans())
        def lock(self, locked: bool) -> None:
            self.node.node.od.config_locked = locked

        @rule(entry=st.sampled_from(WRITABLE))
        def read(self, entry: Any) -> None:
            data = self.node.read(entry.index, entry.sub)
            assert entry.decode(data) == self.mirror[entry.name]

        @invariant()
        def counts_what_it_accepted(self) -> None:
            assert self.node.node.od.config_revision == self.accepted

    return Dictionary


def test_dictionary_is_a_checked_map(make_node: Callable[..., Any]) -> None:
    steps = settings(max_examples=60, stateful_step_count=40, deadline=None)
    run_state_machine_as_test(machine(make_node), settings=steps)


frames = st.tuples(
    st.sampled_from([0x000, 0x080, 0x090, 0x210, 0x310, 0x610, 0x710, 0x77F])
    | st.integers(0, 0x7FF),
    st.binary(max_size=8),
)


@given(st.lists(frames, max_size=60), st.integers(0, 2**32 - 1))
@settings(max_examples=300, deadline=None)
def test_noise_never_changes_what_is_not_writable_and_never_hangs_the_node(
    make_node: Callable[..., Any], noise: list[tuple[int, bytes]], start_us: int
) -> None:
    node = make_node(now_us=start_us)
    node.values.motor_angle_urad = 4711
    read_only = [e for e in ENTRIES if e.access in {"ro", "const"} and e.type != "string"]
    fixed = [e for e in read_only if not 0x1000 <= e.index < 0x1004]
    before = [node.read(e.index, e.sub) for e in fixed]
    for cob_id, data in noise:
        node.send(cob_id, data)
        node.tick()
        node.frames()
    for entry in ENTRIES:
        if entry.access == "rw" and entry.type not in ("string", "domain"):
            stored = node.lib.od_value(node.ffi.addressof(node.node.od), entry.index, entry.sub)
            value = stored - (1 << 32) if entry.signed and stored >= 1 << 31 else stored
            assert entry.low <= value <= entry.high or entry.index == 0x1003, entry.name
    if node.lib.node_reset_requested(node.node):
        return  # it was told to be silent
    node.nmt(0x80)
    assert [node.read(e.index, e.sub) for e in fixed] == before


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=40))
@settings(max_examples=300, deadline=None)
def test_every_sdo_frame_gets_at_most_one_answer_and_the_server_recovers(
    make_node: Callable[..., Any], requests: list[bytes]
) -> None:
    node = make_node()
    for request in requests:
        in_blocks = node.node.sdo.transfer in BLOCK_TRANSFER
        answer = node.sdo(request)  # asserts that there is at most one
        if not in_blocks:
            assert (answer is None) == (request[0] >> 5 == 4)
    assert node.sdo(b"\x80") is None
    assert node.read(0x1000) == bytes.fromhex("92010200")
