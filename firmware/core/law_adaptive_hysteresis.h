/* law_adaptive_hysteresis.h: adaptive hysteresis (Do et al. 2014): the naive torque and A zeta,
 * zeta of load_motion.h; the amplitude adapts itself, A' = gamma error zeta, from the friction F of
 * the sliding pair within 0 .. 2 F.
 */
#ifndef BOWDEN_CORE_LAW_ADAPTIVE_HYSTERESIS_H
#define BOWDEN_CORE_LAW_ADAPTIVE_HYSTERESIS_H

#include <stdint.h>

#include "law.h"

typedef struct {
    /* constants */
    ratio_t motor_per_load_torque; /* 1 / rho */
    int32_t friction_unm;          /* of the sliding pair, at the motor */
    int32_t integral_ticks;        /* 0: the amplitude stays */
    /* state */
    int32_t amplitude_unm; /* A */
} law_adaptive_hysteresis_t;

/* As every law: law.h. */
law_adaptive_hysteresis_t law_adaptive_hysteresis_of(const law_settings_t *settings);
law_answer_t law_adaptive_hysteresis_step(law_adaptive_hysteresis_t *law,
                                          const law_inputs_t *inputs);
void law_adaptive_hysteresis_follow(law_adaptive_hysteresis_t *law, int32_t motor_torque_unm,
                                    const law_inputs_t *inputs);

#endif
