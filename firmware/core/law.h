/* law.h: what a compensation law is: its set-up, its inputs in a tick, its answer.
 *
 * A law NAME is the two files law_NAME.[ch] with
 *   law_NAME_t                                     its constants and state
 *   law_NAME_t law_NAME_of(settings)               constants, and a start at standstill
 *   law_answer_t law_NAME_step(law, inputs)        a tick in which it runs
 *   void law_NAME_follow(law, torque, inputs)      a tick in which another runs, or none: the motor
 *                                                  gives that torque, and the law goes on from
 * there and a value of the entry compensation_law in shared/object_dictionary.yaml, from which
 * laws.[ch] are generated. Torques are at the load and by the cables on it, unless motor_ is said.
 * A law need not limit its answer. Exchanging the cables must mirror the answer to the last bit.
 */
#ifndef BOWDEN_CORE_LAW_H
#define BOWDEN_CORE_LAW_H

#include <stdbool.h>
#include <stdint.h>

#include "estimator.h"
#include "load_motion.h"
#include "sliding.h"
#include "transmission.h"

#define LAW_SHARE_ONE 65536

typedef struct {
    const transmission_t *transmission;
    const sliding_t *sliding;    /* the pair as it is configured */
    int32_t friction_unm;        /* of the sliding pair; >= 0 */
    int32_t torque_limit_unm;    /* of the motor; >= 0 */
    int32_t standstill_band_unm; /* an error below this is left alone; >= 0 */
    uint32_t motor_inertia_gmm2; /* with its pulley */
    uint32_t integral_gain_mhz;  /* of force control; 0: no integral */
    uint32_t ticks_per_s;        /* 1000 .. 20000 */
} law_settings_t;

typedef struct {
    int32_t wanted_unm;
    int32_t naive_unm;            /* motor torque that brings it through cables without friction */
    int32_t load_torque_unm;      /* the load cell's, or the estimate */
    int32_t error_unm;            /* wanted minus load torque */
    bool cell;                    /* the load torque is the cell's */
    bool limited;                 /* the motor's limit cut the last answer */
    bool owes;                    /* the drive has given the load energy: passivity.h */
    uint64_t given_pj;            /* that energy since the start; wraps: differences tell */
    uint32_t share_q16;           /* of the friction to compensate, LAW_SHARE_ONE for all */
    const sliding_t *sliding;     /* the pair that the law is to assume */
    const estimator_t *estimator; /* after this tick's step */
    const load_motion_t *load_motion; /* held while the model inversion runs */
} law_inputs_t;

typedef struct {
    int32_t motor_torque_unm;
    int32_t inertia_unm; /* part of it that turns the motor's inertia and pulls no cable */
    uint8_t flags;       /* COMPENSATION_FLAGS_RESTING, _HELD_TAUT */
} law_answer_t;

#endif
