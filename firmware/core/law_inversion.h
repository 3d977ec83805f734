/* law_inversion.h: our law: the motor torque that makes the wanted torque arrive as the cables lie.
 *
 * While the pair slides, sliding.h gives that torque for either direction. So what remains to be
 * known is the direction in which it slides, or has to: the *side*. A load that moves says it
 * itself. A load at rest holds whatever torque is there, within the friction; then the side is the
 * one towards which the load torque has to change, and where the error is small nothing is done:
 * friction holds it, so there is no limit cycle. A reversal of the side turns the whole tension
 * profile over; the motor travels by the backlash for it, on a spring, so the torque goes over
 * along two lags of the pair's own resonance and the motor's overshoot is damped.
 *
 * Each side has a *shift* of the wanted torque, an integral of the load cell's error: what the
 * model's friction is wrong by that way. It stays when the side changes, and when the cell dies.
 * It also says when it is enough: the torque goes towards that of the side only until what is
 * wanted has arrived, so that a wrong model does not overshoot, nor a load that the change itself
 * moves be taken for a stroke and pushed on. Without a cell only the friction that
 * friction_observer.h is sure of is compensated while the load moves: overcompensation would push.
 * At rest it is the friction that is expected: less may not arrive at all.
 *
 * When something else is wanted at once, more than the rest band within a tick, the motor goes
 * there by move.h, friction and all; the side is that of the error.
 *
 * A motor that is not sure to turn the friction over at all leaves a load at rest alone when
 * something else is wanted at once: what it brings, by its momentum or because friction is late, it
 * could never take back. Unless the error is more than it could be wrong by the change is declined,
 * until the load moves, and the wanted torque given as it is.
 *
 * A change of side that neither a stroke of the load nor a new wish has called for costs patience:
 * the next one needs twice the error, and at least twice what this one left at rest, and twice as
 * much is left alone; until the hand makes a stroke, moves the load back, however slowly, or
 * something else is wanted. A stroke while the passivity observer is owed energy is the drive's own
 * and counts for nothing. So however wrong the model is, the law comes to rest.
 *
 * Friction that builds up late does not hold the motor while the side changes: it outruns the model
 * and the load is pulled along. Twice such a change makes all later ones slower.
 */
#ifndef BOWDEN_CORE_LAW_INVERSION_H
#define BOWDEN_CORE_LAW_INVERSION_H

#include <stdbool.h>
#include <stdint.h>

#include "estimator.h"
#include "fixed.h"
#include "move.h"
#include "sliding.h"

#define INVERSION_SHARE_ONE 65536

/* What the law is told in a tick; torques by the cables on the load unless motor_ is said. */
typedef struct {
    int32_t wanted_unm;      /* with what is left of the friction on purpose */
    int32_t asked_unm;       /* without */
    int32_t load_torque_unm; /* the cell's, or the estimate */
    bool cell;               /* it is the cell's */
    bool limited;            /* the motor's limit cut the last answer */
    bool owes;               /* energy that the drive has given the load, passivity.h */
    uint32_t share_q16;      /* of the friction to compensate */
} inversion_inputs_t;

typedef struct {
    /* constants */
    ratio_t motor_per_load_torque; /* 1 / rho */
    ratio_t damping;               /* uN m at the motor per nm a tick */
    int32_t lag_ticks;             /* of one radian of the pair's resonance; >= 1 */
    int32_t friction_unm;          /* at the load, of the sliding pair */
    int32_t rest_band_unm;
    int32_t integral_ticks; /* in which a shift takes up an error; 0: never */
    bool weak;              /* the motor may not be able to turn the friction over */
    /* state */
    int32_t side;               /* 1 or -1; 0: not yet */
    uint32_t side_ticks;        /* since it changed */
    uint32_t patience;          /* lost: changes of side without a stroke of the load; 0 .. 3 */
    int32_t left_unm;           /* error that the last such change left at rest */
    int32_t side_arc_nm;        /* where the load was then */
    int32_t side_far_nm;        /* and how far towards the side it has got */
    int32_t side_innovation_nm; /* and by how much the motor was ahead of the model */
    bool outran;                /* it has got further ahead than cables with friction let it */
    int32_t late;               /* changes of side in which it did: 0 .. 2 */
    int32_t settled_unm;        /* the wanted torque that the patience is for */
    bool called_for;            /* something else is wanted: the next change of side is free */
    int32_t last_asked_unm;
    move_t move;
    int32_t held_unm;        /* motor torque of the last tick without inertia and damping */
    int32_t shift_q8_unm[2]; /* of the wanted torque; [negative, positive side] */
    int32_t lag_q4_unm[2];   /* motor torque behind one and two lags */
    bool declined;           /* something else is wanted that could not be taken back */
    bool resting;
    bool held_taut;
} inversion_t;

/* Constants and a start with nothing learned. `motor_inertia_gmm2`: 0 is taken for 1. */
inversion_t inversion_of(const transmission_t *transmission, const sliding_t *sliding,
                         uint32_t ticks_per_s, uint32_t motor_inertia_gmm2,
                         int32_t torque_limit_unm, int32_t rest_band_unm,
                         uint32_t integral_gain_mhz);

/* The law rests and another gives this motor torque for this wanted one: it will go on from there.
 */
void inversion_follow(inversion_t *inversion, int32_t motor_torque_unm, int32_t wanted_unm);

/* Motor torque of the tick. */
int32_t inversion_step(inversion_t *inversion, const sliding_t *sliding,
                       const estimator_t *estimator, const inversion_inputs_t *inputs);

#endif
