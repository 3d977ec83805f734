/* friction_observer.h: estimate of the pair's friction from the two encoders and the motor current,
 * with its uncertainty. It needs no load cell.
 *
 * The cables between the pulleys are a spring of known stiffness, so their stretch measures their
 * mean tension, half way between the force f at the motor and the force g at the load, while the
 * motor current gives f. While the pair slides taut towards s (1 or -1) with the friction F,
 *   (O1)  gap = r_m theta_m - r_l theta_l = L/(4 EA) (f + g) = L/(4 EA) (2 f - s F)
 * and so the innovation (estimator.h), the measured gap less the model's, in units of the model's
 * B = F L/(4 EA), shows by how much the model is wrong:
 *   (O2)  s innovation/B = -x + e (s gap/B) + d (|v|/B) + s o
 * with x the relative error of the friction, e that of the compliance, d the time by which the load
 * encoder is late, v its speed, and o what is the same both ways: torque that the cables held when
 * the model started, or a motor torque that is off. The four differ in what they go with; what has
 * not been excited stays at its prior, with its deviation. A Kalman filter of these four numbers,
 * 64 times a second.
 *
 * e, d and o belong to the rig. The friction changes while it slides: with place, speed, warmth and
 * wear, or because a clamp slips. So what is known of it fades towards the prior x_0,
 *   (O4)  dx = -(x - x_0)/tau dt + sigma sqrt(2/tau) dw
 * sigma being the deviation of the prior and of such changes together. A change of friction moves
 * all of (O2) at once, which no e, d or o does: it is taken for one within some windows. The
 * variance of a sample is estimated from the errors of the samples: play, eccentric pulleys and
 * whatever else (O2) lacks widens the deviation of the friction.
 *
 * *Sure* is that friction less two standard deviations: what may be compensated without giving the
 * operator energy. Of more friction than the model's only half is assumed, because play at the
 * load and a motor whose own friction is unknown look the same, and pushing the operator is worse
 * than residual friction.
 *
 * In the frame of the direction s a mirrored motion is the same motion, to the bit. Pure.
 */
#ifndef BOWDEN_CORE_FRICTION_OBSERVER_H
#define BOWDEN_CORE_FRICTION_OBSERVER_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"

#define FRICTION_OBSERVER_ONE 65536
#define FRICTION_OBSERVER_NUMBERS 4

typedef struct {
    /* constants */
    ratio_t q16_per_nm;      /* 1/B */
    int32_t least_noise_q24; /* variance of a sample, in units of B, with nothing but counts */
    uint32_t window_ticks;
    int32_t least_travel_nm; /* in a window, to be a direction */
    int32_t
        most_q30[FRICTION_OBSERVER_NUMBERS]; /* variances where nothing has been seen for long */
    /* x, e, d (in windows) and o in Q24; their covariance, upper triangle row by row, in Q30 */
    int32_t mean_q24[FRICTION_OBSERVER_NUMBERS];
    int32_t covariance_q30[FRICTION_OBSERVER_NUMBERS * (FRICTION_OBSERVER_NUMBERS + 1) / 2];
    int32_t deviation_q16; /* of x */
    int32_t prior_q24;     /* x_0 */
    int32_t noise_q24;     /* variance of a sample as the samples show it */
    /* the window so far */
    uint32_t ticks;
    int32_t slid_ticks; /* towards 1, less those towards -1 */
    int32_t gap_sum_nm;
    int32_t innovation_sum_nm;
    int32_t mark_nm; /* the load's place at its start */
    bool slack;
    bool started;
} friction_observer_t;

/* What a tick shows. */
typedef struct {
    int32_t side; /* 1 or -1: in the model the whole pair slides that way; else 0 */
    bool slack;   /* in the model a cable is */
    int32_t load_arc_nm;
    int32_t gap_nm;        /* of the model */
    int32_t innovation_nm; /* estimator.h */
} friction_observed_t;

/* Constants and the prior. `stretch_nm`: B. `count_nm`: of an encoder, the coarser one.
 * `deviation_ppm`: of the model's friction, relative; at most 500000. */
friction_observer_t friction_observer_of(int32_t stretch_nm, int32_t count_nm, uint32_t ticks_per_s,
                                         uint32_t deviation_ppm);

/* Begins anew at another relative friction, one is FRICTION_OBSERVER_ONE. */
void friction_observer_expect(friction_observer_t *observer, uint32_t factor_q16);

/* One tick. */
void friction_observer_step(friction_observer_t *observer, const friction_observed_t *seen);

/* Friction as it is assumed, relative to the model's, in Q16. */
uint32_t friction_observer_mean_q16(const friction_observer_t *observer);

/* Friction less two standard deviations, relative to the model's, in Q16. */
uint32_t friction_observer_sure_q16(const friction_observer_t *observer);

#endif
