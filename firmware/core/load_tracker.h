/* load_tracker.h: which way the load will go, from its motion between the encoder's counts.
 *
 * An observer of place, speed and acceleration whose three poles are at 1/tau, tau = 5 ms. It says
 * the speed 2 tau ahead, which is about as long as the motor needs to turn the friction over. Of a
 * load that dithers by a count, there and back in whatever ticks, it says at most 1.49 counts per
 * tau; only a speed beyond 1.5 is taken for motion.
 *
 * In: the load's motion of each tick. Out: the direction in which it will go. Pure; exchanging the
 * cables mirrors everything to the last bit.
 */
#ifndef BOWDEN_CORE_LOAD_TRACKER_H
#define BOWDEN_CORE_LOAD_TRACKER_H

#include <stdint.h>

typedef struct {
    /* constants */
    int32_t tau_ticks;   /* 5 .. 100 */
    int32_t least_q8_nm; /* a tick: speed that dither does not make */
    /* state; arc in nm, time in ticks */
    int32_t behind_q8_nm; /* by what the observed place is behind the encoder's */
    int32_t speed_q8_nm;
    int32_t acceleration_q8_nm;
} load_tracker_t;

/* Constants, and a standstill. `ticks_per_s`: 1000 .. 20000. `count_nm`: of the load's encoder, >
 * 0; more than 4 mm counts as 4 mm. */
load_tracker_t load_tracker_of(uint32_t ticks_per_s, int32_t count_nm);

/* One tick, in which the load has moved by `step_nm`. Of one that leaves the observer behind by
 * more than 0.5 mm the rest is forgotten. */
void load_tracker_step(load_tracker_t *tracker, int32_t step_nm);

/* 1 or -1: the load will go that way; 0: it is not known. */
int32_t load_tracker_direction(const load_tracker_t *tracker);

#endif
