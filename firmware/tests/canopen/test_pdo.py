"""Process data: cycle, samples, SYNC, limits, and re-mapping by the procedure of CiA 301."""

from __future__ import annotations

from typing import Any

import pytest

NOT_VALID = 1 << 31


def of(sent: list[tuple[int, int, bytes]], cob_id: int) -> list[tuple[int, bytes]]:
    return [(time, data) for time, sender, data in sent if sender == cob_id]


def remap(node: Any, number: int, objects: list[int], cob_id: int) -> list[int]:
    """Map a TPDO anew; the abort codes of the five steps."""
    communication, mapping = 0x1800 + number - 1, 0x1A00 + number - 1
    steps = [node.write_u(communication, 1, NOT_VALID | cob_id, 4), node.write_u(mapping, 0, 0, 1)]
    for slot, value in enumerate(objects, 1):
        steps.append(node.write_u(mapping, slot, value, 4))
    steps.append(node.write_u(mapping, 0, len(objects), 1))
    steps.append(node.write_u(communication, 1, cob_id, 4))
    return steps


def test_nothing_is_sent_before_operational(node: Any) -> None:
    assert of(node.run(10_000), 0x190) == []


def test_defaults_one_sample_a_millisecond_in_three_frames(operational: Any) -> None:
    node = operational
    node.count_samples = True
    node.values.motor_angle_urad = -123_456
    node.values.motor_torque_unm = -2
    node.values.load_angle_urad = 2_000_000_000
    node.values.load_torque_unm = 8_388_607
    node.values.statusword = 0x1637
    sent = node.run(10_000)
    assert [t for t, _ in of(sent, 0x190)] == [250 + 1000 * i for i in range(10)]
    assert of(sent, 0x190)[3][1] == bytes.fromhex("0400 3716") + (3250).to_bytes(4, "little")
    assert of(sent, 0x290)[3] == (
        3250,
        b"\x04" + (-123_456).to_bytes(4, "little", signed=True) + b"\xfe\xff\xff",
    )
    assert of(sent, 0x390)[3] == (3250, b"\x04" + bytes.fromhex("00943577 ffff7f"))


def test_all_frames_of_a_tick_are_one_sample(operational: Any) -> None:
    operational.count_samples = True
    sent = operational.run(300_000)
    first = of(sent, 0x190)
    assert [int.from_bytes(d[:2], "little") for _, d in first] == list(range(1, 301))
    for cob_id in (0x290, 0x390):
        assert [(t, d[0]) for t, d in of(sent, cob_id)] == [(t, d[0]) for t, d in first]


def test_rate_holds_over_the_wrap_of_the_clock(make_node: Any) -> None:
    node = make_node(now_us=2**32 - 5_000)
    node.nmt(1)
    assert [t for t, _ in of(node.run(10_000), 0x190)] == [250 + 1000 * i for i in range(10)]


def test_rate_does_not_depend_on_how_coarse_the_ticks_are(operational: Any) -> None:
    assert len(of(operational.run(60_000, step_us=300), 0x190)) == 60


def test_late_ticks_do_not_cause_a_burst(operational: Any) -> None:
    operational.run(1_000)
    operational.tick(50_000)
    operational.frames()
    assert len(of(operational.run(3_000), 0x190)) == 3


def test_commands_arrive_by_rpdo(operational: Any) -> None:
    operational.send(0x210, bytes.fromhex("0f00 fe 0000f0"))
    assert operational.values.controlword == 0x0F
    assert operational.values.mode_of_operation == -2
    assert operational.values.target_torque_unm == -(1 << 20)


@pytest.mark.parametrize("command", [0x02, 0x80])
def test_commands_count_in_operational_only(operational: Any, command: int) -> None:
    operational.nmt(command)
    operational.send(0x210, bytes.fromhex("0f00 fe 010000"))
    assert operational.values.controlword == 0


def test_a_value_out_of_range_refuses_the_whole_frame(operational: Any) -> None:
    operational.send(0x210, bytes.fromhex("0f00 05 010000"))  # mode 5 does not exist
    assert operational.values.controlword == 0
    assert operational.values.target_torque_unm == 0
    sent = of(operational.run(1_000), 0x090)
    assert sent[0][1][:3] == bytes.fromhex("0082 11")
    operational.send(0x210, bytes.fromhex("0f00 ff 000000"))
    assert of(operational.run(20_000), 0x090)[0][1] == bytes(8)


def test_short_frame_is_an_error_until_a_good_one_and_a_long_one_is_fine(operational: Any) -> None:
    node = operational
    for _ in range(5):
        node.send(0x210, bytes.fromhex("0f00 fe 0000"))
    assert node.values.controlword == 0
    errors = of(node.run(50_000), 0x090)
    assert len(errors) == 1  # told once, not five times
    assert errors[0][1][:3] == bytes.fromhex("1082 11")
    assert node.read(0x1001) == b"\x11"
    node.send(0x210, bytes.fromhex("0600 ff 000000 aabb"))
    assert node.values.controlword == 6
    assert of(node.run(50_000), 0x090)[0][1] == bytes(8)
    assert node.read(0x1001) == b"\0"


def test_event_timer_and_inhibit_time(node: Any) -> None:
    assert node.write_u(0x1800, 5, 10, 2) == 0
    assert node.write_u(0x1801, 3, 25, 2) == 0x06010000  # not while the PDO exists
    assert node.write_u(0x1801, 1, 0xC000_0290, 4) == 0
    assert node.write_u(0x1801, 3, 25, 2) == 0  # 2.5 ms
    assert node.write_u(0x1801, 1, 0x4000_0290, 4) == 0
    node.nmt(1)
    sent = node.run(20_000)
    assert [t for t, _ in of(sent, 0x190)] == [250, 10_250]
    times = [t for t, _ in of(sent, 0x290)]
    assert times == [250 + 2500 * i for i in range(8)]


def test_inhibit_time_is_not_revived_by_the_wrap_of_the_clock(node: Any) -> None:
    node.write_u(0x1800, 1, NOT_VALID | 0x190, 4)
    node.write_u(0x1800, 2, 1, 1)
    node.write_u(0x1800, 3, 1000, 2)  # 100 ms
    node.write_u(0x1800, 1, 0x190, 4)
    node.nmt(1)
    node.send(0x80, b"")
    assert len(of(node.run(250), 0x190)) == 1
    for _ in range(4):
        node.tick(2**30)
    node.frames()
    node.send(0x80, b"")
    assert len(of(node.run(250), 0x190)) == 1


def test_event_timer_off_sends_once_at_the_start(node: Any) -> None:
    assert node.write_u(0x1800, 5, 0, 2) == 0
    node.nmt(1)
    assert [t for t, _ in of(node.run(20_000), 0x190)] == [250]


@pytest.mark.parametrize("every", [1, 3, 240])
def test_sync_types_send_at_every_nth_sync(node: Any, every: int) -> None:
    assert node.write_u(0x1800, 2, every, 1) == 0
    node.nmt(1)
    times = []
    for number in range(1, 2 * every + 1):
        node.send(0x80, b"" if number % 2 else bytes([number % 256]))
        times += [number] * len(of(node.run(250), 0x190))
    assert times == [every, 2 * every]


def test_synchronous_rpdo_waits_for_sync(node: Any) -> None:
    assert node.write_u(0x1400, 2, 1, 1) == 0
    node.nmt(1)
    node.send(0x210, bytes.fromhex("0600 ff 000000"))
    assert node.values.controlword == 0
    node.send(0x80, b"")
    assert node.values.controlword == 6
    node.values.controlword = 7
    node.send(0x80, b"")  # a frame counts once
    assert node.values.controlword == 7


def test_remapping_by_the_procedure(node: Any) -> None:
    assert set(remap(node, 1, [0x20030008, 0x20270020, 0x20040010], 0x190)) == {0}
    node.values.bus_voltage_mv = 24_000
    node.values.model_flags = 0x0102
    node.nmt(1)
    sent = of(node.run(250), 0x190)
    assert sent[0][1] == b"\0" + (24_000).to_bytes(4, "little") + b"\x02\x01"


def test_remapping_survives_until_communication_is_reset(node: Any) -> None:
    remap(node, 1, [0x20270020], 0x1A0)
    node.nmt(0x82)
    assert node.read(0x1800, 1) == (0x4000_0190).to_bytes(4, "little")
    assert node.read(0x1A00, 0) == b"\x03"
    node.nmt(1)
    assert len(of(node.run(250), 0x190)[0][1]) == 8


def test_disabled_and_empty_tpdos_are_not_sent(node: Any) -> None:
    assert node.write_u(0x1800, 1, NOT_VALID | 0x190, 4) == 0
    assert set(remap(node, 2, [], 0x290)) == {0}
    node.nmt(1)
    assert {cob_id for _, cob_id, _ in node.run(2_000)} == {0x390}


@pytest.mark.parametrize(
    ("value", "code"),
    [
        (0x2100_0020, 0x06040041),  # a configuration value: not mappable
        (0x6040_0010, 0x06040041),  # a command: into RPDOs only
        (0x2027_0010, 0x06040041),  # half of a value
        (0x3000_0020, 0x06020000),
        (0x2032_0920, 0x06020000),
        (0x1008_0020, 0x06040041),
    ],
)
def test_bad_mappings_are_refused(node: Any, value: int, code: int) -> None:
    node.write_u(0x1800, 1, NOT_VALID | 0x190, 4)
    node.write_u(0x1A00, 0, 0, 1)
    assert node.write_u(0x1A00, 1, value, 4) == code


def test_too_many_bits_or_slots_are_refused(node: Any) -> None:
    steps = remap(node, 1, [0x20270020, 0x20280020, 0x20030008], 0x190)
    assert steps == [0, 0, 0, 0, 0, 0x06040042, 0]
    assert node.read(0x1A00, 0) == b"\0"
    node.write_u(0x1800, 1, NOT_VALID | 0x190, 4)
    assert node.write_u(0x1A00, 0, 9, 1) == 0x06040042


def test_unset_slot_cannot_be_counted(node: Any) -> None:
    node.write_u(0x1800, 1, NOT_VALID | 0x190, 4)
    assert node.write_u(0x1A00, 0, 4, 1) == 0x06020000


def test_mapping_is_fixed_while_the_pdo_exists_or_has_entries(node: Any) -> None:
    assert node.write_u(0x1A00, 0, 0, 1) == 0x06010000
    assert node.write_u(0x1A00, 1, 0x2027_0020, 4) == 0x06010000
    node.write_u(0x1800, 1, NOT_VALID | 0x190, 4)
    assert node.write_u(0x1A00, 1, 0x2027_0020, 4) == 0x06010000


def test_parameters_are_fixed_in_operational(operational: Any) -> None:
    assert operational.write_u(0x1800, 1, NOT_VALID | 0x190, 4) == 0x08000022
    assert operational.write_u(0x1A00, 0, 0, 1) == 0x08000022
    assert operational.write_u(0x1800, 5, 5, 2) == 0x08000022


@pytest.mark.parametrize(
    "value",
    [
        0x191,  # another id while it exists
        0x2000_0190,  # 29-bit
        NOT_VALID | 0x0800,
        NOT_VALID | 0x000,
        NOT_VALID | 0x07F,
        NOT_VALID | 0x080,
        NOT_VALID | 0x580 + 16,
        NOT_VALID | 0x600 + 16,
        NOT_VALID | 0x700 + 16,
    ],
)
def test_bad_cob_ids_are_refused(node: Any, value: int) -> None:
    assert node.write_u(0x1800, 1, value, 4) == 0x06090030


@pytest.mark.parametrize("kind", [0, 241, 252, 253])
def test_unsupported_transmission_types_are_refused(node: Any, kind: int) -> None:
    assert node.write_u(0x1800, 2, kind, 1) == 0x06090030
    assert node.write_u(0x1400, 2, kind, 1) == (0x06090030 if kind else 0)
