"""SDO block transfer, byte for byte as CiA 301, 7.2.4.3.9 to 7.2.4.3.16 prints it.

The CRC is computed here by Python's own `binascii.crc_hqx`, the same polynomial from 0.
"""

from __future__ import annotations

from binascii import crc_hqx
from typing import Any

import pytest

NAME = b"bowden drive"
LIMIT = (0x2107, 0)  # motor_torque_limit, u32


def abort(code: int, address: tuple[int, int] = LIMIT) -> bytes:
    return bytes([0x80, *address[0].to_bytes(2, "little"), address[1]]) + code.to_bytes(4, "little")


def request(command: int, address: tuple[int, int] = LIMIT, value: int = 0) -> bytes:
    head = bytes([command, *address[0].to_bytes(2, "little"), address[1]])
    return head + value.to_bytes(4, "little")


def segment(number: int, data: bytes, last: bool = False) -> bytes:
    return bytes([number | last << 7]) + data.ljust(7, b"\0")


def end(unused: int, crc: int) -> bytes:
    return bytes([0xC1 | unused << 2]) + crc.to_bytes(2, "little")


def sent(node: Any, duration_us: int = 20_000) -> list[bytes]:
    """What the server sends by itself."""
    return [data for _, cob_id, data in node.run(duration_us) if cob_id == 0x590]


class TestUpload:
    def offer(self, node: Any, segments: int, command: int = 0xA4) -> bytes:
        answer = node.sdo(bytes([command, 0x08, 0x10, 0, segments, 0, 0, 0]))
        assert answer is not None
        return bytes(answer)

    def test_bytes(self, node: Any) -> None:
        assert self.offer(node, 127) == bytes.fromhex("c6 081000 0c000000")
        assert node.sdo(b"\xa3") is None
        assert sent(node) == [segment(1, NAME[:7]), segment(2, NAME[7:], last=True)]
        crc = crc_hqx(NAME, 0).to_bytes(2, "little")
        assert node.sdo(bytes([0xA2, 2, 127])) == bytes([0xC1 | 2 << 2]) + crc + bytes(5)
        assert node.sdo(b"\xa1") is None
        assert node.sdo(b"\xa1") == abort(0x05040001, (0x1008, 0))  # it is over

    def test_a_client_without_crc_gets_none(self, node: Any) -> None:
        self.offer(node, 127, command=0xA0)
        node.sdo(b"\xa3")
        sent(node)
        assert node.sdo(bytes([0xA2, 2, 127])) == bytes([0xC9]) + bytes(7)

    def test_a_small_value_is_one_segment(self, node: Any) -> None:
        answer = node.sdo(bytes.fromhex("a4 07 21 00 7f000000"))
        assert answer == bytes.fromhex("c6 072100 04000000")
        node.sdo(b"\xa3")
        assert sent(node) == [segment(1, (500_000).to_bytes(4, "little"), last=True)]

    def test_what_is_not_confirmed_is_sent_again(self, node: Any) -> None:
        self.offer(node, 127)
        node.sdo(b"\xa3")
        sent(node)
        assert node.sdo(bytes([0xA2, 1, 127])) is None  # the second was lost
        assert sent(node) == [segment(1, NAME[7:], last=True)]
        assert node.sdo(bytes([0xA2, 0, 127])) is None  # and once more
        assert sent(node) == [segment(1, NAME[7:], last=True)]
        crc = crc_hqx(NAME, 0).to_bytes(2, "little")
        assert node.sdo(bytes([0xA2, 1, 127]))[:3] == bytes([0xC9]) + crc

    def test_each_sub_block_waits_for_its_confirmation(self, node: Any) -> None:
        self.offer(node, 1)
        node.sdo(b"\xa3")
        assert sent(node) == [segment(1, NAME[:7])]
        assert node.sdo(bytes([0xA2, 1, 1])) is None
        assert sent(node) == [segment(1, NAME[7:], last=True)]

    @pytest.mark.parametrize("segments", [0, 128, 255])
    def test_impossible_block_sizes_are_refused(self, node: Any, segments: int) -> None:
        assert self.offer(node, segments) == abort(0x05040002, (0x1008, 0))
        assert self.offer(node, 1)[0] == 0xC6
        node.sdo(b"\xa3")
        sent(node)
        assert node.sdo(bytes([0xA2, 1, segments])) == abort(0x05040002, (0x1008, 0))

    def test_more_confirmed_than_sent_is_refused(self, node: Any) -> None:
        self.offer(node, 1)
        node.sdo(b"\xa3")
        sent(node)
        assert node.sdo(bytes([0xA2, 2, 1])) == abort(0x05040003, (0x1008, 0))

    @pytest.mark.parametrize("step", range(4))
    def test_a_silent_client_is_given_up_after_a_second(self, node: Any, step: int) -> None:
        self.offer(node, 127)
        for frame in (b"\xa3", bytes([0xA2, 2, 127]), b"\xa1")[:step]:
            node.sdo(frame)
            sent(node)
        expected = [abort(0x05040000, (0x1008, 0))] if step < 3 else []
        assert [data for data in sent(node, 1_100_000) if data[0] == 0x80 and data[1]] == expected

    def test_it_leaves_the_queue_to_what_is_more_urgent(self, node: Any) -> None:
        node.node.tx.count = 8
        self_sent = node.node.tx.count
        node.send(0x610, bytes([0xA4, 0x08, 0x10, 0, 127, 0, 0, 0]))
        node.send(0x610, b"\xa3".ljust(8, b"\0"))
        node.tick()
        assert node.node.tx.count == self_sent + 1  # the offer; no segment
        node.frames()
        assert len(sent(node)) == 2

    def test_an_abort_ends_it(self, node: Any) -> None:
        self.offer(node, 127)
        assert node.sdo(abort(0x08000000, (0x1008, 0))) is None
        assert node.sdo(b"\xa3") == abort(0x05040001, (0x1008, 0))

    @pytest.mark.parametrize(
        ("address", "code"), [("0011", 0x06020000), ("1810", 0x06090011), ("0310", 0x08000024)]
    )
    def test_refusals(self, node: Any, address: str, code: int) -> None:
        answer = node.sdo(bytes.fromhex(f"a4 {address} 05 7f000000"))
        assert answer is not None
        assert int.from_bytes(answer[4:], "little") == code


class TestDownload:
    def begin(self, node: Any, size: int | None = 4, command: int = 0xC4) -> None:
        given = 0 if size is None else 2
        answer = node.sdo(request(command | given, value=size or 0))
        assert answer == bytes([0xA4, 0x07, 0x21, 0, 31, 0, 0, 0])

    def test_bytes(self, node: Any) -> None:
        value = (600_000).to_bytes(4, "little")
        self.begin(node)
        assert node.sdo(segment(1, value, last=True)) == bytes([0xA2, 1, 31, 0, 0, 0, 0, 0])
        assert node.values.motor_torque_limit_unm == 500_000  # not before the CRC
        assert node.sdo(end(3, crc_hqx(value, 0))) == bytes([0xA1]) + bytes(7)
        assert node.values.motor_torque_limit_unm == 600_000
        assert node.sdo(end(3, crc_hqx(value, 0))) == abort(0x05040001)  # it is over

    def test_a_wrong_crc_changes_nothing(self, node: Any) -> None:
        value = (600_000).to_bytes(4, "little")
        self.begin(node)
        node.sdo(segment(1, value, last=True))
        assert node.sdo(end(3, crc_hqx(value, 0) ^ 0x100)) == abort(0x05040004)
        assert node.values.motor_torque_limit_unm == 500_000

    def test_a_client_without_crc_is_believed(self, node: Any) -> None:
        self.begin(node, command=0xC0)
        node.sdo(segment(1, (600_000).to_bytes(4, "little"), last=True))
        assert node.sdo(end(3, 0)) == bytes([0xA1]) + bytes(7)
        assert node.values.motor_torque_limit_unm == 600_000

    def test_segments_behind_a_lost_one_do_not_count(self, node: Any) -> None:
        self.begin(node, size=None)
        assert node.sdo(segment(1, b"first77")) is None
        assert node.sdo(segment(3, b"third77")) is None
        assert node.sdo(segment(4, b"fourth7", last=True)) == bytes([0xA2, 1, 31, 0, 0, 0, 0, 0])
        assert node.sdo(segment(1, b"second7")) is None
        assert node.sdo(segment(2, b"third77", last=True))[:2] == bytes([0xA2, 2])
        whole = b"first77second7third77"
        assert node.sdo(end(0, crc_hqx(whole, 0))) == abort(0x06070012)  # CRC right: 21 bytes for 4

    def test_a_lost_last_segment_is_asked_for(self, node: Any) -> None:
        self.begin(node, size=None)
        for number in range(1, 4):
            node.sdo(segment(number, bytes(7)))
        assert node.sdo(segment(31, bytes(7))) == bytes([0xA2, 3, 31, 0, 0, 0, 0, 0])

    def test_repeated_segments_count_once(self, node: Any) -> None:
        value = (600_000).to_bytes(4, "little")
        self.begin(node)
        assert node.sdo(segment(1, value, last=True)) is not None
        assert node.sdo(segment(1, value, last=True)) is None
        assert node.sdo(end(3, crc_hqx(value, 0))) == bytes([0xA1]) + bytes(7)
        self.begin(node, size=None)
        assert node.sdo(segment(1, b"1234567")) is None
        assert node.sdo(segment(1, b"1234567")) is None
        assert node.sdo(segment(2, b"abcdefg", last=True))[:2] == bytes([0xA2, 2])
        assert node.sdo(end(0, crc_hqx(b"1234567abcdefg", 0))) == abort(0x06070012)

    @pytest.mark.parametrize("number", [0, 32, 0x40])
    def test_impossible_numbers_end_it(self, node: Any, number: int) -> None:
        self.begin(node)
        assert node.sdo(segment(number, bytes(7))) == abort(0x05040003)
        assert node.read(*LIMIT) == (500_000).to_bytes(4, "little")

    def test_size_must_be_the_announced_one(self, node: Any) -> None:
        self.begin(node)
        node.sdo(segment(1, bytes(7), last=True))
        assert node.sdo(end(2, crc_hqx(bytes(5), 0))) == abort(0x06070010)

    @pytest.mark.parametrize(("size", "code"), [(5, 0x06070012), (3, 0x06070013)])
    def test_an_impossible_size_is_refused_before_anything_is_sent(
        self, node: Any, size: int, code: int
    ) -> None:
        assert node.sdo(request(0xC6, value=size)) == abort(code)

    def test_an_endless_one_is_ended(self, node: Any) -> None:
        self.begin(node, size=None)
        answers = []
        for index in range(1000):
            answer = node.sdo(segment(index % 31 + 1, index.to_bytes(7, "little")))
            answers += [answer] if answer else []
            if answer and answer[0] == 0x80:
                break
        assert answers[-1] == abort(0x06070012)

    def test_a_silent_client_is_given_up_after_a_second(self, node: Any) -> None:
        self.begin(node)
        assert [data for data in sent(node, 2_500_000) if data[0] == 0x80] == [abort(0x05040000)]
        assert node.read(*LIMIT) == (500_000).to_bytes(4, "little")

    def test_the_client_may_give_up_between_segments(self, node: Any) -> None:
        self.begin(node)
        assert node.sdo(abort(0x08000000)) is None
        assert node.read(*LIMIT) == (500_000).to_bytes(4, "little")

    def test_a_locked_drive_refuses_the_write(self, node: Any) -> None:
        node.node.od.config_locked = True
        assert node.sdo(request(0xC6, value=4)) == abort(0x08000022)
