/* sliding.c: see sliding.h. */
#include "sliding.h"

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
    sliding_t sliding = {
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
        .motor_unm_per_rad = fixed_scale((int32_t)transmission->settings.motor_pulley_radius_nm,
                                         unm_per_nm, &saturations),
    };
    if (slack_floor_un > 0) {
        keep_taut(&sliding, pull, release, twice_nm, slack_floor_un);
    }
    return sliding;
}

int32_t sliding_motor_torque_unm(const sliding_t *sliding, int32_t load_torque_unm, int32_t sign) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t load_un =
        sign * fixed_scale(load_torque_unm, sliding->force_per_load_torque, &saturations);
    int32_t motor_un;
    if (load_un > sliding->slack_b_above_un) {
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

bool sliding_holds_taut(const sliding_t *sliding, int32_t motor_torque_unm, int32_t sign) {
    const int32_t mirrored_unm = sign * motor_torque_unm;
    return mirrored_unm == sliding->taut_most_unm || mirrored_unm == sliding->taut_least_unm;
}
