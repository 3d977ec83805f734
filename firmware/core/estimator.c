/* estimator.c: see estimator.h. Divisions by constants only; they round towards zero, so a mirrored
 * motion gives mirrored results. */
#include "estimator.h"

#include <stddef.h>

#define DIRECTION_COUNTS 3     /* travel of the load that makes a direction ... */
#define DIRECTION_FORGOTTEN 50 /* ... which is forgotten 1/50 s after the last such travel */
#define GAP_SPEED_TICKS 8      /* time constant; an encoder count spread over 2 ms */
#define CORRECTION_TICKS 32    /* time constant of the load cell's correction, 8 ms */
#define SANE_PART 4            /* of the stretch: stiffness that the model is wrong by, and more */
#define DOUBT_TICKS 512        /* the turn of the motor at a reversal is no reason for doubt */

estimator_t estimator_of(uint32_t ticks_per_s, int32_t load_count_nm, int32_t windup_nm,
                         int32_t tolerance_nm, int32_t tolerance_unm) {
    return (estimator_t){
        .ticks_per_s = ticks_per_s,
        .load_count_nm = load_count_nm,
        .load = load_tracker_of(ticks_per_s, load_count_nm),
        .windup_nm = windup_nm > 0 ? windup_nm : 1,
        .doubt_per_nm = ratio_of(128, tolerance_nm > 0 ? (uint32_t)tolerance_nm : 1u),
        .doubt_per_unm = ratio_of(128, tolerance_unm > 0 ? (uint32_t)tolerance_unm : 1u),
        .confidence = 255,
    };
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

static void follow_direction(estimator_t *estimator, int32_t load_arc_nm) {
    uint32_t saturations = 0; /* the travel since the mark is small */
    const int32_t travel_nm = fixed_subtract(load_arc_nm, estimator->mark_nm, &saturations);
    if (magnitude(travel_nm) >= DIRECTION_COUNTS * estimator->load_count_nm) {
        estimator->load_direction = travel_nm > 0 ? 1 : -1;
    } else if (++estimator->mark_age <= estimator->ticks_per_s / DIRECTION_FORGOTTEN) {
        return;
    } else {
        estimator->load_direction = 0;
    }
    estimator->mark_nm = load_arc_nm;
    estimator->mark_age = 0;
}

/* A single count is too few for a direction of motion, which dither would change, but enough to say
 * which way a load that is not at a standstill goes. */
static void follow_creep(estimator_t *estimator, int32_t step_nm) {
    const int32_t step = (step_nm > 0) - (step_nm < 0);
    if (step != 0) {
        estimator->creep_direction = step;
        estimator->creep_age = 0;
    } else if (++estimator->creep_age > estimator->ticks_per_s / DIRECTION_FORGOTTEN) {
        estimator->creep_direction = 0;
    }
}

static void follow_gap(estimator_t *estimator, const estimator_inputs_t *inputs) {
    uint32_t saturations = 0; /* cables do not stretch by metres */
    const int32_t gap_nm = fixed_subtract(inputs->motor_arc_nm, inputs->load_arc_nm, &saturations);
    const int32_t step_nm = fixed_clamp(
        fixed_subtract(gap_nm, estimator->last_gap_nm, &saturations), -(1 << 22), 1 << 22);
    estimator->last_gap_nm = gap_nm;
    estimator->gap_speed_q8_nm += (step_nm * 256 - estimator->gap_speed_q8_nm) / GAP_SPEED_TICKS;
    estimator->gap_speed_nm = estimator->gap_speed_q8_nm / 256;
}

static slip_state_t slip_of(const transmission_t *transmission) {
    const cable_t *a = &transmission->a;
    const cable_t *b = &transmission->b;
    const bool a_slides = a->motion == CABLE_MASS;
    const bool b_slides = b->motion == CABLE_MASS;
    if (!(a_slides || a->motion == CABLE_SLACK) || !(b_slides || b->motion == CABLE_SLACK) ||
        !(a_slides || b_slides)) {
        return SLIP_STATE_STUCK;
    }
    const cable_direction_t a_would =
        a_slides ? a->end[CABLE_PROXIMAL].direction
                 : (b->end[CABLE_PROXIMAL].direction == CABLE_PULL ? CABLE_RELEASE : CABLE_PULL);
    return a_would == CABLE_PULL ? SLIP_STATE_POSITIVE : SLIP_STATE_NEGATIVE;
}

static int32_t doubt(int32_t disagreement, ratio_t doubt_per_unit) {
    uint32_t saturations = 0; /* beyond the range there is no confidence left */
    const int32_t size = fixed_clamp(disagreement, -INT32_MAX, INT32_MAX);
    return fixed_clamp(fixed_scale(magnitude(size), doubt_per_unit, &saturations), 0, 255);
}

#define ONE_Q14 16384u
#define CARRIED_TICKS 4 /* keeps the loop through the model stable down to a factor of 1/8 */

/* The torque that the model takes for the true one. */
static int32_t torque_for_model(const estimator_t *estimator, const estimator_inputs_t *inputs) {
    const int32_t torque_unm = inputs->motor_torque_unm;
    uint32_t saturations = 0; /* torques are far from the range */
    if (inputs->friction_q14 == NULL) {
        return torque_unm;
    }
    const int32_t taken_unm = fixed_subtract(torque_unm, estimator->carried_unm, &saturations);
    const uint32_t factor_q14 = inputs->friction_q14[taken_unm > 0 ? 1 : 0];
    if (factor_q14 == ONE_Q14 || factor_q14 == 0) {
        return torque_unm;
    }
    const int64_t inverse_q14 = ONE_Q14 * ONE_Q14 / factor_q14;
    const int32_t by_model_unm =
        fixed_saturate(taken_unm * inverse_q14 / (int32_t)ONE_Q14, &saturations);
    return fixed_add(estimator->carried_unm, by_model_unm, &saturations);
}

static void follow_carried(estimator_t *estimator, int32_t model_unm) {
    uint32_t saturations = 0; /* torques are far from the range */
    const int32_t arrives_unm =
        fixed_scale(model_unm, estimator->motor_per_load_torque, &saturations);
    estimator->carried_unm += (arrives_unm - estimator->carried_unm) / CARRIED_TICKS;
}

void estimator_step(estimator_t *estimator, transmission_t *transmission,
                    const estimator_inputs_t *inputs) {
    uint32_t *saturations = &transmission->saturations;
    uint32_t ignored = 0; /* a motor without cables may turn for ever */
    if (!estimator->started) {
        estimator->started = true;
        estimator->mark_nm = inputs->load_arc_nm;
        estimator->last_load_nm = inputs->load_arc_nm;
        estimator->last_gap_nm =
            fixed_subtract(inputs->motor_arc_nm, inputs->load_arc_nm, &ignored);
    }
    const int32_t torque_unm = torque_for_model(estimator, inputs);
    const int32_t extra_unm = fixed_subtract(inputs->motor_torque_unm, torque_unm, &ignored);
    transmission_step_torque(transmission, torque_unm, inputs->load_arc_nm);
    follow_direction(estimator, inputs->load_arc_nm);
    const int32_t load_step_nm =
        fixed_subtract(inputs->load_arc_nm, estimator->last_load_nm, &ignored);
    estimator->last_load_nm = inputs->load_arc_nm;
    follow_creep(estimator, load_step_nm);
    load_tracker_step(&estimator->load, load_step_nm);
    follow_gap(estimator, inputs);
    estimator->slip = slip_of(transmission);
    estimator->slid[estimator->slip] = true;
    estimator->informed =
        estimator->slid[SLIP_STATE_POSITIVE] && estimator->slid[SLIP_STATE_NEGATIVE];
    estimator->innovation_nm =
        fixed_subtract(inputs->motor_arc_nm, transmission->motor.arc_nm, &ignored);
    if (extra_unm != 0) {
        estimator->innovation_nm = fixed_subtract(
            estimator->innovation_nm,
            fixed_scale(extra_unm, estimator->stretch_nm_per_unm, &ignored), &ignored);
    }
    const int32_t model_unm = transmission_load_torque_unm(transmission);
    if (inputs->friction_q14 != NULL) {
        follow_carried(estimator, model_unm);
    }
    const int32_t gap_nm =
        fixed_subtract(transmission->motor.arc_nm, transmission->load.arc_nm, &ignored);
    const int32_t off_nm = magnitude(estimator->innovation_nm) - magnitude(gap_nm) / SANE_PART;
    int32_t doubted = off_nm > 0 ? doubt(off_nm, estimator->doubt_per_nm) : 0;
    if (inputs->load_cell_valid) {
        const int32_t error_unm = fixed_subtract(inputs->load_cell_unm, model_unm, saturations);
        const int32_t limited_unm = fixed_clamp(error_unm, -(1 << 22), 1 << 22);
        estimator->correction_q8_unm +=
            (limited_unm * 256 - estimator->correction_q8_unm) / CORRECTION_TICKS;
        const int32_t by_cell = doubt(error_unm, estimator->doubt_per_unm);
        doubted = by_cell > doubted ? by_cell : doubted;
    } else {
        estimator->correction_q8_unm -= estimator->correction_q8_unm / DOUBT_TICKS;
    }
    estimator->load_torque_unm =
        fixed_add(model_unm, estimator->correction_q8_unm / 256, saturations);
    estimator->doubt_q8 += (doubted * 256 * 16 - estimator->doubt_q8) / DOUBT_TICKS;
    estimator->confidence = (uint8_t)(255 - estimator->doubt_q8 / (256 * 16));
}
