/* law_smooth_inverse.h: smooth inverse of the backlash (Agrawal, Peine & Yao 2010): the naive
 * torque and the friction times where the load is in the backlash (chi of load_motion.h).
 */
#ifndef BOWDEN_CORE_LAW_SMOOTH_INVERSE_H
#define BOWDEN_CORE_LAW_SMOOTH_INVERSE_H

#include <stdint.h>

#include "law.h"

typedef struct {
    int32_t friction_unm; /* of the sliding pair, at the motor */
} law_smooth_inverse_t;

/* As every law: law.h. */
law_smooth_inverse_t law_smooth_inverse_of(const law_settings_t *settings);
law_answer_t law_smooth_inverse_step(const law_smooth_inverse_t *law, const law_inputs_t *inputs);
void law_smooth_inverse_follow(law_smooth_inverse_t *law, int32_t motor_torque_unm,
                               const law_inputs_t *inputs);

#endif
