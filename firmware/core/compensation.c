/* compensation.c: see compensation.h. */
#include "compensation.h"

void compensation_configure(compensation_t *compensation, const transmission_t *transmission,
                            const compensation_settings_t *settings) {
    const transmission_settings_t *pair = &transmission->settings;
    *compensation = (compensation_t){
        .settings = *settings,
        .outputs = {.friction_factor_ppm = 1000000},
        .motor_per_load_torque =
            ratio_of(pair->motor_pulley_radius_nm, pair->load_pulley_radius_nm),
    };
}

void compensation_restore(compensation_t *compensation, uint32_t friction_factor_ppm) {
    compensation->outputs.friction_factor_ppm = friction_factor_ppm;
}

void compensation_step(compensation_t *compensation, transmission_t *transmission,
                       const compensation_inputs_t *inputs) {
    compensation_outputs_t *outputs = &compensation->outputs;
    uint32_t *saturations = &transmission->saturations;
    transmission_step_torque(transmission, inputs->motor_torque_unm, inputs->load_arc_nm);
    outputs->load_torque_unm = transmission_load_torque_unm(transmission);
    outputs->innovation_nm =
        fixed_subtract(inputs->motor_arc_nm, transmission->motor.arc_nm, saturations);
    const int32_t wanted =
        inputs->active
            ? fixed_scale(inputs->wanted_unm, compensation->motor_per_load_torque, saturations)
            : 0;
    const int32_t limit = compensation->settings.torque_limit_unm;
    outputs->motor_torque_unm = fixed_clamp(wanted, -limit, limit);
    outputs->flags = outputs->motor_torque_unm != wanted ? COMPENSATION_LIMITED : 0;
}
