/* command.c: see command.h. */
#include "command.h"

#include "../meanings.h"

static drive_state_t after(drive_state_t state, state_command_t command) {
    return state_next(state, command, (state_events_t){0});
}

bool command_lowers(drive_state_t state, state_command_t command) {
    const drive_state_t next = after(state, command);
    return state != STATE_NOT_READY_TO_SWITCH_ON && next != state &&
           (next < state || next == STATE_QUICK_STOP_ACTIVE);
}

bool command_is_stop(drive_state_t state, uint16_t controlword) {
    const bool halts = state == STATE_OPERATION_ENABLED && (controlword & CONTROLWORD_HALT) != 0;
    return halts || command_lowers(state, state_command(controlword));
}

void command_note(command_t *command, drive_state_t state, uint16_t controlword, bool operational) {
    const state_command_t asked = state_command(controlword);
    const uint16_t rising = (uint16_t)(controlword & ~command->controlword);
    command->controlword = controlword;
    command->fault_reset = command->fault_reset || (rising & CONTROLWORD_FAULT_RESET) != 0;
    command->armed = operational && (command->armed || asked != COMMAND_ENABLE_OPERATION);
    command->left_operational = command->left_operational || !operational;
    /* of two stops the one that leads to the lower state: its torque is gone sooner */
    if (command_lowers(state, asked) &&
        (command->stop == COMMAND_NONE || after(state, asked) < after(state, command->stop))) {
        command->stop = asked;
    }
}

state_command_t command_in_force(const command_t *command, drive_state_t state, bool operational,
                                 const command_ramps_t *ramps) {
    if (state_bridge_on(state) && (command->left_operational || !operational)) {
        return COMMAND_DISABLE_VOLTAGE;
    }
    state_command_t asked = command->stop;
    if (asked == COMMAND_NONE) {
        asked = state_command(command->controlword);
    }
    if (asked == COMMAND_QUICK_STOP && !ramps->quick_stop) {
        return COMMAND_DISABLE_VOLTAGE;
    }
    const bool may_enable = state_bridge_on(state) || (operational && command->armed);
    return asked == COMMAND_ENABLE_OPERATION && !may_enable ? COMMAND_SWITCH_ON : asked;
}

state_command_t command_slow_down(command_t *command, drive_state_t state, state_command_t wanted,
                                  const command_ramps_t *ramps, bool torque_gone) {
    if (state != STATE_OPERATION_ENABLED) {
        command->slows = COMMAND_NONE;
        return wanted;
    }
    const bool ramped = (wanted == COMMAND_SHUTDOWN && ramps->shutdown) ||
                        (wanted == COMMAND_SWITCH_ON && ramps->disable_operation);
    if (ramped &&
        (command->slows == COMMAND_NONE || after(state, wanted) < after(state, command->slows))) {
        command->slows = wanted;
    }
    if (command->slows == COMMAND_NONE || (!ramped && command_lowers(state, wanted))) {
        return wanted;
    }
    return torque_gone ? command->slows : COMMAND_NONE;
}

void command_done(command_t *command) {
    command->fault_reset = false;
    command->left_operational = false;
    command->stop = COMMAND_NONE;
}
