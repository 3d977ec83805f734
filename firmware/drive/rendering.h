/* rendering.h: how the requested torque reaches the operator: the model of the cables is
 * stepped, the compensation law runs on it, and the fallback (fallback.h) decides which law that
 * is.
 *
 * What is asked for is a motor torque, the tunnel's or the host's; what is to arrive at the load is
 * that times the transmission ratio. Without compensation (entry compensation_law 0) the motor gets
 * what is asked for, to the last bit, and the model only watches.
 *
 * Tables (core/tables.h) stand between: torque that the load feels on top of the cables' is taken
 * off what the cables are to give, torque that they feel on top of the motor's off what the motor
 * is to give, and the model's friction is that of the tables.
 *
 * Between drive.c, which knows states and limits of the motor, and core/compensation.h.
 */
#ifndef BOWDEN_DRIVE_RENDERING_H
#define BOWDEN_DRIVE_RENDERING_H

#include <stdbool.h>
#include <stdint.h>

#include "../core/compensation.h"
#include "../core/tables.h"
#include "../core/transmission.h"
#include "dictionary.h"
#include "fallback.h"

typedef struct {
    compensation_t compensation;
    fallback_t fallback;
    compensation_law_t law;        /* as configured */
    bool model_runs;               /* the configuration of the cables can run */
    ratio_t load_per_motor_torque; /* rho */
    int32_t wanted_unm;            /* at the load, in the last tick */
    bool active;                   /* in the last tick */
    uint32_t saturations_seen;     /* of the model, until the last tick */
    int32_t direction;             /* of the load's last motion; 0: none yet */
    int32_t load_extra_unm;        /* what tables add to the cables' torque on the load */
} rendering_t;

/* What a tick brings. */
typedef struct {
    bool active;              /* the bridge is on and a mode asks for torque */
    bool load_cell_broken;    /* the board says so */
    bool load_cell_saturated; /* its torque is beyond what can be told */
    int32_t load_cell_counts;
    int32_t asked_unm;    /* of the motor */
    int32_t motor_arc_nm; /* from where the model started */
    int32_t load_arc_nm;
    int32_t motor_torque_unm; /* measured */
    int32_t load_cell_unm;
    const tables_t *tables; /* NULL: none */
} rendering_inputs_t;

/* Takes the dictionary's configuration, in two parts that each fit into a tick; nothing is
 * compensated before the second. `model_configured`: `transmission` could be configured from it;
 * where it could not, only COMPENSATION_LEVEL_NONE is left. */
void rendering_configure(rendering_t *rendering, const dictionary_t *dictionary,
                         const transmission_t *transmission, bool model_configured);
void rendering_start(rendering_t *rendering, const dictionary_t *dictionary,
                     const transmission_t *transmission, bool model_configured);

/* One tick: steps the model once; the motor torque to give, before the drive limits it. */
int32_t rendering_step(rendering_t *rendering, transmission_t *transmission,
                       const rendering_inputs_t *inputs);

/* Writes the running law and the assumptions into the dictionary. True when the entry
 * compensation_fallback has changed. */
bool rendering_publish(const rendering_t *rendering, dictionary_t *dictionary);

#endif
