/* state.h: the drive's state machine of CiA 402 (IEC 61800-7-201) as a table of transitions.
 *
 * Pure: state and controlword in, state and statusword out. What a state means for the bridge is
 * state_bridge_on(); what brings the machine to Fault is supervision.h's business.
 */
#ifndef BOWDEN_DRIVE_STATE_H
#define BOWDEN_DRIVE_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"

typedef enum {
    STATE_NOT_READY_TO_SWITCH_ON,
    STATE_SWITCH_ON_DISABLED,
    STATE_READY_TO_SWITCH_ON,
    STATE_SWITCHED_ON,
    STATE_OPERATION_ENABLED,
    STATE_QUICK_STOP_ACTIVE,
    STATE_FAULT_REACTION_ACTIVE,
    STATE_FAULT,
} drive_state_t;

/* What a controlword asks for (CiA 402, table "command coding"). */
typedef enum {
    COMMAND_NONE, /* a pattern that means nothing, for example 0x8F held */
    COMMAND_SHUTDOWN,
    COMMAND_SWITCH_ON, /* also "disable operation": the same bits, 0x07 */
    COMMAND_ENABLE_OPERATION,
    COMMAND_DISABLE_VOLTAGE,
    COMMAND_QUICK_STOP,
} state_command_t;

/* Everything else that moves the machine. */
typedef struct {
    bool fault;           /* something is wrong now; wins over every command */
    bool fault_reset;     /* rising edge of bit 7 of the controlword */
    bool quick_stop_done; /* the torque has reached zero */
} state_events_t;

state_command_t state_command(uint16_t controlword);

/* One step. A fault leads to Fault reaction active from anywhere but Fault. */
drive_state_t state_next(drive_state_t state, state_command_t command, state_events_t events);

/* The bits 0 .. 3, 5, 6 of the statusword. */
uint16_t state_status_bits(drive_state_t state);

/* May current flow? Operation enabled and Quick stop active only. */
bool state_bridge_on(drive_state_t state);

#endif
