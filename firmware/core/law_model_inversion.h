/* law_model_inversion.h: the motor torque that makes the wanted torque arrive as the cables lie.
 *
 * While the pair slides, sliding.h gives that torque for either direction. So what remains to be
 * known is the *slip direction*: the one in which the pair slides, or has to. A load that moves
 * says it itself. A load at standstill holds whatever torque is there, within the friction; then
 * the direction is the one towards which the load torque has to change, and where the error is
 * small nothing is done: friction holds it, so there is no limit cycle.
 *
 * Phases of the slip direction, and what leads from one to the next:
 *
 *   UNKNOWN   another law gave the torque; it is held until it is wrong or the load moves
 *   TURNING   the direction is new: the tension profile turns over, the motor travels the backlash
 *   TURNED    8 lags of the pair's resonance later: a load in motion has followed
 *   SETTLED   16 lags later: a load at standstill has, too
 *
 *   from               event                                                            to
 *   UNKNOWN            the load moves, or the error leaves its dead band                TURNING
 *   TURNING            8 lags have passed                                               TURNED
 *   TURNED             16 lags have passed                                              SETTLED
 *   TURNING, TURNED    the load moves back, and the error leaves the dead band          TURNING
 *   TURNED             the load moves, and the error against it leaves the dead band    TURNING
 *   SETTLED            the error against the direction leaves the dead band             TURNING
 *   TURNED, SETTLED    the set point changes by more than the rest band in one tick     TURNING
 *   any                another law gives the torque                                     UNKNOWN
 *
 * Beside it, for the set point: a change at once starts a *move* (move.h), friction and all, in the
 * direction of the error. So does a load that moves back, where a cell tells when it is enough. A
 * motor that is not sure to turn the friction over leaves a load at standstill alone: what it
 * brings, by its momentum or because friction is late, it could never take back. Unless the error
 * is more than it could be wrong by the change is *declined* until the load moves, and the wanted
 * torque given as it is.
 *
 * Each direction has a *shift* of the wanted torque, an integral of the load cell's error: what the
 * model's friction is wrong by that way. It stays when the direction changes, and when the cell
 * dies. It also says when it is enough: the torque goes towards that of the direction only until
 * what is wanted has arrived, so that a wrong model does not overshoot, nor a load that the change
 * itself moves be taken for a stroke and pushed on. Without a cell only the friction that
 * friction_observer.h is sure of is compensated while the load moves: overcompensation would push.
 * At standstill it is the friction that is expected: less may not arrive at all.
 *
 * A load that moves against the slip direction is moved by the operator, as the motor pulls it the
 * other way, unless the drive has given it energy since the last change (passivity.h): the
 * direction follows at once, however soon that was.
 *
 * The *back-off* counts changes of direction that neither the load, by moving back or a stroke, nor
 * a new set point has called for: each doubles the dead band, and the next needs half more than
 * what the last one left at standstill; until the operator makes a stroke, moves the load back,
 * however slowly, or the set point changes. A stroke while the passivity observer is owed energy is
 * the drive's own and counts for nothing. So however wrong the model is, the law comes to
 * standstill.
 *
 * Friction that builds up late does not hold the motor while the direction changes: the load is
 * thrown, and given energy by it. Twice such a change makes all later ones slower.
 */
#ifndef BOWDEN_CORE_LAW_MODEL_INVERSION_H
#define BOWDEN_CORE_LAW_MODEL_INVERSION_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"
#include "law.h"
#include "move.h"

typedef enum {
    INVERSION_UNKNOWN,
    INVERSION_TURNING,
    INVERSION_TURNED,
    INVERSION_SETTLED,
} inversion_phase_t;

typedef struct {
    /* constants */
    ratio_t motor_per_load_torque; /* 1 / rho */
    ratio_t damping;               /* uN m at the motor per nm a tick */
    int32_t lag_ticks;             /* of one radian of the pair's resonance; >= 1 */
    uint32_t turned_ticks;         /* from a change of direction to TURNED */
    int32_t friction_unm;          /* at the load, of the sliding pair */
    int32_t felt_unm;              /* of it, that is left to be felt while the load moves */
    int64_t thrown_pj;             /* given in one change of direction: the load is thrown */
    int32_t rest_band_unm;
    int32_t integral_ticks; /* in which a shift takes up an error; 0: never */
    bool weak;              /* the motor may not be able to turn the friction over */
    /* state */
    inversion_phase_t phase;
    int32_t direction;          /* 1 or -1; 0 while UNKNOWN */
    uint32_t turn_ticks;        /* since it changed */
    uint32_t back_off;          /* changes of it that nobody called for; 0 .. 3 */
    int32_t left_unm;           /* error that the last such change left at standstill */
    int32_t turn_arc_nm;        /* where the load was then */
    int32_t turn_far_nm;        /* and how far in the direction it has got */
    int32_t turn_innovation_nm; /* and by how much the motor was ahead of the model */
    uint64_t turn_given_pj;     /* and what the load had been given */
    bool outran;                /* it has got further ahead than cables with friction let it */
    int32_t late;               /* changes of direction in which it did: 0 .. 2 */
    int32_t settled_unm;        /* the wanted torque that the back-off is for */
    bool called_for;            /* by a new set point: the next change of direction is free */
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
