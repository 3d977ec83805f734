/* laws_published.c: see laws_published.h. */
#include "laws_published.h"

#define ONE_Q15 32768
#define SMOOTHING_PER_S 200 /* the lag of the Coulomb sign, 5 ms */
#define ADAPTATION_S 4      /* Do's amplitude takes an error up in 4 integral times */

published_t published_of(const transmission_t *transmission, const sliding_t *sliding,
                         uint32_t ticks_per_s, uint32_t integral_gain_mhz) {
    const transmission_settings_t *pair = &transmission->settings;
    const int32_t friction_unm = sliding_motor_torque_unm(sliding, 0, 1);
    /* half of the backlash: the friction at one end over the stiffness, as arc */
    const int32_t stiffness = sliding->motor_unm_per_rad > 0 ? sliding->motor_unm_per_rad : 1;
    const uint64_t half_backlash_nm =
        (uint64_t)(uint32_t)friction_unm * pair->motor_pulley_radius_nm / (uint32_t)stiffness / 2u;
    const uint32_t smoothing = ticks_per_s / SMOOTHING_PER_S;
    return (published_t){
        .motor_per_load_torque =
            ratio_of(pair->motor_pulley_radius_nm, pair->load_pulley_radius_nm),
        .chi_per_arc = ratio_of(ONE_Q15, half_backlash_nm > 0 ? half_backlash_nm : 1u),
        .friction_unm = friction_unm,
        .integral_ticks =
            integral_gain_mhz > 0 ? (int32_t)(ticks_per_s * 1000u / integral_gain_mhz) + 1 : 0,
        .smoothing_ticks = (int32_t)(smoothing > 0 ? smoothing : 1u),
        .amplitude_unm = friction_unm,
    };
}

static int32_t part(int32_t whole_unm, int32_t q15) {
    return (int32_t)((int64_t)whole_unm * q15 / ONE_Q15);
}

void published_step(published_t *published, const estimator_t *estimator, int32_t load_arc_nm,
                    int32_t error_unm, bool integral_runs, bool hysteresis_runs) {
    uint32_t saturations = 0; /* a tick's motion is small */
    if (!published->started) {
        published->started = true;
        published->last_arc_nm = load_arc_nm;
    }
    const int32_t step_nm = fixed_subtract(load_arc_nm, published->last_arc_nm, &saturations);
    published->last_arc_nm = load_arc_nm;
    const int32_t step_q15 = fixed_clamp(fixed_scale(step_nm, published->chi_per_arc, &saturations),
                                         -2 * ONE_Q15, 2 * ONE_Q15);
    published->sign_q15 +=
        (estimator->load_direction * ONE_Q15 - published->sign_q15) / published->smoothing_ticks;
    published->chi_q15 = fixed_clamp(published->chi_q15 + step_q15, -ONE_Q15, ONE_Q15);
    const int32_t size_q15 = step_q15 < 0 ? -step_q15 : step_q15;
    published->zeta_q15 = fixed_clamp(
        published->zeta_q15 + step_q15 - part(size_q15, published->zeta_q15), -ONE_Q15, ONE_Q15);
    if (published->integral_ticks == 0) {
        return;
    }
    const int32_t at_motor = fixed_scale(error_unm, published->motor_per_load_torque, &saturations);
    const int32_t error = fixed_clamp(at_motor, -(1 << 22), 1 << 22);
    if (integral_runs) {
        const int64_t most = (int64_t)published->friction_unm * 512;
        const int64_t sum =
            published->integral_q8 + (int64_t)error * 256 / published->integral_ticks;
        published->integral_q8 = sum > most ? most : (sum < -most ? -most : sum);
    }
    if (hysteresis_runs) {
        const int32_t step =
            part(error, published->zeta_q15) / (ADAPTATION_S * published->integral_ticks);
        published->amplitude_unm =
            fixed_clamp(published->amplitude_unm + step, 0, 2 * published->friction_unm);
    }
}

int32_t published_coulomb_unm(const published_t *published) {
    return part(published->friction_unm, published->sign_q15);
}

int32_t published_integral_unm(const published_t *published) {
    return (int32_t)(published->integral_q8 / 256);
}

int32_t published_smooth_inverse_unm(const published_t *published) {
    return part(published->friction_unm, published->chi_q15);
}

int32_t published_hysteresis_unm(const published_t *published) {
    return part(published->amplitude_unm, published->zeta_q15);
}
