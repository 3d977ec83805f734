/* command.h: what the host's controlwords ask for, so that no stop is lost and nothing starts by
 * accident.
 *
 * A tick sees one controlword, but many frames may have come since the last one: every frame's is
 * noted here, and the strongest stop among them is carried out, whatever came after it. A stop is
 * also obeyed from an RPDO that is not taken (pdo.h). Operation enabled takes a rising edge of
 * bit 3 after NMT start: a controlword from before does not switch the bridge on.
 *
 * Between drive.c and the state machine (state.h). No dictionary, no I/O.
 */
#ifndef BOWDEN_DRIVE_COMMAND_H
#define BOWDEN_DRIVE_COMMAND_H

#include <stdbool.h>
#include <stdint.h>

#include "state.h"

typedef struct {
    uint16_t controlword;  /* noted last */
    bool armed;            /* bit 3 was clear since NMT start */
    bool fault_reset;      /* bit 7 has risen since the last tick */
    bool left_operational; /* NMT operational was left since the last tick */
    state_command_t stop;  /* the strongest since the last tick; COMMAND_NONE: there was none */
    state_command_t slows; /* is carried out once the torque is gone; COMMAND_NONE: none is */
} command_t;

/* Which stops take the torque away before they switch the bridge off; the others do so at once. */
typedef struct {
    bool quick_stop;
    bool shutdown;
    bool disable_operation;
} command_ramps_t;

/* Would this command lower the state: take torque away or lead to a state further from it? */
bool command_lowers(drive_state_t state, state_command_t command);

/* Notes the controlword as it is after a frame, or at the start of a tick. `operational`: the
 * node's NMT state then. */
void command_note(command_t *command, drive_state_t state, uint16_t controlword, bool operational);

/* Is a controlword from an RPDO that is not taken to be obeyed? True for one that lowers the state
 * or halts. */
bool command_is_stop(drive_state_t state, uint16_t controlword);

/* The command for this tick. Without NMT operational no current flows: the host that started the
 * node may not be there. */
state_command_t command_in_force(const command_t *command, drive_state_t state, bool operational,
                                 const command_ramps_t *ramps);

/* What the state machine gets of the command in force: a stop that ramps is held back until the
 * torque is gone. Nothing but a fault or a stop that leads further takes its place. */
state_command_t command_slow_down(command_t *command, drive_state_t state, state_command_t wanted,
                                  const command_ramps_t *ramps, bool torque_gone);

/* The tick is over: forgets what was noted since the last one. */
void command_done(command_t *command);

#endif
