/* sliding.c: see sliding.h. */
#include "sliding.h"

#define ONE_Q16 65536
#define ONE_Q14 16384u
#define NEAR_Q24 ((int32_t)FIXED_Q24_ONE / 16)

/* Motor forces between which both cables keep the floor tension at their slackest ends: the
 * released one at the motor, T_b = (2 S - C_p f) / (C_p + C_r), the pulled one at the load. */
static void keep_taut(sliding_t *sliding, const cable_front_t *pull, const cable_front_t *release,
                      int32_t twice_stretch_nm, int32_t floor_un) {
    uint32_t saturations = 0;
    const ratio_t sum = ratio_add(pull->compliance, release->compliance);
    const int32_t b_nm = fixed_scale(floor_un, sum, &saturations);
    const int32_t a_nm = fixed_scale(floor_un, ratio_multiply(sum, release->tension), &saturations);
    const int32_t spare_b_nm = fixed_subtract(twice_stretch_nm, b_nm, &saturations);
    const int32_t spare_a_nm = fixed_subtract(twice_stretch_nm, a_nm, &saturations);
    const int32_t most_un = fixed_scale(spare_b_nm, pull->stiffness, &saturations);
    const int32_t least_un = -fixed_scale(spare_a_nm, release->stiffness, &saturations);
    sliding->taut_most_unm =
        fixed_scale(most_un > 0 ? most_un : 0, sliding->motor_torque_per_force, &saturations);
    sliding->taut_least_unm =
        fixed_scale(least_un < 0 ? least_un : 0, sliding->motor_torque_per_force, &saturations);
}

sliding_t sliding_of(const transmission_t *transmission, int32_t slack_floor_un) {
    const cable_path_t *path = &transmission->path;
    const cable_front_t *pull = &path->front[CABLE_PROXIMAL][CABLE_PULL][path->segments];
    const cable_front_t *release = &path->front[CABLE_PROXIMAL][CABLE_RELEASE][path->segments];
    uint32_t saturations = 0; /* a tension beyond the range is beyond every limit */
    const ratio_t alpha_times_sum = ratio_add(ratio_multiply(pull->tension, release->compliance),
                                              ratio_multiply(release->tension, pull->compliance));
    const ratio_t sum = ratio_add(pull->compliance, release->compliance);
    const int32_t twice_nm =
        fixed_add(path->pretension_stretch_nm, path->pretension_stretch_nm, &saturations);
    const ratio_t per_alpha = ratio_reciprocal(alpha_times_sum);
    const int32_t risen_un =
        fixed_scale(twice_nm, ratio_multiply(release->tension, per_alpha), &saturations);
    const int32_t fallen_un =
        fixed_scale(twice_nm, ratio_multiply(pull->tension, per_alpha), &saturations);
    const ratio_t stiffness = ratio_add(pull->stiffness, release->stiffness);
    const ratio_t unm_per_nm = ratio_multiply(stiffness, transmission->motor_torque_per_force);
    const sliding_factor_t one = {
        .q14 = ONE_Q14,
        .base_q14 = ONE_Q14,
        .fall = pull->tension,
        .rise = release->tension,
        .fall_q24 = (int32_t)FIXED_Q24_ONE,
        .rise_q24 = (int32_t)FIXED_Q24_ONE,
    };
    sliding_t sliding = {
        .factor = {one, one},
        .force_per_load_torque = ratio_reciprocal(transmission->load_torque_per_force),
        .motor_torque_per_force = transmission->motor_torque_per_force,
        .fall = pull->tension,
        .rise = release->tension,
        .inverse_alpha = ratio_multiply(sum, per_alpha),
        .friction_un = fixed_subtract(risen_un, fallen_un, &saturations),
        .slack_b_above_un =
            fixed_scale(twice_nm, ratio_multiply(pull->stiffness, pull->tension), &saturations),
        .slack_a_below_un = -fixed_scale(
            twice_nm, ratio_multiply(release->stiffness, release->tension), &saturations),
        .taut_most_unm = INT32_MAX,
        .taut_least_unm = -INT32_MAX,
        .wrap_q24 = path->wrap_q24,
        .motor_unm_per_rad = fixed_scale((int32_t)transmission->settings.motor_pulley_radius_nm,
                                         unm_per_nm, &saturations),
    };
    if (slack_floor_un > 0) {
        keep_taut(&sliding, pull, release, twice_nm, slack_floor_un);
    }
    return sliding;
}

void sliding_set_factor(sliding_t *sliding, int32_t sign, uint32_t factor_q14) {
    sliding_factor_t *factor = &sliding->factor[sign > 0 ? 1 : 0];
    if (factor->q14 == factor_q14) {
        return;
    }
    factor->q14 = factor_q14;
    const int64_t away_q24 = (int64_t)sliding->wrap_q24 *
                             ((int32_t)factor_q14 - (int32_t)factor->base_q14) / (int32_t)ONE_Q14;
    if (away_q24 < NEAR_Q24 && away_q24 > -NEAR_Q24) { /* exp(x) = 1 + x + x^2/2, within 4e-5 */
        const int32_t x = (int32_t)away_q24;
        const int32_t half_square = (int32_t)((int64_t)x * x / (2 * (int64_t)FIXED_Q24_ONE));
        factor->rise_q24 = (int32_t)FIXED_Q24_ONE + x + half_square;
        factor->fall_q24 = (int32_t)FIXED_Q24_ONE - x + half_square;
        return;
    }
    factor->base_q14 = factor_q14;
    factor->rise_q24 = (int32_t)FIXED_Q24_ONE;
    factor->fall_q24 = (int32_t)FIXED_Q24_ONE;
    const uint32_t wrap_q24 = (uint32_t)((uint64_t)sliding->wrap_q24 * factor_q14 / ONE_Q14);
    const uint32_t most_q24 = CABLE_WRAP_MAX_Q24;
    factor->fall =
        ratio_of(fixed_exp_minus(wrap_q24 < most_q24 ? wrap_q24 : most_q24), FIXED_Q31_ONE);
    factor->rise = ratio_reciprocal(factor->fall);
}

/* Motor force of (S1) to (S3) with a factor on the friction. */
static int32_t with_factor_un(const sliding_t *sliding, const sliding_factor_t *factor,
                              int32_t load_un) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t friction_un =
        fixed_saturate((int64_t)sliding->friction_un * factor->q14 / ONE_Q14, &saturations);
    const int32_t taut_un = fixed_add(fixed_scale(load_un, sliding->inverse_alpha, &saturations),
                                      friction_un, &saturations);
    const bool rises = load_un > 0;
    const int32_t base_un = fixed_scale(load_un, rises ? factor->rise : factor->fall, &saturations);
    const int32_t slack_un = fixed_saturate(
        (int64_t)base_un * (rises ? factor->rise_q24 : factor->fall_q24) / (int32_t)FIXED_Q24_ONE,
        &saturations);
    return taut_un > slack_un ? taut_un : slack_un;
}

int32_t sliding_motor_torque_unm(const sliding_t *sliding, int32_t load_torque_unm, int32_t sign) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t load_un =
        sign * fixed_scale(load_torque_unm, sliding->force_per_load_torque, &saturations);
    const sliding_factor_t *factor = &sliding->factor[sign > 0 ? 1 : 0];
    int32_t motor_un;
    if (factor->q14 != ONE_Q14) {
        motor_un = with_factor_un(sliding, factor, load_un);
    } else if (load_un > sliding->slack_b_above_un) {
        motor_un = fixed_scale(load_un, sliding->rise, &saturations);
    } else if (load_un < sliding->slack_a_below_un) {
        motor_un = fixed_scale(load_un, sliding->fall, &saturations);
    } else {
        motor_un = fixed_add(fixed_scale(load_un, sliding->inverse_alpha, &saturations),
                             sliding->friction_un, &saturations);
    }
    const int32_t motor_unm = fixed_scale(motor_un, sliding->motor_torque_per_force, &saturations);
    return sign * fixed_clamp(motor_unm, sliding->taut_least_unm, sliding->taut_most_unm);
}

/* Where friction / (steep - flat) is, the slopes in Q16: two lines of (S1) to (S3) meet there. */
static int32_t meeting_un(int32_t friction_un, int32_t steep_q16, int32_t flat_q16) {
    uint32_t saturations = 0; /* without friction there is no slope: far away */
    const int32_t slope_q16 = steep_q16 > flat_q16 ? steep_q16 - flat_q16 : 1;
    return fixed_saturate((int64_t)friction_un * ONE_Q16 / slope_q16, &saturations);
}

sliding_t sliding_adapted(const sliding_t *sliding, uint32_t friction_q16,
                          uint32_t pretension_q16) {
    sliding_t other = *sliding;
    if (friction_q16 == ONE_Q16 && pretension_q16 == ONE_Q16) {
        return other;
    }
    uint32_t saturations = 0; /* a tension beyond the range is beyond every limit */
    const bool more = friction_q16 >= ONE_Q16;
    const uint32_t change_q16 = more ? friction_q16 - ONE_Q16 : ONE_Q16 - friction_q16;
    const uint32_t change_q24 = (uint32_t)((uint64_t)sliding->wrap_q24 * change_q16 / ONE_Q16);
    const ratio_t down = ratio_of(fixed_exp_minus(change_q24), FIXED_Q31_ONE);
    const ratio_t up = ratio_reciprocal(down);
    other.fall = ratio_multiply(sliding->fall, more ? down : up);
    other.rise = ratio_multiply(sliding->rise, more ? up : down);
    const uint64_t product_q16 = (uint64_t)friction_q16 * pretension_q16 / ONE_Q16;
    other.friction_un = fixed_saturate(
        (int64_t)sliding->friction_un * (int64_t)product_q16 / ONE_Q16, &saturations);
    const int32_t rise_q16 = fixed_scale(ONE_Q16, other.rise, &saturations);
    const int32_t fall_q16 = fixed_scale(ONE_Q16, other.fall, &saturations);
    const int32_t alpha_q16 = fixed_scale(ONE_Q16, other.inverse_alpha, &saturations);
    other.slack_b_above_un = meeting_un(other.friction_un, rise_q16, alpha_q16);
    other.slack_a_below_un = -meeting_un(other.friction_un, alpha_q16, fall_q16);
    return other;
}

int32_t sliding_slack_halves(const sliding_t *sliding, int32_t load_torque_unm, int32_t sign) {
    uint32_t saturations = 0;
    const int32_t load_un =
        sign * fixed_scale(load_torque_unm, sliding->force_per_load_torque, &saturations);
    const int32_t edge_un = load_un >= 0 ? sliding->slack_b_above_un : sliding->slack_a_below_un;
    const int64_t twice = 2 * (int64_t)(load_un < 0 ? -load_un : load_un);
    const int64_t edge = edge_un < 0 ? -edge_un : edge_un;
    return twice < edge ? 0 : (twice < 2 * edge ? 1 : (twice < 3 * edge ? 2 : 3));
}

int32_t sliding_slack_motor_unm(const sliding_t *sliding) {
    uint32_t saturations = 0; /* never slack is as good */
    const int32_t motor_un = fixed_scale(sliding->slack_b_above_un, sliding->rise, &saturations);
    return fixed_scale(motor_un, sliding->motor_torque_per_force, &saturations);
}

bool sliding_holds_taut(const sliding_t *sliding, int32_t motor_torque_unm, int32_t sign) {
    const int32_t mirrored_unm = sign * motor_torque_unm;
    return mirrored_unm == sliding->taut_most_unm || mirrored_unm == sliding->taut_least_unm;
}
