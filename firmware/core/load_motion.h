/* load_motion.h: three smoothed signs of the load's motion, which the published laws multiply by
 * the friction. Each runs from -1 to 1, in Q15.
 *
 *   sign   of the speed, behind a short lag         Townsend & Salisbury 1987
 *   chi    a play: where the load is in the         Agrawal, Peine & Yao 2010
 *          backlash B
 *   zeta   zeta' = (2/B) (v - abs(v) zeta)          Do et al. 2014
 *
 * The inverse of a backlash in position becomes a torque here because the drive gives torques: half
 * the backlash times the pair's stiffness is half the friction F at the motor, and as much again is
 * what friction takes at the other end. Pure.
 */
#ifndef BOWDEN_CORE_LOAD_MOTION_H
#define BOWDEN_CORE_LOAD_MOTION_H

#include <stdbool.h>
#include <stdint.h>

#include "estimator.h"
#include "fixed.h"
#include "sliding.h"

typedef struct {
    /* constants */
    ratio_t chi_per_arc; /* Q15 per nm of load arc: 2 / B */
    int32_t smoothing_ticks;
    /* state */
    int32_t last_arc_nm;
    int32_t sign_q15;
    int32_t chi_q15;
    int32_t zeta_q15;
    bool started;
} load_motion_t;

/* Constants and a start at standstill. */
load_motion_t load_motion_of(const transmission_t *transmission, const sliding_t *sliding,
                             uint32_t ticks_per_s);

/* One tick. */
void load_motion_step(load_motion_t *motion, const estimator_t *estimator, int32_t load_arc_nm);

/* `whole_unm` times a Q15 number. */
int32_t load_motion_part_unm(int32_t whole_unm, int32_t q15);

/* The same of a friction, which is other by the pair's factor for the direction of `q15`. */
int32_t load_motion_friction_unm(const sliding_t *sliding, int32_t friction_unm, int32_t q15);

#endif
