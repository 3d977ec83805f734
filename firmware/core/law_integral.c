/* law_integral.c: see law_integral.h. */
#include "law_integral.h"

#define ERROR_MOST_UNM (1 << 22) /* its product with 256 is in range */

law_integral_t law_integral_of(const law_settings_t *settings) {
    const uint32_t gain_mhz = settings->integral_gain_mhz;
    const uint32_t per_gain = settings->ticks_per_s * 1000u;
    return (law_integral_t){
        .motor_per_load_torque = ratio_of(settings->transmission->settings.motor_pulley_radius_nm,
                                          settings->transmission->settings.load_pulley_radius_nm),
        .friction_unm = sliding_motor_torque_unm(settings->sliding, 0, 1),
        .integral_ticks = gain_mhz > 0 ? (int32_t)(per_gain / gain_mhz) + 1 : 0,
    };
}

law_answer_t law_integral_step(law_integral_t *law, const law_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    if (law->integral_ticks > 0) {
        const int32_t at_motor_unm =
            fixed_scale(inputs->error_unm, law->motor_per_load_torque, &saturations);
        const int32_t error_unm = fixed_clamp(at_motor_unm, -ERROR_MOST_UNM, ERROR_MOST_UNM);
        const int64_t most_q8 = (int64_t)law->friction_unm * 512;
        const int64_t sum_q8 = law->integral_q8 + (int64_t)error_unm * 256 / law->integral_ticks;
        law->integral_q8 = sum_q8 > most_q8 ? most_q8 : (sum_q8 < -most_q8 ? -most_q8 : sum_q8);
    }
    const int32_t integral_unm = (int32_t)(law->integral_q8 / 256);
    return (law_answer_t){
        .motor_torque_unm = fixed_add(inputs->naive_unm, integral_unm, &saturations),
    };
}

void law_integral_follow(law_integral_t *law, int32_t motor_torque_unm,
                         const law_inputs_t *inputs) {
    (void)law;
    (void)motor_torque_unm;
    (void)inputs;
}
