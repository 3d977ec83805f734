/* rendering.c: see rendering.h. */
#include "rendering.h"

#include <stddef.h>

#include "parameters.h"

#define I24_MAX 8388607

void rendering_configure(rendering_t *rendering, const dictionary_t *dictionary,
                         const transmission_t *transmission, bool model_configured) {
    *rendering = (rendering_t){
        .law = (compensation_law_t)dictionary->compensation_law,
        .load_per_motor_torque =
            ratio_of(dictionary->load_pulley_radius_nm, dictionary->motor_pulley_radius_nm),
    };
    if (rendering->law != COMPENSATION_LAW_NONE && model_configured) {
        const compensation_settings_t settings = parameters_compensation(dictionary);
        compensation_configure(&rendering->compensation, transmission, &settings);
    }
}

void rendering_start(rendering_t *rendering, const dictionary_t *dictionary,
                     const transmission_t *transmission, bool model_configured) {
    rendering->model_runs = model_configured;
    if (rendering->law == COMPENSATION_LAW_NONE) {
        return;
    }
    const fallback_settings_t fallback = parameters_fallback(dictionary, !model_configured);
    fallback_start(&rendering->fallback, &fallback);
    if (model_configured) {
        compensation_configure_laws(&rendering->compensation, transmission);
        compensation_restore(&rendering->compensation, dictionary->adapted_friction_factor_ppm,
                             dictionary->adapted_pretension_factor_ppm);
    }
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

/* The error of a usable model: with friction that is wrong by 15 % and effects that it lacks it
 * stays within half of what the cables carry and of the friction in them. The model starts with
 * virgin cables. What the true ones may hold of an earlier motion is the friction more, until the
 * pair has slid both ways. */
static int32_t torque_margin_unm(const compensation_outputs_t *outputs, int32_t torque_unm) {
    uint32_t saturations = 0; /* a margin of 2 kN m is as good as none */
    const int32_t friction_unm = magnitude(outputs->friction_unm);
    const int32_t held_unm = outputs->informed ? 0 : friction_unm;
    return fixed_add(held_unm, friction_unm / 2 + magnitude(torque_unm) / 2, &saturations);
}

/* The same for the place of the motor: the stretch of the pretension, and half of what the motor's
 * force pulls out of a cable. */
static int32_t arc_margin_nm(const transmission_t *transmission, int32_t motor_torque_unm) {
    uint32_t saturations = 0; /* a margin of 2 m is as good as none */
    const cable_path_t *path = &transmission->path;
    const ratio_t compliance = path->front[CABLE_PROXIMAL][CABLE_PULL][path->segments].compliance;
    const int32_t force_un = fixed_scale(magnitude(motor_torque_unm),
                                         transmission->force_per_motor_torque, &saturations);
    return fixed_add(path->pretension_stretch_nm,
                     fixed_scale(force_un, compliance, &saturations) / 2, &saturations);
}

/* What the fallback checks: this tick's measurements against what the model made of the last
 * one's, in which the load cell has no part. */
static fallback_found_t found_now(rendering_t *rendering, transmission_t *transmission,
                                  const rendering_inputs_t *inputs) {
    const compensation_outputs_t *outputs = &rendering->compensation.outputs;
    const bool saturates = transmission->saturations != rendering->saturations_seen;
    rendering->saturations_seen = transmission->saturations;
    const int32_t model_unm = transmission_load_torque_unm(transmission);
    return (fallback_found_t){
        .cell_broken = inputs->load_cell_broken,
        .cell_end_of_range = inputs->load_cell_saturated,
        .cell_counts = inputs->load_cell_counts,
        .cell_torque_unm = inputs->load_cell_unm,
        .model_torque_unm = model_unm,
        .model_margin_unm = torque_margin_unm(outputs, model_unm),
        .innovation_nm = outputs->innovation_nm,
        .innovation_margin_nm = arc_margin_nm(transmission, inputs->motor_torque_unm),
        .model_saturates = saturates,
    };
}

static compensation_law_t law_on(compensation_level_t level, compensation_law_t configured) {
    switch (level) {
    case COMPENSATION_LEVEL_WITH_CELL:
    case COMPENSATION_LEVEL_WITHOUT_CELL:
        return configured;
    case COMPENSATION_LEVEL_COULOMB:
        return COMPENSATION_LAW_COULOMB;
    case COMPENSATION_LEVEL_NONE:
    default:
        return COMPENSATION_LAW_NONE;
    }
}

/* Of a sum by direction, that of the load's last motion; before any the mean. */
static int32_t by_direction(const rendering_t *rendering, const int32_t sums[2]) {
    if (rendering->direction == 0) {
        return sums[0] / 2 + sums[1] / 2;
    }
    return sums[rendering->direction > 0 ? 1 : 0];
}

/* The inputs as they act on the cables' ends. */
static rendering_inputs_t at_the_cables(rendering_t *rendering, const rendering_inputs_t *inputs,
                                        int32_t motor_extra_unm) {
    uint32_t saturations = 0; /* torques are far from the range */
    rendering_inputs_t felt = *inputs;
    felt.motor_torque_unm = fixed_add(inputs->motor_torque_unm, motor_extra_unm, &saturations);
    felt.load_cell_unm =
        fixed_subtract(inputs->load_cell_unm, rendering->load_extra_unm, &saturations);
    return felt;
}

/* The motor torque with which the cables receive `torque_unm`. */
static int32_t told_to_motor_unm(const tables_t *tables, int32_t torque_unm,
                                 int32_t motor_extra_unm) {
    uint32_t saturations = 0; /* torques are far from the range */
    const int32_t left_unm = fixed_subtract(torque_unm, motor_extra_unm, &saturations);
    return fixed_saturate((int64_t)left_unm * tables->motor_inverse_q20 / TABLES_GAIN_ONE,
                          &saturations);
}

static int32_t rendered_unm(rendering_t *rendering, transmission_t *transmission,
                            const rendering_inputs_t *inputs) {
    fallback_t *fallback = &rendering->fallback;
    uint32_t saturations = 0; /* torques are far from the range */
    const tables_t *tables = inputs->tables;
    const fallback_found_t found = found_now(rendering, transmission, inputs);
    const bool changed = fallback_step(fallback, &found);
    if (fallback->used_wrong_cell) {
        compensation_reset_learned(&rendering->compensation);
    }
    compensation_step(
        &rendering->compensation, transmission,
        &(compensation_inputs_t){
            .law = law_on(fallback->level, rendering->law),
            .active = inputs->active,
            .load_cell_valid = fallback->level == COMPENSATION_LEVEL_WITH_CELL,
            .wanted_unm =
                fixed_subtract(rendering->wanted_unm, rendering->load_extra_unm, &saturations),
            .motor_arc_nm = inputs->motor_arc_nm,
            .load_arc_nm = inputs->load_arc_nm,
            .motor_torque_unm = inputs->motor_torque_unm,
            .load_cell_unm = fallback_plausible_unm(fallback, &found),
            .friction_q14 = tables != NULL && tables->has_friction ? tables->friction_q14 : NULL,
        });
    if (!inputs->active) {
        fallback_idle(fallback);
        return inputs->asked_unm;
    }
    const int32_t direction = rendering->compensation.estimator.load_direction;
    rendering->direction = direction != 0 ? direction : rendering->direction;
    const int32_t torque_unm = fallback->level == COMPENSATION_LEVEL_NONE
                                   ? inputs->asked_unm
                                   : rendering->compensation.outputs.motor_torque_unm;
    return fallback_blend(fallback, torque_unm, changed);
}

int32_t rendering_step(rendering_t *rendering, transmission_t *transmission,
                       const rendering_inputs_t *inputs) {
    uint32_t saturations = 0; /* beyond the range of int32_t the motor's limit holds anyway */
    rendering->active = inputs->active;
    rendering->wanted_unm =
        fixed_scale(inputs->asked_unm, rendering->load_per_motor_torque, &saturations);
    if (!rendering->model_runs) {
        return inputs->asked_unm;
    }
    if (rendering->law == COMPENSATION_LAW_NONE) {
        transmission_step_torque(transmission, inputs->motor_torque_unm, inputs->load_arc_nm);
        return inputs->asked_unm;
    }
    const tables_t *tables = inputs->tables;
    if (tables == NULL) {
        return rendered_unm(rendering, transmission, inputs);
    }
    rendering->load_extra_unm = by_direction(rendering, tables->now.load_torque_unm);
    const int32_t motor_extra_unm = by_direction(rendering, tables->now.motor_torque_unm);
    const rendering_inputs_t felt = at_the_cables(rendering, inputs, motor_extra_unm);
    const int32_t torque_unm = rendered_unm(rendering, transmission, &felt);
    const bool compensates = inputs->active && rendering->fallback.level != COMPENSATION_LEVEL_NONE;
    return compensates ? told_to_motor_unm(tables, torque_unm, motor_extra_unm) : torque_unm;
}

bool rendering_publish(const rendering_t *rendering, dictionary_t *dictionary) {
    dictionary->wanted_load_torque_unm = fixed_clamp(rendering->wanted_unm, -I24_MAX, I24_MAX);
    if (rendering->law == COMPENSATION_LAW_NONE) {
        const bool news = dictionary->compensation_fallback != 0;
        dictionary->estimated_load_torque_unm =
            fixed_clamp(dictionary->model_load_torque_unm, -I24_MAX, I24_MAX);
        dictionary->compensation_active_law = COMPENSATION_LAW_NONE;
        dictionary->compensation_level = COMPENSATION_LEVEL_NONE;
        dictionary->compensation_fallback = 0;
        return news;
    }
    const compensation_outputs_t *outputs = &rendering->compensation.outputs;
    const fallback_t *fallback = &rendering->fallback;
    dictionary->estimated_load_torque_unm =
        fixed_clamp(outputs->load_torque_unm + rendering->load_extra_unm, -I24_MAX, I24_MAX);
    dictionary->estimate_confidence = outputs->confidence;
    dictionary->slip_state = (uint8_t)outputs->slip;
    dictionary->compensation_flags = outputs->flags;
    dictionary->rendered_energy_uj = outputs->energy_uj;
    dictionary->model_friction_torque_unm = outputs->friction_unm;
    dictionary->motor_innovation_nm = outputs->innovation_nm;
    /* At standstill the entry is the host's to write, and this has to wait. */
    if (dictionary->adaptation_enabled != 0 && rendering->model_runs && rendering->active) {
        dictionary->adapted_friction_factor_ppm = outputs->friction_factor_ppm;
        dictionary->adapted_pretension_factor_ppm = outputs->pretension_factor_ppm;
    }
    dictionary->compensation_active_law = (uint8_t)law_on(fallback->level, rendering->law);
    dictionary->compensation_level = (uint8_t)fallback->level;
    const bool news = dictionary->compensation_fallback != fallback->causes;
    dictionary->compensation_fallback = fallback->causes;
    return news;
}
