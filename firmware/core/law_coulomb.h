/* law_coulomb.h: Coulomb feed-forward (Townsend & Salisbury 1987): the naive torque and the
 * friction of the sliding pair in the direction of the load's motion, behind a short lag
 * (load_motion.h).
 */
#ifndef BOWDEN_CORE_LAW_COULOMB_H
#define BOWDEN_CORE_LAW_COULOMB_H

#include <stdint.h>

#include "law.h"

typedef struct {
    int32_t friction_unm; /* of the sliding pair, at the motor */
} law_coulomb_t;

/* As every law: law.h. */
law_coulomb_t law_coulomb_of(const law_settings_t *settings);
law_answer_t law_coulomb_step(const law_coulomb_t *law, const law_inputs_t *inputs);
void law_coulomb_follow(law_coulomb_t *law, int32_t motor_torque_unm, const law_inputs_t *inputs);

#endif
