/* load_motion.c: see load_motion.h. */
#include "load_motion.h"

#define ONE_Q15 32768
#define ONE_Q14 16384       /* of sliding_factor_t */
#define SMOOTHING_PER_S 200 /* the lag of the sign, 5 ms */

load_motion_t load_motion_of(const transmission_t *transmission, const sliding_t *sliding,
                             uint32_t ticks_per_s) {
    const transmission_settings_t *pair = &transmission->settings;
    const int32_t friction_unm = sliding_motor_torque_unm(sliding, 0, 1);
    /* half of the backlash: the friction at one end over the stiffness, as arc */
    const int32_t stiffness = sliding->motor_unm_per_rad > 0 ? sliding->motor_unm_per_rad : 1;
    const uint64_t half_backlash_nm =
        (uint64_t)(uint32_t)friction_unm * pair->motor_pulley_radius_nm / (uint32_t)stiffness / 2u;
    const uint32_t smoothing = ticks_per_s / SMOOTHING_PER_S;
    return (load_motion_t){
        .chi_per_arc = ratio_of(ONE_Q15, half_backlash_nm > 0 ? half_backlash_nm : 1u),
        .smoothing_ticks = (int32_t)(smoothing > 0 ? smoothing : 1u),
    };
}

int32_t load_motion_part_unm(int32_t whole_unm, int32_t q15) {
    return (int32_t)((int64_t)whole_unm * q15 / ONE_Q15);
}

int32_t load_motion_friction_unm(const sliding_t *sliding, int32_t friction_unm, int32_t q15) {
    uint32_t saturations = 0; /* a friction beyond the range is beyond the motor */
    const int64_t factor_q14 = sliding->factor[q15 > 0 ? 1 : 0].q14;
    const int32_t whole_unm = fixed_saturate(friction_unm * factor_q14 / ONE_Q14, &saturations);
    return load_motion_part_unm(whole_unm, q15);
}

void load_motion_step(load_motion_t *motion, const estimator_t *estimator, int32_t load_arc_nm) {
    uint32_t saturations = 0; /* a tick's motion is small */
    if (!motion->started) {
        motion->started = true;
        motion->last_arc_nm = load_arc_nm;
    }
    const int32_t step_nm = fixed_subtract(load_arc_nm, motion->last_arc_nm, &saturations);
    motion->last_arc_nm = load_arc_nm;
    const int32_t step_q15 = fixed_clamp(fixed_scale(step_nm, motion->chi_per_arc, &saturations),
                                         -2 * ONE_Q15, 2 * ONE_Q15);
    motion->sign_q15 +=
        (estimator->load_direction * ONE_Q15 - motion->sign_q15) / motion->smoothing_ticks;
    motion->chi_q15 = fixed_clamp(motion->chi_q15 + step_q15, -ONE_Q15, ONE_Q15);
    const int32_t size_q15 = step_q15 < 0 ? -step_q15 : step_q15;
    motion->zeta_q15 =
        fixed_clamp(motion->zeta_q15 + step_q15 - load_motion_part_unm(size_q15, motion->zeta_q15),
                    -ONE_Q15, ONE_Q15);
}
