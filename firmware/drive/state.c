/* state.c: see state.h. */
#include "state.h"

state_command_t state_command(uint16_t controlword) {
    /* Bit 7 (fault reset) must be 0 for the commands that lead upwards; 0 Switch on, 1 Enable
     * voltage, 2 Quick stop (low active), 3 Enable operation. The order of the tests matters. */
    if ((controlword & 0x02u) == 0) {
        return COMMAND_DISABLE_VOLTAGE;
    }
    if ((controlword & 0x04u) == 0) {
        return COMMAND_QUICK_STOP;
    }
    switch (controlword & 0x8Fu) {
    case 0x06:
    case 0x0E:
        return COMMAND_SHUTDOWN;
    case 0x07:
        return COMMAND_SWITCH_ON;
    case 0x0F:
        return COMMAND_ENABLE_OPERATION;
    default:
        return COMMAND_NONE;
    }
}

/* Where a command leads, by state, with the numbers of CiA 402; 0: it leads nowhere. */
static const uint8_t TRANSITIONS[STATE_FAULT + 1][COMMAND_QUICK_STOP + 1] = {
    [STATE_SWITCH_ON_DISABLED] =
        {
            [COMMAND_SHUTDOWN] = STATE_READY_TO_SWITCH_ON, /* 2 */
        },
    [STATE_READY_TO_SWITCH_ON] =
        {
            [COMMAND_SWITCH_ON] = STATE_SWITCHED_ON,              /* 3 */
            [COMMAND_ENABLE_OPERATION] = STATE_SWITCHED_ON,       /* 3, then 4 */
            [COMMAND_DISABLE_VOLTAGE] = STATE_SWITCH_ON_DISABLED, /* 7 */
            [COMMAND_QUICK_STOP] = STATE_SWITCH_ON_DISABLED,      /* 7 */
        },
    [STATE_SWITCHED_ON] =
        {
            [COMMAND_ENABLE_OPERATION] = STATE_OPERATION_ENABLED, /* 4 */
            [COMMAND_SHUTDOWN] = STATE_READY_TO_SWITCH_ON,        /* 6 */
            [COMMAND_DISABLE_VOLTAGE] = STATE_SWITCH_ON_DISABLED, /* 10 */
            [COMMAND_QUICK_STOP] = STATE_SWITCH_ON_DISABLED,      /* 10 */
        },
    [STATE_OPERATION_ENABLED] =
        {
            [COMMAND_SWITCH_ON] = STATE_SWITCHED_ON,              /* 5 */
            [COMMAND_SHUTDOWN] = STATE_READY_TO_SWITCH_ON,        /* 8 */
            [COMMAND_DISABLE_VOLTAGE] = STATE_SWITCH_ON_DISABLED, /* 9 */
            [COMMAND_QUICK_STOP] = STATE_QUICK_STOP_ACTIVE,       /* 11 */
        },
    [STATE_QUICK_STOP_ACTIVE] =
        {
            [COMMAND_DISABLE_VOLTAGE] = STATE_SWITCH_ON_DISABLED, /* 12 */
        },
};

_Static_assert(STATE_NOT_READY_TO_SWITCH_ON == 0, "no command leads there");

drive_state_t state_next(drive_state_t state, state_command_t command, state_events_t events) {
    if (state == STATE_FAULT_REACTION_ACTIVE) { /* the bridge is off already: nothing left to do */
        return STATE_FAULT;                     /* 14 */
    }
    if (state == STATE_FAULT) {
        return events.fault_reset && !events.fault ? STATE_SWITCH_ON_DISABLED
                                                   : STATE_FAULT; /* 15 */
    }
    if (events.fault) {
        return STATE_FAULT_REACTION_ACTIVE; /* 13 */
    }
    if (state == STATE_NOT_READY_TO_SWITCH_ON) {
        return STATE_SWITCH_ON_DISABLED; /* 1 */
    }
    if (state == STATE_QUICK_STOP_ACTIVE && events.quick_stop_done) {
        return STATE_SWITCH_ON_DISABLED; /* 12 */
    }
    const drive_state_t next = (drive_state_t)TRANSITIONS[state][command];
    return next != STATE_NOT_READY_TO_SWITCH_ON ? next : state;
}

uint16_t state_status_bits(drive_state_t state) {
    switch (state) {
    case STATE_SWITCH_ON_DISABLED:
        return 0x40;
    case STATE_READY_TO_SWITCH_ON:
        return 0x21;
    case STATE_SWITCHED_ON:
        return 0x23;
    case STATE_OPERATION_ENABLED:
        return 0x27;
    case STATE_QUICK_STOP_ACTIVE:
        return 0x07;
    case STATE_FAULT_REACTION_ACTIVE:
        return 0x0F;
    case STATE_FAULT:
        return 0x08;
    case STATE_NOT_READY_TO_SWITCH_ON:
    default:
        return 0x00;
    }
}

bool state_bridge_on(drive_state_t state) {
    return state == STATE_OPERATION_ENABLED || state == STATE_QUICK_STOP_ACTIVE;
}
