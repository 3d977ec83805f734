/* adaptation.h: slow tracking of the friction level from what the drive itself observes.
 *
 * While the pair slides with both cables taut, (S1) of sliding.h: rho tau_m - tau_l is the friction
 * of the pair, whatever is rendered. What the load cell and the motor current say of it, against
 * the model's, moves a factor on the model's friction, with a time constant of two seconds of
 * sliding, inside bounds. Nothing moves while the load rests, a cable is slack, the motor is at its
 * limit or there is no load cell: then nothing of it can be observed.
 *
 * Pretension and wrap angle show in this friction as their product only; the factor is of that
 * product. It may be read, saved and given back.
 */
#ifndef BOWDEN_CORE_ADAPTATION_H
#define BOWDEN_CORE_ADAPTATION_H

#include <stdint.h>

#include "fixed.h"

/* Bounds of the factor. */
#define ADAPTATION_LEAST_PPM 500000
#define ADAPTATION_MOST_PPM 1500000

/* One of a factor in Q16. */
#define ADAPTATION_ONE 65536

typedef struct {
    ratio_t load_per_motor_torque; /* rho */
    ratio_t q16_per_unm;           /* 1 / friction of the model at the load */
    int32_t ticks;                 /* time constant */
    int32_t factor_q24;
} adaptation_t;

/* Constants and a factor of one. `friction_unm`: of the model's sliding pair, at the load. */
adaptation_t adaptation_of(ratio_t load_per_motor_torque, int32_t friction_unm,
                           uint32_t ticks_per_s);

/* Sets the factor, limited to the bounds. */
void adaptation_set_ppm(adaptation_t *adaptation, uint32_t factor_ppm);

/* One tick in which the pair slides, taut, towards `side`: 1 or -1. */
void adaptation_step(adaptation_t *adaptation, int32_t side, int32_t motor_torque_unm,
                     int32_t load_torque_unm);

uint32_t adaptation_factor_q16(const adaptation_t *adaptation);
uint32_t adaptation_factor_ppm(const adaptation_t *adaptation);

#endif
