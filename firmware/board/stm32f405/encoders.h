/* encoders.h: motor encoder on TIM3, load encoder on TIM4, their index pulses on EXTI8 and EXTI5.
 *
 * The timers count all four edges; quadrature.h follows them over turns and checks them.
 */
#ifndef BOWDEN_STM32F405_ENCODERS_H
#define BOWDEN_STM32F405_ENCODERS_H

#include "quadrature.h"

typedef struct {
    uint16_t motor, load;
} encoders_latch_t;

typedef struct {
    quadrature_t motor, load;
} encoders_t;

void encoders_start(void);

/* Both counters at this moment. */
encoders_latch_t encoders_latch(void);

/* One control period, from the latched counters and the index pulses since the last. The counts
 * are in `encoders`; false: one of them cannot be true. */
bool encoders_step(encoders_t *encoders, const encoders_latch_t *latch,
                   uint32_t motor_counts_per_turn, uint32_t load_counts_per_turn);

#endif
