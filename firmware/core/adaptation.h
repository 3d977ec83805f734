/* adaptation.h: slow tracking of the levels of friction and of pretension from what the drive
 * itself observes.
 *
 * While the pair slides, rho tau_m - tau_l is what its friction takes, whatever is rendered. With
 * both cables taut that goes with friction times pretension, (S1) of sliding.h, which are not
 * identifiable separately; with one slack it goes with friction alone, (S2) and (S3). So two
 * factors are kept:
 *
 *   one cable slack     the friction's factor follows
 *   both taut           the pretension's factor follows, when a cable was slack not long before;
 *                       else that of the friction, which then stands for both
 *
 * with a time constant of two seconds of sliding, inside bounds. Nothing moves while the load
 * rests, the motor is at its limit or there is no load cell: then nothing of it can be observed.
 * The factors may be read, saved and given back.
 */
#ifndef BOWDEN_CORE_ADAPTATION_H
#define BOWDEN_CORE_ADAPTATION_H

#include <stdint.h>

#include "fixed.h"

/* Bounds of the factors. */
#define ADAPTATION_LEAST_PPM 500000
#define ADAPTATION_MOST_PPM 1500000

/* One of a factor in Q16. */
#define ADAPTATION_ONE 65536

typedef struct {
    ratio_t load_per_motor_torque; /* rho */
    ratio_t q16_per_unm;           /* 1 / friction of the model at the load */
    int32_t ticks;                 /* time constant */
    int32_t friction_q24;
    int32_t pretension_q24;
    int32_t slack_known; /* ticks for which a stroke with a slack cable still counts */
} adaptation_t;

/* Which cables carry, whatever the pretension is within its bounds. */
typedef enum {
    ADAPTATION_TAUT,
    ADAPTATION_SLACK, /* one of them does not */
} adaptation_cables_t;

/* A tick in which the pair slides. */
typedef struct {
    int32_t side; /* 1 or -1 */
    adaptation_cables_t cables;
    int32_t motor_torque_unm;
    int32_t load_torque_unm;
    int32_t model_unm; /* >= 0; what friction takes as adapted so far; with a slack cable only */
} adaptation_seen_t;

/* Constants and factors of one. `friction_unm`: of the model's taut sliding pair, at the load. */
adaptation_t adaptation_of(ratio_t load_per_motor_torque, int32_t friction_unm,
                           uint32_t ticks_per_s);

/* Sets the factors, limited to the bounds. */
void adaptation_set_ppm(adaptation_t *adaptation, uint32_t friction_ppm, uint32_t pretension_ppm);

void adaptation_step(adaptation_t *adaptation, const adaptation_seen_t *seen);

uint32_t adaptation_friction_q16(const adaptation_t *adaptation);
uint32_t adaptation_friction_ppm(const adaptation_t *adaptation);
uint32_t adaptation_pretension_q16(const adaptation_t *adaptation);
uint32_t adaptation_pretension_ppm(const adaptation_t *adaptation);

#endif
