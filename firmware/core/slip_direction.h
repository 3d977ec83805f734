/* slip_direction.h: the direction in which the pair slides, or has to for the wanted torque.
 *
 * A load that moves shows it. A load at standstill holds whatever torque is there, within the
 * friction; then it is the direction towards which the load torque has to change, and where the
 * error is small nothing is done: friction holds it, so there is no limit cycle.
 *
 * Phases, and what leads from one to the next:
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
 *   TURNING, TURNED    the operator turns, and the error leaves the dead band           TURNING
 *   TURNED             the load moves, and the error against it leaves the dead band    TURNING
 *   SETTLED            the error against the direction leaves the dead band             TURNING
 *   TURNED, SETTLED    the set point changes by more than the rest band in one tick     TURNING
 *   any                another law gives the torque                                     UNKNOWN
 *
 * A load that moves against the slip direction is moved by the operator, as the motor pulls it the
 * other way, unless the drive has given it energy since the last change (passivity.h): the
 * direction follows at once, however soon that was, and the back-off ends. It moves so when it has
 * gone three counts, or one and is about to go on (load_tracker.h).
 *
 * A load that creeps on in the slip direction slides that way, however large the error: friction
 * turned over would push it. So the direction changes only once the load stands still or comes
 * back.
 *
 * The *back-off* counts changes of direction that neither the operator, by turning the load around
 * or a stroke, nor a new set point has called for: each doubles the dead band, and the next needs
 * half more than what the last one left at standstill; until the operator makes a stroke, moves the
 * load back, however slowly, or the set point changes. A stroke while the passivity observer has
 * counted energy that the drive has given is the drive's own and counts for nothing. So however
 * wrong the model is, the law comes to standstill.
 *
 * Friction that builds up late does not hold the motor while the direction changes: the load is
 * thrown, and given energy by it. Twice such a change makes all later ones slower.
 *
 * Part of the model inversion (law_model_inversion.h). Pure.
 */
#ifndef BOWDEN_CORE_SLIP_DIRECTION_H
#define BOWDEN_CORE_SLIP_DIRECTION_H

#include <stdbool.h>
#include <stdint.h>

#include "law.h"

typedef enum {
    SLIP_PHASE_UNKNOWN,
    SLIP_PHASE_TURNING,
    SLIP_PHASE_TURNED,
    SLIP_PHASE_SETTLED,
} slip_phase_t;

typedef struct {
    /* constants */
    int32_t lag_ticks;     /* of one radian of the pair's resonance; >= 1 */
    uint32_t turned_ticks; /* from a change of direction to TURNED */
    int32_t friction_unm;  /* at the load, of the sliding pair */
    int64_t thrown_pj;     /* given in one change of direction: the load is thrown */
    int32_t standstill_band_unm;
    /* state */
    slip_phase_t phase;
    int32_t direction;          /* 1 or -1; 0 while UNKNOWN */
    uint32_t turn_ticks;        /* since it changed */
    uint32_t back_off;          /* changes of it without a cause; 0 .. 3 */
    int32_t left_unm;           /* error that the last such change left at standstill */
    int32_t turn_arc_nm;        /* where the load was then */
    int32_t turn_far_nm;        /* and how far in the direction it has got */
    int32_t turn_innovation_nm; /* and by how much the motor was ahead of the model */
    uint64_t turn_given_pj;     /* and what the load had been given */
    bool outran;                /* it has got further ahead than cables with friction let it */
    int32_t late;               /* changes of direction in which it did: 0 .. 2 */
    int32_t settled_unm;        /* the wanted torque that the back-off is for */
    bool called_for;            /* by a new set point: the next change of direction is free */
} slip_direction_t;

/* Constants, and the direction unknown. `lag_ticks`: >= 1; `friction_unm`: 0 .. 2^30; `load_urad`:
 * how far the load moves while the friction builds up anew. */
slip_direction_t slip_direction_of(int32_t lag_ticks, int32_t friction_unm, int32_t load_urad,
                                   int32_t standstill_band_unm);

/* Another law gives the torque. */
void slip_direction_lose(slip_direction_t *slip);

/* The set point has changed at once: the slip direction is that of the error, as the motor outruns
 * the load. */
void slip_direction_call(slip_direction_t *slip, const law_inputs_t *inputs, int32_t wanted_unm,
                         int32_t error_unm);

/* One tick. Follows the load that the operator turns around at once, all else when the last change
 * is over. `declined`: an error at standstill calls for nothing. Says whether a planned move is to
 * turn the friction over. */
bool slip_direction_step(slip_direction_t *slip, const law_inputs_t *inputs, int32_t wanted_unm,
                         int32_t error_unm, bool declined);

/* Have the last change's 8 lags passed? */
bool slip_direction_has_turned(const slip_direction_t *slip);

#endif
