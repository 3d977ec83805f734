/* supervision.h: conditions that stop the drive: the checks of the table (table.h), every tick.
 *
 * A check fails when what it watches is beyond its limit for its time. It counts only in the states
 * that the table names, and in Fault, once it has failed, until it is over. What has failed since
 * the last reset of faults stays latched, also what came while in Fault; each has its EMCY. Bridge
 * and state are the business of the state machine: `present` not 0 leads to Fault.
 *
 * Inputs: the tick's measurements and the host's signs of life. Output: present, latched, refused,
 * and limits (limits.h). No I/O; supervision_tell() passes the result to the node.
 */
#ifndef BOWDEN_DRIVE_SUPERVISION_SUPERVISION_H
#define BOWDEN_DRIVE_SUPERVISION_SUPERVISION_H

#include <stdbool.h>
#include <stdint.h>

#include "../../canopen/node.h"
#include "../../core/ends.h"
#include "../dictionary.h"
#include "current_error.h"
#include "limits.h"
#include "table.h"

/* The limits in what a tick measures. */
typedef struct {
    uint32_t deadline_ticks; /* 0: none */
    int32_t bus_min_mv, bus_max_mv;
    int32_t motor_counts_a_tick, load_counts_a_tick;
    int32_t conduit_mdegc;
    int32_t angle_min_urad, angle_max_urad; /* of the load */
} supervision_settings_t;

/* What a tick brings. */
typedef struct {
    uint32_t board_faults; /* BOARD_FAULT_* bits that count */
    bool powered;          /* switched on or further, or about to be */
    bool running;          /* current may flow, or is about to */
    bool in_fault;
    bool reference_lost;        /* and a tunnel is asked for */
    bool configuration_refused; /* by the next step up */
    bool host_commanded;        /* a sign of life since the last tick */
    bool heartbeat_lost, host_restarted, namesake;
    uint8_t rpdo_late; /* number of one that is, 0: none */
    int32_t motor_counts, load_counts;
    int32_t apart_nm; /* arc of the motor pulley less that of the load pulley */
    int32_t load_angle_urad;
    int32_t motor_torque_unm;
    int32_t commanded_ua, motor_current_ua;
    int32_t bus_voltage_mv;
    int32_t conduit_mdegc;
} supervision_inputs_t;

typedef struct {
    supervision_settings_t settings;
    uint32_t present;  /* SUPERVISION_* bits */
    uint32_t latched;  /* since the last reset of faults */
    uint32_t refused;  /* present when a reset was last asked for in vain */
    uint32_t counting; /* checks that are beyond their limit, not yet for their time */
    uint16_t beyond[SUPERVISION_BITS]; /* how long, in half ticks */
    bool running;                      /* in the last tick */
    int32_t motor_counts, load_counts; /* in the last tick */
    uint32_t silent_ticks;             /* of the host */
    current_error_t current_error;
    ends_t ends;
    limits_t limits;
} supervision_t;

/* Takes the dictionary's configuration. board_ua: as in limits.h. */
void supervision_configure(supervision_t *supervision, const dictionary_t *dictionary,
                           const cable_settings_t *cable, int32_t board_ua);

/* One tick: brings `present` and the limits up to date. */
void supervision_step(supervision_t *supervision, const supervision_inputs_t *inputs);

/* Latches what has failed anew and tells the node; returns it, SUPERVISION_* bits. */
uint32_t supervision_latch(supervision_t *supervision, node_t *node,
                           const supervision_inputs_t *inputs);

/* EMCY code of the first of some checks; EMCY_NO_ERROR: there is none. */
uint16_t supervision_code(uint32_t checks);

/* A reset of faults was asked for while in Fault. `taken`: nothing is present and it is done: all
 * errors of the table are gone. */
void supervision_reset(supervision_t *supervision, node_t *node, bool taken);

/* Warns of a lesser compensation, which is no fault: the drive goes on. Detail: the causes (entry
 * compensation_fallback) in the low word, the level in the high word. No causes: it is over. */
void supervision_tell_fallback(node_t *node, uint16_t causes, uint8_t level);

#endif
