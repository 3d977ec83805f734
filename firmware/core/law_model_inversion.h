/* law_model_inversion.h: the motor torque that makes the wanted torque arrive as the cables lie.
 *
 * While the pair slides, sliding.h gives that torque for either direction. So what remains to be
 * known is the *slip direction*: slip_direction.h.
 *
 * A set point that changes at once starts a *move* (move.h), friction and all, in the direction
 * of the error. So does an operator who turns the load around, where a cell tells what arrives. A
 * motor that is not sure to turn the friction over leaves a load at standstill alone: what it
 * brings, by its momentum or because friction is late, it could never take back. Unless the error
 * is more than it could be wrong by the change is *declined* until the load moves, and the wanted
 * torque given as it is.
 *
 * With a cell a part of its error is added at once (P1): it brings what the model gets wrong, the
 * motor's inertia and the cables' waves while they last.
 *
 * Each direction has a *shift* of the wanted torque, an integral of the load cell's error: what the
 * model's friction is wrong by that way. It stays when the direction changes, and when the cell
 * fails; of a cell that was wrong it is reset (compensation.h). The cell also says when it is
 * enough: the torque goes towards that of the direction only until what is wanted has arrived, so
 * that a wrong model does not overshoot, nor a load that the change itself moves be taken for a
 * stroke and pushed on. Without a cell only the friction that friction_observer.h is sure of is
 * compensated while the load moves: overcompensation would push. At standstill it is the friction
 * that is expected: less may not arrive at all.
 *
 * What pushes the load has to be paid for: with a cell a shift that does is taken back sooner than
 * it was learned.
 */
#ifndef BOWDEN_CORE_LAW_MODEL_INVERSION_H
#define BOWDEN_CORE_LAW_MODEL_INVERSION_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"
#include "law.h"
#include "move.h"
#include "slip_direction.h"

typedef struct {
    /* constants */
    ratio_t motor_per_load_torque; /* 1 / rho */
    ratio_t damping;               /* uN m at the motor per nm a tick */
    int32_t feedback_q16;          /* of the cell's error, 0 .. 1 */
    int32_t felt_unm[2]; /* of the friction, [without, with a cell], left to be felt while the load
                            moves */
    int32_t standstill_band_unm;
    int32_t integral_ticks; /* in which a shift takes up an error; 0: never */
    bool weak;              /* the motor may not be able to turn the friction over */
    /* state */
    slip_direction_t slip;
    int32_t last_wanted_unm;
    move_t move;
    int32_t held_unm;        /* motor torque of the last tick without inertia and damping */
    int32_t shift_q8_unm[2]; /* of the wanted torque; [negative, positive direction] */
    int32_t lag_q4_unm[2];   /* motor torque behind one and two lags */
    bool declined;           /* the set point changed to what could not be taken back */
    bool resting;
    bool held_taut;
} law_model_inversion_t;

/* As every law: law.h. `motor_inertia_gmm2` 0 is taken for 1. */
law_model_inversion_t law_model_inversion_of(const law_settings_t *settings);
law_answer_t law_model_inversion_step(law_model_inversion_t *law, const law_inputs_t *inputs);
void law_model_inversion_follow(law_model_inversion_t *law, int32_t motor_torque_unm,
                                const law_inputs_t *inputs);

#endif
