/* adaptation.c: see adaptation.h. */
#include "adaptation.h"

#define TIME_S 2
#define KNOWN_S 20 /* of taut sliding, at most, for which a sample with a slack cable counts */
#define KNOWN_PER_TICK 16 /* a tick with a slack cable counts for so many */
#define MOST_TAUT 2       /* largest sample, in frictions of the taut pair */
#define MOST_SLACK 16     /* the same with a slack cable, whose friction grows with the load */
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
        .friction_q24 = q24_of_ppm(PPM),
        .pretension_q24 = q24_of_ppm(PPM),
    };
}

static int32_t bounded(int32_t factor_q24) {
    return fixed_clamp(factor_q24, q24_of_ppm(ADAPTATION_LEAST_PPM),
                       q24_of_ppm(ADAPTATION_MOST_PPM));
}

static int32_t set_ppm(uint32_t factor_ppm) {
    return bounded(q24_of_ppm(factor_ppm < ADAPTATION_MOST_PPM ? factor_ppm : ADAPTATION_MOST_PPM));
}

void adaptation_set_ppm(adaptation_t *adaptation, uint32_t friction_ppm, uint32_t pretension_ppm) {
    adaptation->friction_q24 = set_ppm(friction_ppm);
    adaptation->pretension_q24 = set_ppm(pretension_ppm);
}

/* uN m in units of the model's taut friction, Q16. */
static int32_t in_frictions_q16(const adaptation_t *adaptation, int32_t torque_unm, int32_t most) {
    uint32_t saturations = 0; /* the bounds are far nearer */
    return fixed_clamp(fixed_scale(torque_unm, adaptation->q16_per_unm, &saturations), 0,
                       most * ADAPTATION_ONE);
}

/* (a b) in Q24 for factors within the bounds. */
static int32_t product_q24(int32_t a_q24, int32_t b_q24) {
    return (int32_t)((int64_t)a_q24 * b_q24 / (ADAPTATION_ONE * Q24_PER_Q16));
}

static int32_t followed(const adaptation_t *adaptation, int32_t factor_q24, int32_t seen_q16,
                        int32_t expected_q24) {
    return bounded(factor_q24 + (seen_q16 * Q24_PER_Q16 - expected_q24) / adaptation->ticks);
}

void adaptation_step(adaptation_t *adaptation, const adaptation_seen_t *seen) {
    uint32_t saturations = 0; /* the bounds are far nearer */
    const int32_t given_unm =
        fixed_scale(seen->motor_torque_unm, adaptation->load_per_motor_torque, &saturations);
    const int32_t lost_unm =
        seen->side * fixed_subtract(given_unm, seen->load_torque_unm, &saturations);
    if (seen->cables == ADAPTATION_SLACK) {
        const int32_t lost_q16 = in_frictions_q16(adaptation, lost_unm, MOST_SLACK);
        const int32_t model_q16 = in_frictions_q16(adaptation, seen->model_unm, MOST_SLACK);
        adaptation->friction_q24 =
            followed(adaptation, adaptation->friction_q24, lost_q16, model_q16 * Q24_PER_Q16);
        const int32_t most = KNOWN_S / TIME_S * adaptation->ticks;
        adaptation->slack_known = fixed_clamp(adaptation->slack_known + KNOWN_PER_TICK, 0, most);
        return;
    }
    const int32_t lost_q16 = in_frictions_q16(adaptation, lost_unm, MOST_TAUT);
    const int32_t expected_q24 = product_q24(adaptation->friction_q24, adaptation->pretension_q24);
    if (adaptation->slack_known > 0) {
        adaptation->slack_known--;
        adaptation->pretension_q24 =
            followed(adaptation, adaptation->pretension_q24, lost_q16, expected_q24);
    } else {
        adaptation->friction_q24 =
            followed(adaptation, adaptation->friction_q24, lost_q16, expected_q24);
    }
}

static uint32_t ppm(int32_t factor_q24) {
    const uint64_t one = ADAPTATION_ONE * Q24_PER_Q16;
    return (uint32_t)(((uint64_t)(uint32_t)factor_q24 * PPM + one / 2) / one);
}

uint32_t adaptation_friction_q16(const adaptation_t *adaptation) {
    return (uint32_t)adaptation->friction_q24 / Q24_PER_Q16;
}

uint32_t adaptation_friction_ppm(const adaptation_t *adaptation) {
    return ppm(adaptation->friction_q24);
}

uint32_t adaptation_pretension_q16(const adaptation_t *adaptation) {
    return (uint32_t)adaptation->pretension_q24 / Q24_PER_Q16;
}

uint32_t adaptation_pretension_ppm(const adaptation_t *adaptation) {
    return ppm(adaptation->pretension_q24);
}
