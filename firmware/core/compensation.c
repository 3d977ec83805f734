/* compensation.c: see compensation.h. */
#include "compensation.h"

#include <stddef.h>

#define PPM 1000000
#define TRUSTED 128 /* confidence below which ever less of the friction is compensated */

static uint32_t q16(uint32_t ppm) {
    return (uint32_t)((uint64_t)ppm * LAW_SHARE_ONE / PPM);
}

void compensation_configure(compensation_t *compensation, const transmission_t *transmission,
                            const compensation_settings_t *settings) {
    const transmission_settings_t *pair = &transmission->settings;
    uint32_t saturations = 0; /* a friction beyond the range is beyond the motor */
    const sliding_t sliding = sliding_of(transmission, settings->slack_floor_un);
    const int32_t friction_motor_unm = sliding_motor_torque_unm(&sliding, 0, 1);
    const ratio_t ratio = ratio_of(pair->load_pulley_radius_nm, pair->motor_pulley_radius_nm);
    const int32_t friction_unm = fixed_scale(friction_motor_unm, ratio, &saturations);
    const ratio_t arc_per_motor_torque =
        ratio_of(pair->motor_pulley_radius_nm,
                 sliding.motor_unm_per_rad > 0 ? (uint32_t)sliding.motor_unm_per_rad : 1u);
    const int32_t windup_nm = fixed_scale(friction_motor_unm, arc_per_motor_torque, &saturations);
    const int32_t coarse_nm = settings->load_count_nm > settings->motor_count_nm
                                  ? settings->load_count_nm
                                  : settings->motor_count_nm;
    *compensation = (compensation_t){
        .settings = *settings,
        .outputs = {.friction_factor_ppm = PPM,
                    .pretension_factor_ppm = PPM,
                    .friction_unm = friction_unm},
        .motor_per_load_torque = ratio_reciprocal(ratio),
        .friction_unm = friction_unm,
        .adaptation = adaptation_of(ratio, friction_unm, settings->ticks_per_s),
        .restored_ppm = {PPM, PPM},
        .share_q16 = q16(settings->friction_share_ppm),
        .configured = sliding,
        .sliding = sliding,
        .estimator = estimator_of(
            settings->ticks_per_s, settings->load_count_nm, windup_nm,
            fixed_add(windup_nm, transmission->path.pretension_stretch_nm / 4, &saturations),
            friction_unm),
        .observer = friction_observer_of(windup_nm / 2, coarse_nm, settings->ticks_per_s,
                                         settings->friction_deviation_ppm),
        .passivity = passivity_of(pair->load_pulley_radius_nm, friction_unm),
        .load_motion = load_motion_of(transmission, &sliding, settings->ticks_per_s),
    };
    estimator_t *estimator = &compensation->estimator;
    estimator->motor_per_load_torque = compensation->motor_per_load_torque;
    /* f alone on (O1) of friction_observer.h: half of what it stretches with g = f */
    estimator->stretch_nm_per_unm = arc_per_motor_torque;
    estimator->stretch_nm_per_unm.shift++;
}

void compensation_configure_laws(compensation_t *compensation, const transmission_t *transmission) {
    const compensation_settings_t *settings = &compensation->settings;
    laws_configure(&compensation->laws, &(law_settings_t){
                                            .transmission = transmission,
                                            .sliding = &compensation->configured,
                                            .friction_unm = compensation->friction_unm,
                                            .torque_limit_unm = settings->torque_limit_unm,
                                            .standstill_band_unm = settings->standstill_band_unm,
                                            .motor_inertia_gmm2 = settings->motor_inertia_gmm2,
                                            .integral_gain_mhz = settings->integral_gain_mhz,
                                            .ticks_per_s = settings->ticks_per_s,
                                        });
}

static void take_adapted(compensation_t *compensation) {
    const adaptation_t *adaptation = &compensation->adaptation;
    compensation->sliding =
        sliding_adapted(&compensation->configured, adaptation_friction_q16(adaptation),
                        adaptation_pretension_q16(adaptation));
    compensation->outputs.friction_factor_ppm = adaptation_friction_ppm(adaptation);
    compensation->outputs.pretension_factor_ppm = adaptation_pretension_ppm(adaptation);
}

void compensation_restore(compensation_t *compensation, uint32_t friction_factor_ppm,
                          uint32_t pretension_factor_ppm) {
    adaptation_t *adaptation = &compensation->adaptation;
    adaptation_set_ppm(adaptation, friction_factor_ppm, pretension_factor_ppm);
    friction_observer_expect(&compensation->observer,
                             (uint32_t)((uint64_t)adaptation_friction_q16(adaptation) *
                                        adaptation_pretension_q16(adaptation) / ADAPTATION_ONE));
    compensation->restored_ppm[0] = friction_factor_ppm;
    compensation->restored_ppm[1] = pretension_factor_ppm;
    take_adapted(compensation);
}

/* The integral law's sum stays: it is all of that law's torque, and follows the model's error from
 * here. Starting at nothing it would drop the friction's share for as long as it took to learn. */
void compensation_reset_learned(compensation_t *compensation) {
    laws_t *laws = &compensation->laws;
    laws->model_inversion.shift_q8_unm[0] = 0;
    laws->model_inversion.shift_q8_unm[1] = 0;
    laws->adaptive_hysteresis.amplitude_unm = laws->adaptive_hysteresis.friction_unm;
    compensation->estimator.correction_q8_unm = 0;
    /* the friction observer stays: it has never seen the cell */
    adaptation_set_ppm(&compensation->adaptation, compensation->restored_ppm[0],
                       compensation->restored_ppm[1]);
    take_adapted(compensation);
}

/* Part of the model's friction to compensate, in Q16. With a load cell all of it, as adapted: the
 * cell corrects the rest. Without one, while the load moves, what the observer is sure of, so that
 * it is not pushed; at standstill what it expects, since a motor within its friction moves nothing
 * at all. Less of it when the model is in doubt. */
static uint32_t friction_share_q16(const compensation_t *compensation, bool cell,
                                   uint32_t back_off_q16) {
    const uint32_t left = LAW_SHARE_ONE - back_off_q16;
    if (cell) {
        return left;
    }
    const bool rests = compensation->estimator.load_direction == 0;
    const uint64_t friction = rests ? friction_observer_mean_q16(&compensation->observer)
                                    : friction_observer_sure_q16(&compensation->observer);
    const uint32_t share = (uint32_t)(friction * compensation->share_q16 / LAW_SHARE_ONE);
    const uint32_t confidence = compensation->estimator.confidence;
    const uint32_t trust = confidence < TRUSTED ? confidence : TRUSTED;
    return (uint32_t)((uint64_t)(share * trust / TRUSTED) * left / LAW_SHARE_ONE);
}

/* 1 or -1: the whole pair slides that way; else 0. */
static int32_t side_of(const estimator_t *estimator) {
    return (estimator->slip == SLIP_STATE_POSITIVE) - (estimator->slip == SLIP_STATE_NEGATIVE);
}

/* Is the friction of the pair observable in this tick? Then the adaptation uses it. */
static void adapt(compensation_t *compensation, const transmission_t *transmission,
                  const compensation_inputs_t *inputs) {
    const int32_t side = side_of(&compensation->estimator);
    const bool slides = side != 0 && compensation->estimator.load_direction == side;
    const bool limited = (compensation->outputs.flags & COMPENSATION_FLAGS_LIMITED) != 0;
    const bool moves = compensation->answer.inertia_unm != 0; /* torque that pulls no cable */
    if (!compensation->settings.adapt || !inputs->load_cell_valid || !slides || limited || moves) {
        return;
    }
    /* well away from where a cable goes slack, which the levels are still off by */
    const sliding_t *sliding = &compensation->sliding;
    const int32_t halves = sliding_slack_halves(sliding, inputs->load_cell_unm, side);
    const bool taut = halves == 0 && transmission->flags == 0;
    const bool slack = halves == 3 && transmission->flags != 0;
    if (!taut && !slack) {
        return;
    }
    uint32_t saturations = 0; /* beyond the range nothing is learned either */
    const int32_t motor_unm = sliding_motor_torque_unm(sliding, inputs->load_cell_unm, side);
    const int32_t model_unm = fixed_subtract(
        fixed_scale(motor_unm, compensation->adaptation.load_per_motor_torque, &saturations),
        inputs->load_cell_unm, &saturations);
    adaptation_step(&compensation->adaptation,
                    &(adaptation_seen_t){
                        .side = side,
                        .cables = slack ? ADAPTATION_SLACK : ADAPTATION_TAUT,
                        .motor_torque_unm = inputs->motor_torque_unm,
                        .load_torque_unm = inputs->load_cell_unm,
                        .model_unm = side * model_unm,
                    });
    take_adapted(compensation);
}

static uint8_t flags_of(const compensation_t *compensation, bool limited, bool owes) {
    uint8_t flags = compensation->answer.flags;
    if (limited) {
        flags |= COMPENSATION_FLAGS_LIMITED;
    }
    if (owes) {
        flags |= COMPENSATION_FLAGS_DAMPED;
    }
    if (compensation->estimator.confidence < TRUSTED) {
        flags |= COMPENSATION_FLAGS_DISAGREES;
    }
    return flags;
}

/* Runs the law, or holds it ready; the motor torque within the motor's limit. */
static void step_laws(compensation_t *compensation, const compensation_inputs_t *inputs,
                      int32_t load_torque_unm, int32_t error_unm) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    compensation_outputs_t *outputs = &compensation->outputs;
    law_answer_t *answer = &compensation->answer;
    const bool active = inputs->active;
    const compensation_law_t running = active ? inputs->law : COMPENSATION_LAW_NONE;
    const uint32_t back_off_q16 = passivity_back_off_q16(&compensation->passivity);
    const law_inputs_t told = {
        .wanted_unm = active ? inputs->wanted_unm : 0,
        .naive_unm =
            fixed_scale(inputs->wanted_unm, compensation->motor_per_load_torque, &saturations),
        .load_torque_unm = load_torque_unm,
        .error_unm = error_unm,
        .cell = inputs->load_cell_valid,
        .limited = (outputs->flags & COMPENSATION_FLAGS_LIMITED) != 0,
        .owes = back_off_q16 > 0,
        .given_pj = compensation->passivity.given,
        .share_q16 = friction_share_q16(compensation, inputs->load_cell_valid, back_off_q16),
        /* without a cell the observer's friction is that of the pair as it is configured */
        .sliding = inputs->load_cell_valid ? &compensation->sliding : &compensation->configured,
        .estimator = &compensation->estimator,
        .load_motion = &compensation->load_motion,
    };
    if (active) {
        *answer = laws_step(&compensation->laws, running, &told);
    } else { /* its flags stay: they are those of the law that is held ready */
        answer->motor_torque_unm = 0;
        answer->inertia_unm = 0;
    }
    const int32_t limit = compensation->settings.torque_limit_unm;
    outputs->motor_torque_unm = fixed_clamp(answer->motor_torque_unm, -limit, limit);
    laws_follow(&compensation->laws, running, outputs->motor_torque_unm, &told);
    const bool cut = outputs->motor_torque_unm != answer->motor_torque_unm;
    outputs->flags = flags_of(compensation, cut, back_off_q16 > 0);
}

/* The factors on the friction, one direction a tick: each takes an exponential. */
static void take_factors(compensation_t *compensation, const uint32_t *friction_q14) {
    if (friction_q14 == NULL) {
        return;
    }
    const int32_t sign = compensation->next_sign > 0 ? 1 : -1;
    compensation->next_sign = -sign;
    const uint32_t factor_q14 = friction_q14[sign > 0 ? 1 : 0];
    sliding_set_factor(&compensation->configured, sign, factor_q14);
    compensation->sliding.factor[sign > 0 ? 1 : 0] =
        compensation->configured.factor[sign > 0 ? 1 : 0];
}

void compensation_step(compensation_t *compensation, transmission_t *transmission,
                       const compensation_inputs_t *inputs) {
    compensation_outputs_t *outputs = &compensation->outputs;
    estimator_t *estimator = &compensation->estimator;
    uint32_t saturations = 0;
    /* what turns the motor's inertia does not pull the cables */
    const int32_t pulls_unm =
        fixed_subtract(inputs->motor_torque_unm, compensation->answer.inertia_unm, &saturations);
    take_factors(compensation, inputs->friction_q14);
    estimator_step(estimator, transmission,
                   &(estimator_inputs_t){
                       .motor_arc_nm = inputs->motor_arc_nm,
                       .load_arc_nm = inputs->load_arc_nm,
                       .motor_torque_unm = pulls_unm,
                       .load_cell_unm = inputs->load_cell_unm,
                       .load_cell_valid = inputs->load_cell_valid,
                       .friction_q14 = inputs->friction_q14,
                   });
    adapt(compensation, transmission, inputs);
    friction_observer_step(&compensation->observer,
                           &(friction_observed_t){
                               .side = side_of(estimator),
                               .slack = transmission->flags != 0,
                               .load_arc_nm = inputs->load_arc_nm,
                               .gap_nm = fixed_subtract(transmission->motor.arc_nm,
                                                        transmission->load.arc_nm, &saturations),
                               .innovation_nm = estimator->innovation_nm,
                           });
    const int32_t load_torque_unm =
        inputs->load_cell_valid ? inputs->load_cell_unm : estimator->load_torque_unm;
    const int32_t error_unm = fixed_subtract(inputs->wanted_unm, load_torque_unm, &saturations);
    const bool runs = inputs->active && inputs->law != COMPENSATION_LAW_NONE;
    passivity_step(&compensation->passivity, inputs->load_arc_nm, runs ? -error_unm : 0);
    /* the model inversion does without it, and needs the tick's time */
    if (inputs->law != COMPENSATION_LAW_MODEL_INVERSION) {
        load_motion_step(&compensation->load_motion, estimator, inputs->load_arc_nm);
    }
    step_laws(compensation, inputs, load_torque_unm, error_unm);
    outputs->friction_unm =
        (int32_t)((int64_t)compensation->friction_unm *
                  friction_observer_mean_q16(&compensation->observer) / FRICTION_OBSERVER_ONE);
    outputs->load_torque_unm = estimator->load_torque_unm;
    outputs->innovation_nm = estimator->innovation_nm;
    outputs->slip = estimator->slip;
    outputs->confidence = estimator->confidence;
    outputs->informed = estimator->informed;
    outputs->energy_uj = passivity_energy_uj(&compensation->passivity);
}
