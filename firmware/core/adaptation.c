/* adaptation.c: see adaptation.h. */
#include "adaptation.h"

#define TIME_S 2
#define PPM 1000000u
#define Q24_PER_Q16 256

static int32_t q24_of_ppm(uint32_t ppm) {
    return (int32_t)(((uint64_t)ppm * ADAPTATION_ONE * Q24_PER_Q16 + PPM / 2) / PPM);
}

adaptation_t adaptation_of(ratio_t load_per_motor_torque, int32_t friction_unm,
                           uint32_t ticks_per_s) {
    return (adaptation_t){
        .load_per_motor_torque = load_per_motor_torque,
        .q16_per_unm = ratio_of(ADAPTATION_ONE, friction_unm > 0 ? (uint32_t)friction_unm : 1u),
        .ticks = (int32_t)(TIME_S * ticks_per_s),
        .factor_q24 = q24_of_ppm(PPM),
    };
}

static int32_t bounded(int32_t factor_q24) {
    return fixed_clamp(factor_q24, q24_of_ppm(ADAPTATION_LEAST_PPM),
                       q24_of_ppm(ADAPTATION_MOST_PPM));
}

void adaptation_set_ppm(adaptation_t *adaptation, uint32_t factor_ppm) {
    const uint32_t most = factor_ppm < ADAPTATION_MOST_PPM ? factor_ppm : ADAPTATION_MOST_PPM;
    adaptation->factor_q24 = bounded(q24_of_ppm(most));
}

void adaptation_step(adaptation_t *adaptation, int32_t side, int32_t motor_torque_unm,
                     int32_t load_torque_unm) {
    uint32_t saturations = 0; /* the bounds are far nearer */
    const int32_t given_unm =
        fixed_scale(motor_torque_unm, adaptation->load_per_motor_torque, &saturations);
    const int32_t lost_unm = fixed_subtract(given_unm, load_torque_unm, &saturations);
    const int32_t seen_q16 = fixed_clamp(
        fixed_scale(side * lost_unm, adaptation->q16_per_unm, &saturations), 0, 2 * ADAPTATION_ONE);
    const int32_t step_q24 = (seen_q16 * Q24_PER_Q16 - adaptation->factor_q24) / adaptation->ticks;
    adaptation->factor_q24 = bounded(adaptation->factor_q24 + step_q24);
}

uint32_t adaptation_factor_q16(const adaptation_t *adaptation) {
    return (uint32_t)adaptation->factor_q24 / Q24_PER_Q16;
}

uint32_t adaptation_factor_ppm(const adaptation_t *adaptation) {
    const uint64_t one = ADAPTATION_ONE * Q24_PER_Q16;
    return (uint32_t)(((uint64_t)(uint32_t)adaptation->factor_q24 * PPM + one / 2) / one);
}
