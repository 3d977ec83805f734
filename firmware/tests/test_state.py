"""The CiA 402 state machine: every state with every controlword and every event.

The reference is the transition list of IEC 61800-7-201 written down once more here, by the bits of
the controlword, in another form than the firmware's table.
"""

from __future__ import annotations

import itertools

import pytest

from firmware.tests.native import ffi, lib

(
    NOT_READY,
    SWITCH_ON_DISABLED,
    READY_TO_SWITCH_ON,
    SWITCHED_ON,
    OPERATION_ENABLED,
    QUICK_STOP_ACTIVE,
    FAULT_REACTION_ACTIVE,
    FAULT,
) = STATES = range(8)

STATUS = {  # CiA 402, statusword bits 0..3, 5, 6 under the mask 0x6F, or 0x4F where bit 5 is free
    NOT_READY: (0x4F, 0x00),
    SWITCH_ON_DISABLED: (0x4F, 0x40),
    READY_TO_SWITCH_ON: (0x6F, 0x21),
    SWITCHED_ON: (0x6F, 0x23),
    OPERATION_ENABLED: (0x6F, 0x27),
    QUICK_STOP_ACTIVE: (0x6F, 0x07),
    FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    FAULT: (0x4F, 0x08),
}


def expected(state: int, word: int, fault: bool, reset: bool, stopped: bool) -> int:
    """Where the standard leads."""
    if state == FAULT_REACTION_ACTIVE:
        return FAULT
    if state == FAULT:
        return SWITCH_ON_DISABLED if reset and not fault else FAULT
    if fault:
        return FAULT_REACTION_ACTIVE
    if state == NOT_READY:
        return SWITCH_ON_DISABLED
    if state == QUICK_STOP_ACTIVE and stopped:
        return SWITCH_ON_DISABLED
    switch_on, voltage, no_quick_stop, enable = (bool(word & 1 << bit) for bit in range(4))
    if not voltage:
        return SWITCH_ON_DISABLED
    if not no_quick_stop:
        return {OPERATION_ENABLED: QUICK_STOP_ACTIVE, QUICK_STOP_ACTIVE: QUICK_STOP_ACTIVE}.get(
            state, SWITCH_ON_DISABLED
        )
    if word & 0x80 or state == QUICK_STOP_ACTIVE:
        return state  # the fault-reset bit takes the meaning from the others
    if not switch_on:
        return READY_TO_SWITCH_ON
    if state == SWITCH_ON_DISABLED:
        return state
    if state == READY_TO_SWITCH_ON or not enable:
        return SWITCHED_ON
    return OPERATION_ENABLED


@pytest.mark.parametrize("state", STATES)
def test_every_transition(state: int) -> None:
    for word, fault, reset, stopped in itertools.product(
        range(256), (False, True), (False, True), (False, True)
    ):
        events = ffi.new("state_events_t *", (fault, reset, stopped))
        found = lib.state_next(state, lib.state_command(word), events[0])
        assert found == expected(state, word, fault, reset, stopped), (hex(word), fault, reset)


def test_the_high_byte_of_the_controlword_commands_nothing() -> None:
    for word in range(256):
        assert lib.state_command(word | 0xFF00) == lib.state_command(word)


@pytest.mark.parametrize("state", STATES)
def test_the_statusword_tells_the_state(state: int) -> None:
    mask, bits = STATUS[state]
    assert lib.state_status_bits(state) & mask == bits
    others = [s for s in STATES if s != state]
    assert all(lib.state_status_bits(s) & STATUS[state][0] != bits for s in others)


def test_current_may_flow_in_two_states_only() -> None:
    allowed = [state for state in STATES if lib.state_bridge_on(state)]
    assert allowed == [OPERATION_ENABLED, QUICK_STOP_ACTIVE]
