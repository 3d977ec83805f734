/* heat.h: heating by a current: its mean square over a thermal time constant (I2t), and the
 * current that keeps it below what may flow for ever.
 *
 * Heat is a fraction of that at the continuous current: 1 there, in equilibrium. From 0.9 on the
 * current is limited, the more the hotter, and at 1 to the continuous one, so that a limited
 * current never brings it above. Above 1.1 something is wrong. Pure; no division in the tick.
 */
#ifndef BOWDEN_DRIVE_SUPERVISION_HEAT_H
#define BOWDEN_DRIVE_SUPERVISION_HEAT_H

#include <stdbool.h>
#include <stdint.h>

/* Ticks between two steps. */
#define HEAT_STEP_TICKS 64u

/* Mean square of a current, collected tick by tick. */
typedef struct {
    uint64_t sum_ma2;
    uint32_t ticks;
    uint32_t mean_ma2; /* of the last HEAT_STEP_TICKS */
} heat_meter_t;

typedef struct {
    int32_t continuous_ua; /* > 0 */
    uint64_t per_ma2_q40;  /* heat of a mean square of 1 mA2 */
    uint32_t share_q24;    /* of the way to equilibrium in a step */
    int64_t heat_q24;
} heat_t;

/* Takes the settings; what is hot stays hot. continuous_ua 100000 .. 65000000, time_ms >= 100. */
void heat_configure(heat_t *heat, uint32_t continuous_ua, uint32_t time_ms);

/* One tick of the meter; currents beyond 65 A count as that. */
void heat_measure(heat_meter_t *meter, int32_t current_ua);

/* Every HEAT_STEP_TICKS. */
void heat_step(heat_t *heat, uint32_t mean_ma2);

/* What may flow now, of `most_ua`. */
int32_t heat_limit_ua(const heat_t *heat, int32_t most_ua);

/* More than limiting can explain? */
bool heat_is_excessive(const heat_t *heat);

#endif
