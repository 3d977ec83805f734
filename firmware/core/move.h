/* move.h: how the motor goes from one static torque to another when something else is wanted at
 * once: as fast as its torque allows, and without overshoot, which friction would hold.
 *
 * At a load that stays the pair is a spring to the motor, J x'' + D x' + f(x) = tau, with f what
 * the motor holds at standstill, x in torque of the taut pair, and omega the resonance. Past the
 * torque at which a cable goes slack one cable alone is half as stiff. The motor is to go as
 * through two lags, (M1)  x = u / (1 + s T)^2 and with l1, l2 what is behind one and two of them
 * that takes (M2)  tau = f(l2) + a (u - 2 l1 + l2) + b (l1 - l2),  a = 1/(omega T)^2,  b = D/(J
 * omega^2 T) The second term turns the motor's inertia and never pulls a cable; the third is what
 * damping (law_model_inversion.c) takes of the planned speed. T is as short as the motor's limit
 * allows: (M3)  a |u - x| = limit u is within the motor's limit: beyond it, it would arrive there
 * at full speed with no torque left to stop it, and bring the load what it can never take back.
 *
 * A mirrored move is the same move, to the bit. Pure.
 */
#ifndef BOWDEN_CORE_MOVE_H
#define BOWDEN_CORE_MOVE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    /* constants */
    int32_t lag_ticks;        /* 1/omega; >= 1 */
    int32_t limit_unm;        /* of the motor */
    int32_t damping_q8_ticks; /* D/J omega^2 in ticks */
    /* state */
    int32_t slack_unm;   /* motor torque at which a cable goes slack */
    int32_t ticks;       /* T; 0: nothing moves */
    int32_t left_ticks;  /* until the move is over */
    int32_t swift_q8;    /* a */
    int32_t at_unm[2];   /* l1, l2 */
    int32_t inertia_unm; /* second term of (M2) in the last tick */
} move_t;

/* Constants and a motor at standstill. `damping_per_s`: D/J. */
move_t move_of(int32_t lag_ticks, int32_t limit_unm, int32_t damping_per_s, uint32_t ticks_per_s);

/* Begins: from what the motor holds now, or from where it is in the last move. `slack_unm`: >= 0.
 */
void move_start(move_t *move, int32_t from_unm, int32_t to_unm, int32_t slack_unm);

/* One tick of a move that runs: motor torque (M2), the damping to be taken off. */
int32_t move_step(move_t *move, int32_t to_unm);

/* What the motor holds where the plan has it. */
int32_t move_static_unm(const move_t *move);

/* There is nothing more to do, or something else takes over. */
void move_end(move_t *move);

bool move_runs(const move_t *move);

#endif
