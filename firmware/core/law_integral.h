/* law_integral.h: integral force control (Townsend & Salisbury 1987): the naive torque and the
 * integral of the force error, at most twice the friction of the sliding pair.
 */
#ifndef BOWDEN_CORE_LAW_INTEGRAL_H
#define BOWDEN_CORE_LAW_INTEGRAL_H

#include <stdint.h>

#include "law.h"

typedef struct {
    /* constants */
    ratio_t motor_per_load_torque; /* 1 / rho */
    int32_t friction_unm;          /* of the sliding pair, at the motor */
    int32_t integral_ticks;        /* 0: no integral */
    /* state */
    int64_t integral_q8; /* of the force error, at the motor, in uN m */
} law_integral_t;

/* As every law: law.h. */
law_integral_t law_integral_of(const law_settings_t *settings);
law_answer_t law_integral_step(law_integral_t *law, const law_inputs_t *inputs);
void law_integral_follow(law_integral_t *law, int32_t motor_torque_unm, const law_inputs_t *inputs);

#endif
