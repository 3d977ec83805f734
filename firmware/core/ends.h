/* ends.h: how far motor and load may be apart: both ends of the pair held against each other.
 *
 * Both arcs are of the same cables, so their difference is stretch, and stretch is bounded. The
 * motor torque tau fixes the difference F = tau/r of the tensions at the motor. Along a cable
 * friction lets the tension rise or fall by at most exp(+-m), so that one with the tension T at
 * the motor is longer by between C g T and C g e^m T, with C = L/EA and g = (1 - e^-m)/m. With both
 * cables taut the stretches add up to twice that of the pretension, C T0; a slack one has none.
 * The largest difference that this leaves for F >= 0 is
 *
 *     max( C T0 (1 - e^-m)/(1 + e^-m) + C g F/(1 + e^-m),  C g e^m F - C T0 )
 *
 * and the smallest is its mirror image. For F < 0 the first alone holds, where the cables are as
 * stiff as configured. That is what they are at the pretension; strands bed in, so a cable that
 * carries far more is stiffer and gives less. Half of that stretch is taken for sure, as the
 * fallback does (rendering.c).
 *
 * The band needs no state of the cables, holds for every law, and does not drift. The zero may have
 * been taken anywhere between what friction holds at no torque, which widens the band once more.
 * Inertia and delays of the sensors make the torque of now that of a little while ago or later: the
 * band is that of all torques of the last 30 ms. And when the torque has changed the motor swings
 * to beyond where it will stay, at most as far again as it has come: the band is wider by the span
 * of those torques, either way.
 *
 * Pure; no division in the tick.
 */
#ifndef BOWDEN_CORE_ENDS_H
#define BOWDEN_CORE_ENDS_H

#include <stdbool.h>
#include <stdint.h>

#include "cable_path.h"
#include "fixed.h"

typedef struct {
    ratio_t taut;         /* nm per uN m of the motor, both cables taut */
    ratio_t slack;        /* the same with one of them slack */
    int32_t stretch_nm;   /* of the pretension, C T0 */
    int32_t held_nm;      /* what friction holds at no torque, either way */
    int32_t tolerance_nm; /* > 0 */
    int32_t zero_nm;      /* difference when it started */
    int32_t high_unm;     /* envelope of the motor torque */
    int32_t low_unm;
} ends_t;

/* Computes the constants; starts at zero. The wrap of `cable` counts up to CABLE_WRAP_MAX_Q24.
 * Slow. */
void ends_configure(ends_t *ends, const cable_settings_t *cable, uint32_t motor_pulley_radius_nm,
                    int32_t tolerance_nm);

/* Starts from here: `apart_nm` is the arc of the motor pulley less that of the load pulley. */
void ends_start(ends_t *ends, int32_t apart_nm);

/* One tick; is the difference beyond what the cables allow? Torque within +-2^24. */
bool ends_beyond(ends_t *ends, int32_t apart_nm, int32_t motor_torque_unm);

#endif
