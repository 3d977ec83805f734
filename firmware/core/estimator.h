/* estimator.h: what the drive assumes of the pair, from both encoders, the motor torque and, when
 * there is one, the load cell.
 *
 * One model step a tick, in torque-position mode: the measured motor torque and the load encoder
 * move it, so the tension profile can never drift away from the torque that the motor really gives.
 * (A position-position step, whose motor place is shifted until the torque agrees, ends at the same
 * profile; it needs a gain, and is wrong by the shift until that has settled.) The motor encoder
 * then checks the model: *innovation* is where the motor is, less where the model has it. The load
 * cell corrects the estimated load torque, slowly enough that the model's fast part stays.
 *
 * Where friction is other than the model's by a factor phi (tables.h), of the motor torque f and
 * the part g/rho that arrives, f - g/rho is what friction takes. The model is given g/rho + (f -
 * g/rho) / phi, so that its friction takes as much as the true one does, whether the cables slide
 * or turn over; its motor then stands back by the stretch of the difference.
 *
 * A reversal at the load counts when it is larger than the encoder's dither (transmission.h,
 * load_dead_band_nm) and then counts in full. Direction and speed here are for the laws: direction
 * is 0 unless the load has just gone some counts one way. A load slower than that creeps, the way
 * of its last count.
 */
#ifndef BOWDEN_CORE_ESTIMATOR_H
#define BOWDEN_CORE_ESTIMATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"
#include "fixed.h"
#include "load_tracker.h"
#include "transmission.h"

typedef struct {
    int32_t motor_arc_nm; /* radius times angle, from where the model started */
    int32_t load_arc_nm;
    int32_t motor_torque_unm; /* that pulls the cables: without what turns the motor's inertia */
    int32_t load_cell_unm;
    bool load_cell_valid;
    const uint32_t
        *friction_q14; /* [2], of the model's, by direction (tables.h); NULL: it is one */
} estimator_inputs_t;

typedef struct {
    /* constants */
    uint32_t ticks_per_s;
    int32_t load_count_nm;
    int32_t windup_nm; /* motor travel in which the friction of the pair turns over */
    /* what a disagreement takes of the confidence: half of it at `tolerance_nm`, beyond a quarter
     * of the model's stretch, and at `tolerance_unm` */
    ratio_t doubt_per_nm, doubt_per_unm;
    ratio_t motor_per_load_torque;
    ratio_t
        stretch_nm_per_unm; /* motor arc that a torque at the motor alone stretches the pair by */
    /* result */
    int32_t load_torque_unm; /* by the cables on the load */
    int32_t innovation_nm;
    slip_state_t slip;
    uint8_t confidence;      /* 0 .. 255 */
    int32_t load_direction;  /* 1, 0 or -1 */
    int32_t creep_direction; /* the same of its last count; 0 after 1/50 s without one */
    bool informed;        /* the pair has slid as a whole both ways: nothing of what the cables held
                             when the model started is left */
    load_tracker_t load;  /* which way it will go */
    int32_t gap_speed_nm; /* nm a tick by which the motor pulley outruns the load pulley */
    /* memory */
    int32_t correction_q8_unm; /* of the model by the load cell */
    int32_t doubt_q8;          /* mean disagreement, 0 .. 255 */
    int32_t mark_nm;           /* load arc from which travel counts */
    uint32_t mark_age;
    int32_t last_load_nm;
    uint32_t creep_age;
    int32_t last_gap_nm;
    int32_t gap_speed_q8_nm;
    int32_t carried_unm; /* what of the motor torque the model brings to the load, filtered */
    bool started;
    bool slid[3]; /* by slip_state_t: has been */
} estimator_t;

/* Constants and a start at standstill. `windup_nm` and the tolerances: > 0. */
estimator_t estimator_of(uint32_t ticks_per_s, int32_t load_count_nm, int32_t windup_nm,
                         int32_t tolerance_nm, int32_t tolerance_unm);

/* One tick; steps the model once. */
void estimator_step(estimator_t *estimator, transmission_t *transmission,
                    const estimator_inputs_t *inputs);

#endif
