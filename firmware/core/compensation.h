/* compensation.h: the motor torque that makes a wanted torque arrive at the load.
 *
 * One call a tick: compensation_step() takes what the drive has measured, steps the model of the
 * pair (estimator.h), and answers with the motor torque of the selected law. "Wanted" is the torque
 * of the cables ON the load, in the signs of transmission.h; the tunnel's is restoring. Without a
 * law the motor torque is wanted / rho, rho = r_load / r_motor: as if the cables had no friction.
 * The laws add to it what friction takes: law.h says what a law is, laws.h (generated) has them
 * all.
 *
 * The caller limits slew and falls back; the answer is within the motor's limit. Pure functions
 * over structs: no I/O, no globals. Exchanging the cables mirrors everything to the last bit.
 */
#ifndef BOWDEN_CORE_COMPENSATION_H
#define BOWDEN_CORE_COMPENSATION_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"
#include "adaptation.h"
#include "estimator.h"
#include "fixed.h"
#include "friction_observer.h"
#include "laws.h"
#include "load_motion.h"
#include "passivity.h"
#include "sliding.h"
#include "transmission.h"

typedef struct {
    uint32_t ticks_per_s;        /* 1000 .. 20000 */
    int32_t torque_limit_unm;    /* of the motor; >= 0 */
    uint32_t motor_inertia_gmm2; /* with its pulley: for the damping of its moves */
    int32_t motor_count_nm;      /* arc of one count of each encoder; > 0 */
    int32_t load_count_nm;
    uint32_t friction_share_ppm; /* without a load cell: part of what friction_observer.h is sure
                                    of that is compensated */
    uint32_t friction_deviation_ppm; /* of the configured friction, relative; at most 500000 */
    int32_t standstill_band_unm;     /* an error of the load torque below this is left alone */
    uint32_t integral_gain_mhz;      /* of force control, 1/(1000 s) */
    int32_t slack_floor_un; /* no cable is brought below this tension on purpose; 0: a cable
                               may go slack where the wanted torque takes it */
    bool adapt;             /* friction and pretension follow what the drive observes */
} compensation_settings_t;

/* What the drive measured, and what it wants, in one tick. */
typedef struct {
    compensation_law_t
        law;     /* the law that runs: the fallback level may be below the one configured */
    bool active; /* the bridge is on and a torque is wanted; else the laws rest */
    bool load_cell_valid; /* may be used: configured, alive, plausible */
    int32_t wanted_unm;   /* torque by the cables on the load */
    int32_t motor_arc_nm; /* radius times angle, from where the model started */
    int32_t load_arc_nm;
    int32_t motor_torque_unm; /* measured */
    int32_t load_cell_unm;    /* by the cables on the load; any value while not valid */
    const uint32_t
        *friction_q14; /* [2], of the model's, by direction (tables.h); NULL: it is one */
} compensation_inputs_t;

typedef struct {
    int32_t motor_torque_unm;
    int32_t load_torque_unm; /* estimate: model, corrected by the load cell when valid */
    int32_t innovation_nm;   /* arc of the motor, encoder minus model */
    slip_state_t slip;
    uint8_t confidence;   /* in the estimate, 0 .. 255 */
    uint8_t flags;        /* COMPENSATION_FLAGS_* */
    bool informed;        /* estimator.h */
    int32_t energy_uj;    /* what the rendering error has given the load beyond the wanted */
    int32_t friction_unm; /* friction of the sliding pair at the load, by the observer */
    uint32_t friction_factor_ppm; /* adaptation: friction and pretension against the configured,
                                     one is 1000000 */
    uint32_t pretension_factor_ppm;
} compensation_outputs_t;

typedef struct {
    compensation_settings_t settings;
    compensation_outputs_t outputs;
    ratio_t motor_per_load_torque; /* 1 / rho */
    int32_t friction_unm;          /* of the model's sliding pair, at the load */
    uint32_t share_q16;            /* settings.friction_share_ppm */
    sliding_t configured;          /* the pair as it is configured */
    sliding_t sliding;             /* with the pretension as adapted */
    estimator_t estimator;
    adaptation_t adaptation;
    friction_observer_t observer;
    passivity_t passivity;
    load_motion_t load_motion;
    laws_t laws;
    law_answer_t answer;      /* of the last tick */
    int32_t next_sign;        /* direction whose factor on the friction is next */
    uint32_t restored_ppm[2]; /* factors on friction and pretension that adaptation began with */
} compensation_t;

/* Computes the constants from a configured transmission, and starts at standstill; the laws' follow
 * apart, so that each fits into a control tick of its own. */
void compensation_configure(compensation_t *compensation, const transmission_t *transmission,
                            const compensation_settings_t *settings);
void compensation_configure_laws(compensation_t *compensation, const transmission_t *transmission);

/* One tick. Steps the model exactly once; with COMPENSATION_LAW_NONE by measured motor torque and
 * load arc alone. The result stays in compensation->outputs. */
void compensation_step(compensation_t *compensation, transmission_t *transmission,
                       const compensation_inputs_t *inputs);

/* Adaptation: continues from levels that were saved; outside the bounds they are limited. */
void compensation_restore(compensation_t *compensation, uint32_t friction_factor_ppm,
                          uint32_t pretension_factor_ppm);

/* For a load cell that was wrong while it was in use: resets what laws, estimator and adaptation
 * have learned from it since compensation_restore(). It would act on without the cell. */
void compensation_reset_learned(compensation_t *compensation);

#endif
