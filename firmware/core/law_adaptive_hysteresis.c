/* law_adaptive_hysteresis.c: see law_adaptive_hysteresis.h. */
#include "law_adaptive_hysteresis.h"

#define ADAPTATION_TIMES 4       /* the amplitude takes an error up in so many integral times */
#define ERROR_MOST_UNM (1 << 22) /* its product with Q15 is in range */

law_adaptive_hysteresis_t law_adaptive_hysteresis_of(const law_settings_t *settings) {
    const uint32_t gain_mhz = settings->integral_gain_mhz;
    const uint32_t per_gain = settings->ticks_per_s * 1000u;
    const int32_t friction_unm = sliding_motor_torque_unm(settings->sliding, 0, 1);
    return (law_adaptive_hysteresis_t){
        .motor_per_load_torque = ratio_of(settings->transmission->settings.motor_pulley_radius_nm,
                                          settings->transmission->settings.load_pulley_radius_nm),
        .friction_unm = friction_unm,
        .integral_ticks = gain_mhz > 0 ? (int32_t)(per_gain / gain_mhz) + 1 : 0,
        .amplitude_unm = friction_unm,
    };
}

law_answer_t law_adaptive_hysteresis_step(law_adaptive_hysteresis_t *law,
                                          const law_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t zeta_q15 = inputs->load_motion->zeta_q15;
    if (law->integral_ticks > 0) {
        const int32_t at_motor_unm =
            fixed_scale(inputs->error_unm, law->motor_per_load_torque, &saturations);
        const int32_t error_unm = fixed_clamp(at_motor_unm, -ERROR_MOST_UNM, ERROR_MOST_UNM);
        const int32_t step_unm =
            load_motion_part_unm(error_unm, zeta_q15) / (ADAPTATION_TIMES * law->integral_ticks);
        law->amplitude_unm = fixed_clamp(law->amplitude_unm + step_unm, 0, 2 * law->friction_unm);
    }
    const int32_t friction_unm =
        load_motion_friction_unm(inputs->sliding, law->amplitude_unm, zeta_q15);
    return (law_answer_t){
        .motor_torque_unm = fixed_add(inputs->naive_unm, friction_unm, &saturations),
    };
}

void law_adaptive_hysteresis_follow(law_adaptive_hysteresis_t *law, int32_t motor_torque_unm,
                                    const law_inputs_t *inputs) {
    (void)law;
    (void)motor_torque_unm;
    (void)inputs;
}
