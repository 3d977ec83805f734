/* law_coulomb.c: see law_coulomb.h. */
#include "law_coulomb.h"

law_coulomb_t law_coulomb_of(const law_settings_t *settings) {
    return (law_coulomb_t){
        .friction_unm = sliding_motor_torque_unm(settings->sliding, 0, 1),
    };
}

law_answer_t law_coulomb_step(const law_coulomb_t *law, const law_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t friction_unm =
        load_motion_friction_unm(inputs->sliding, law->friction_unm, inputs->load_motion->sign_q15);
    return (law_answer_t){
        .motor_torque_unm = fixed_add(inputs->naive_unm, friction_unm, &saturations),
    };
}

void law_coulomb_follow(law_coulomb_t *law, int32_t motor_torque_unm, const law_inputs_t *inputs) {
    (void)law;
    (void)motor_torque_unm;
    (void)inputs;
}
