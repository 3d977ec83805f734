/* drive.h: the drive: everything between a board's sensors and its bridge, and the CANopen node.
 *
 * The board calls four functions and is called by none. In each control tick: drive_receive() for
 * every frame that has come, drive_tick() once, drive_transmit() until it returns false. All in one
 * context; the drive is not re-entrant. A tick reads the sensors, checks them, steps the CiA 402
 * state machine, asks for a torque (tunnel or target), steps the cable model with what was measured
 * and has it rendered (rendering.h), limits the command, and passes the results to the dictionary
 * and from there to the PDOs.
 *
 * No globals, no allocation: many drives can live in one process. About 30 KB each.
 */
#ifndef BOWDEN_DRIVE_DRIVE_H
#define BOWDEN_DRIVE_DRIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"
#include "../canopen/node.h"
#include "../core/transmission.h"
#include "command.h"
#include "configuration.h"
#include "corrected.h"
#include "dictionary.h"
#include "index_search.h"
#include "parameters.h"
#include "reference.h"
#include "rendering.h"
#include "saving.h"
#include "state.h"
#include "supervision/supervision.h"
#include "torque_command.h"

typedef struct {
    dictionary_t dictionary;
    node_t node;
    parameters_t parameters;
    transmission_t transmission;
    rendering_t rendering;
    drive_state_t state;
    command_t asked; /* by the host */
    torque_command_t command;
    configuration_t configuration;
    bool late;                 /* this tick: the first, a reset of communication, or it made an
                                  image to be kept */
    bool configured;           /* the model runs */
    int32_t motor_zero_counts; /* encoders where the model started */
    int32_t load_zero_counts;
    uint32_t saturations;              /* of the drive's own arithmetic since configuration */
    int32_t motor_arc_nm, load_arc_nm; /* from where the model started */
    uint8_t tension_place;             /* along the cables, that this tick publishes */
    int32_t commanded_ua;              /* in the last tick */
    int32_t current_max_ua;            /* of the board */
    supervision_t supervision;
    uint32_t second_ticks, uptime_s; /* since the start */
    saving_t saving;
    reference_t reference; /* of the angles */
    index_search_t index_search;
    tables_t tables;
    corrected_start_t corrected_start;
    corrected_t corrected; /* this tick's readings, by the tables */
} drive_t;

/* Power-on: dictionary defaults or what was saved, the node in pre-operational with its boot-up
 * message queued, the state machine at its start, the bridge off. The model starts in the first
 * tick. */
void drive_init(drive_t *drive, const board_identity_t *identity);

/* One control tick, every BOARD_CONTROL_PERIOD_US. */
void drive_tick(drive_t *drive, const board_sensors_t *sensors, board_actuators_t *actuators);

/* Takes a frame from the bus. It takes effect at once (SDO) or in the next tick. */
void drive_receive(drive_t *drive, const can_frame_t *frame);

/* Does the host's halt hold the torque at 0? */
bool drive_is_halted(const drive_t *drive);

/* The next frame for the bus, if there is one. */
bool drive_transmit(drive_t *drive, can_frame_t *frame);

#endif
