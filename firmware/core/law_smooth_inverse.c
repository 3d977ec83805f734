/* law_smooth_inverse.c: see law_smooth_inverse.h. */
#include "law_smooth_inverse.h"

law_smooth_inverse_t law_smooth_inverse_of(const law_settings_t *settings) {
    return (law_smooth_inverse_t){
        .friction_unm = sliding_motor_torque_unm(settings->sliding, 0, 1),
    };
}

law_answer_t law_smooth_inverse_step(const law_smooth_inverse_t *law, const law_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t friction_unm =
        load_motion_friction_unm(inputs->sliding, law->friction_unm, inputs->load_motion->chi_q15);
    return (law_answer_t){
        .motor_torque_unm = fixed_add(inputs->naive_unm, friction_unm, &saturations),
    };
}

void law_smooth_inverse_follow(law_smooth_inverse_t *law, int32_t motor_torque_unm,
                               const law_inputs_t *inputs) {
    (void)law;
    (void)motor_torque_unm;
    (void)inputs;
}
