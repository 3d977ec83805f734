/* law_model_inversion.c: see law_model_inversion.h. */
#include "law_model_inversion.h"

#define LAG_MOST_US 100000       /* a pair so soft has the whole feedback */
#define EXTRA_MOST_UNM (1 << 26) /* in Q4 that is the range of int32_t */

/* Every number of the law. Found on developing seeds of the compensation benchmark unless a source
 * is given; "1/x" divides, "2^-3" counts eighths. The range is where the arithmetic holds. */
static const struct {
    int32_t damping_per_s;   /* 1/s, 1 .. 1000: D / J, below what 2 ms of encoder delay allow */
    int32_t move_damping;    /* 1, 1 .. 10: times that in a move, whose plan knows the speed */
    int32_t late_us;         /* us, 1000 .. 10000: by which the cell's error acts late: the cell by
                                at most 2 ms, the rest is amplifier, tick and the damping's filter */
    int32_t standstill_band; /* 1/x of friction, 1 .. 1000: error left alone at standstill: less
                          than stiction makes it jump */
    int32_t correcting;      /* 1, 1 .. 10: at standstill an error is corrected so much slower,
                                the load cell is late */
    int32_t sure_limit_q3;   /* 2^-3 of the limit, 1 .. 8: friction is known to 15 %, so the motor
                                is sure to turn over this part of its limit */
    int32_t lands_within;    /* 1/x of friction, 1 .. 100: where turning over twice the friction
                                ends, as well as that is known */
    int32_t unlearning;      /* 1, 1 .. 8: so much faster a shift that pushes is taken back; the
                                pair's resonance bounds it, as it bounds force control */
    int32_t felt_part;       /* 1/x of friction, 1 .. 1000: left to be felt while the load moves:
                                covers what the encoders are late by, to the passive side */
    int32_t felt_cell;       /* 1/x of friction, 1 .. 1000: the same with a cell, which takes back
                                what pushes */
} NUMBERS = {
    .damping_per_s = 150,
    .move_damping = 2,
    .late_us = 3000,
    .standstill_band = 32,
    .correcting = 2,
    .sure_limit_q3 = 7,
    .lands_within = 3,
    .unlearning = 3,
    .felt_part = 25,
    .felt_cell = 50,
};

/* Half of the gain with which cell and motor would oscillate, D / (J omega^2 T) of (P1); at most
 * what the model's inverse gives. */
static int32_t feedback_q16(int32_t lag_ticks, uint32_t ticks_per_s) {
    const int64_t lag_us = (int64_t)lag_ticks * 1000000 / ticks_per_s;
    const int64_t limited_us = lag_us < LAG_MOST_US ? lag_us : LAG_MOST_US;
    const int64_t half_q16 = limited_us * limited_us * NUMBERS.damping_per_s * (LAW_SHARE_ONE / 2) /
                             (NUMBERS.late_us * INT64_C(1000000));
    return half_q16 < LAW_SHARE_ONE ? (int32_t)half_q16 : LAW_SHARE_ONE;
}

law_model_inversion_t law_model_inversion_of(const law_settings_t *settings) {
    const transmission_settings_t *pair = &settings->transmission->settings;
    const sliding_t *sliding = settings->sliding;
    const uint32_t ticks_per_s = settings->ticks_per_s;
    const uint32_t inertia = settings->motor_inertia_gmm2 > 0 ? settings->motor_inertia_gmm2 : 1;
    /* omega = sqrt(k / J); uN m and g mm^2 are 1e-6 and 1e-9 */
    const uint64_t stiffness = (uint64_t)(uint32_t)sliding->motor_unm_per_rad;
    const uint32_t omega_rad_per_s = fixed_root(stiffness * 1000u / inertia, 32);
    const uint32_t lag = ticks_per_s / (omega_rad_per_s > 0 ? omega_rad_per_s : 1u);
    const int32_t lag_ticks = (int32_t)(lag > 0 ? lag : 1u);
    uint32_t saturations = 0;
    const ratio_t motor_per_load =
        ratio_of(pair->motor_pulley_radius_nm, pair->load_pulley_radius_nm);
    /* the taut friction at the load: what arrives less when the motor gives as much */
    const int32_t motor_friction_unm = sliding_motor_torque_unm(sliding, 0, 1);
    const int32_t friction_unm =
        fixed_scale(motor_friction_unm, ratio_reciprocal(motor_per_load), &saturations);
    const int64_t limit_unm = settings->torque_limit_unm;
    const uint32_t gain_mhz = settings->integral_gain_mhz;
    const uint32_t per_gain = ticks_per_s * 1000u;
    /* how far the load moves while the friction builds up anew */
    const int32_t stiffness_unm = sliding->motor_unm_per_rad > 0 ? sliding->motor_unm_per_rad : 1;
    const int64_t motor_urad = (int64_t)motor_friction_unm * 1000000 / stiffness_unm;
    const int32_t load_urad =
        fixed_scale(fixed_saturate(motor_urad, &saturations), motor_per_load, &saturations);
    return (law_model_inversion_t){
        .motor_per_load_torque = motor_per_load,
        /* D = J damping_per_s in 1e-9 N m s; a speed of 1 nm a tick is ticks_per_s / r_nm rad/s */
        .damping = ratio_of((uint64_t)inertia * (uint32_t)NUMBERS.damping_per_s * ticks_per_s,
                            (uint64_t)pair->motor_pulley_radius_nm * 1000u),
        /* 8/6 of the friction is still in range */
        .slip = slip_direction_of(lag_ticks, fixed_clamp(friction_unm, 0, 1 << 30), load_urad,
                                  settings->standstill_band_unm),
        .feedback_q16 = feedback_q16(lag_ticks, ticks_per_s),
        .felt_unm = {settings->friction_unm / NUMBERS.felt_part,
                     settings->friction_unm / NUMBERS.felt_cell},
        .standstill_band_unm = settings->standstill_band_unm,
        .weak = motor_friction_unm > limit_unm * NUMBERS.sure_limit_q3 / 8,
        .move = move_of(lag_ticks, settings->torque_limit_unm,
                        NUMBERS.move_damping * NUMBERS.damping_per_s, ticks_per_s),
        .integral_ticks = gain_mhz > 0 ? (int32_t)(per_gain / gain_mhz) + 1 : 0,
    };
}

void law_model_inversion_follow(law_model_inversion_t *law, int32_t motor_torque_unm,
                                const law_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t plain_unm =
        fixed_scale(inputs->wanted_unm, law->motor_per_load_torque, &saturations);
    const int32_t extra_unm = fixed_subtract(motor_torque_unm, plain_unm, &saturations);
    const int32_t limited_unm = fixed_clamp(extra_unm, -EXTRA_MOST_UNM, EXTRA_MOST_UNM);
    law->lag_q4_unm[0] = limited_unm * 16;
    law->lag_q4_unm[1] = limited_unm * 16;
    slip_direction_lose(&law->slip);
    law->declined = false;
    law->held_unm = motor_torque_unm;
    law->last_wanted_unm = inputs->wanted_unm;
    move_end(&law->move);
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

/* Does the set point change at once? Not where the motor might bring it but never take it back. */
static bool set_point_changes(law_model_inversion_t *law, int32_t wanted_unm, int32_t error_unm,
                              int32_t motion) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t jump_unm = fixed_subtract(wanted_unm, law->last_wanted_unm, &saturations);
    const bool jumps = magnitude(jump_unm) > law->standstill_band_unm;
    law->last_wanted_unm = wanted_unm;
    if (motion != 0) {
        law->declined = false;
    } else if (jumps) {
        law->declined =
            law->weak && magnitude(error_unm) <= law->slip.friction_unm / NUMBERS.lands_within;
    }
    return jumps && !law->declined;
}

/* Takes the load cell's error up into the shift of this direction. What pushes the load the way it
 * goes is taken back sooner than what it lacks is added: it has to be paid for. */
static void learn(law_model_inversion_t *law, int32_t error_unm, int32_t motion, bool limited) {
    const int32_t known = law->slip.direction > 0 ? error_unm : -error_unm;
    const int32_t towards = law->slip.direction == 0 ? magnitude(error_unm) : known;
    const bool turned = slip_direction_has_turned(&law->slip);
    const bool useful = motion == law->slip.direction || towards > 0;
    if (law->integral_ticks == 0 || law->declined || !turned || !useful || law->resting ||
        (limited && towards > 0)) {
        return;
    }
    uint32_t saturations = 0; /* the most is far below */
    const int32_t most_q8 = fixed_clamp(law->slip.friction_unm, 0, 1 << 22) * 256;
    const bool pushes = motion == law->slip.direction && towards < 0;
    const int32_t step_q8 = fixed_clamp(error_unm, -(1 << 22), 1 << 22) * 256 /
                            law->integral_ticks * (pushes ? NUMBERS.unlearning : 1);
    for (int32_t sign = -1; sign <= 1; sign += 2) {
        if (law->slip.direction == 0 ||
            law->slip.direction == sign) { /* unknown: it may be either */
            int32_t *shift = &law->shift_q8_unm[sign > 0 ? 1 : 0];
            *shift = fixed_clamp(fixed_add(*shift, step_q8, &saturations), -most_q8, most_q8);
        }
    }
}

/* Force feedback (P1): what the cell's error calls for at once, whatever the model says. An error
 * beyond the friction is no friction's: a set point has changed, and the motor is on its way. */
static int32_t feedback_unm(const law_model_inversion_t *law, int32_t error_unm) {
    uint32_t saturations = 0; /* clamped below the range */
    const int32_t most_unm = law->slip.friction_unm;
    const int32_t motor_unm = fixed_scale(fixed_clamp(error_unm, -most_unm, most_unm),
                                          law->motor_per_load_torque, &saturations);
    return (int32_t)((int64_t)motor_unm * law->feedback_q16 / LAW_SHARE_ONE);
}

/* The motor torque at which the pair holds `extra_unm` more than the plain one: at once by a move
 * when one has begun, else along two lags. `enough`: friction holds what is there. */
static int32_t go_over(law_model_inversion_t *law, int32_t plain_unm, int32_t extra_unm,
                       int32_t damping_unm, bool enough, int32_t slower) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    int32_t *lag = law->lag_q4_unm;
    if (move_runs(&law->move)) {
        const int32_t to_unm = fixed_add(plain_unm, extra_unm, &saturations);
        const int32_t moving_unm = move_step(&law->move, to_unm);
        law->held_unm = move_static_unm(&law->move);
        const int32_t held_extra_unm = fixed_subtract(law->held_unm, plain_unm, &saturations);
        lag[0] = fixed_clamp(held_extra_unm, -EXTRA_MOST_UNM, EXTRA_MOST_UNM) * 16;
        lag[1] = lag[0];
        return fixed_subtract(moving_unm, NUMBERS.move_damping * damping_unm, &saturations);
    }
    move_end(&law->move);
    if (enough) {
        lag[0] = lag[1];
    } else {
        lag[0] += (extra_unm * 16 - lag[0]) / (slower * law->slip.lag_ticks);
        lag[1] += (lag[0] - lag[1]) / (slower * law->slip.lag_ticks);
    }
    law->held_unm = fixed_add(plain_unm, lag[1] / 16, &saturations);
    return fixed_subtract(law->held_unm, damping_unm, &saturations);
}

static int32_t slowed(const law_model_inversion_t *law, bool feels_its_way) {
    const int32_t corrects = feels_its_way && law->slip.back_off > 0 ? NUMBERS.correcting - 1 : 0;
    return 1 + (corrects > law->slip.late ? corrects : law->slip.late);
}

static law_answer_t answer_of(const law_model_inversion_t *law, int32_t motor_torque_unm) {
    uint8_t flags = 0;
    if (law->resting) {
        flags |= COMPENSATION_FLAGS_RESTING;
    }
    if (law->held_taut) {
        flags |= COMPENSATION_FLAGS_HELD_TAUT;
    }
    return (law_answer_t){
        .motor_torque_unm = motor_torque_unm, .inertia_unm = law->move.inertia_unm, .flags = flags};
}

law_answer_t law_model_inversion_step(law_model_inversion_t *law, const law_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const estimator_t *estimator = inputs->estimator;
    const sliding_t *sliding = inputs->sliding;
    const int32_t motion = estimator->load_direction;
    const int32_t wanted_unm = fixed_subtract(
        inputs->wanted_unm, motion * law->felt_unm[inputs->cell ? 1 : 0], &saturations);
    const int32_t error_unm = fixed_subtract(wanted_unm, inputs->load_torque_unm, &saturations);
    const bool changed = set_point_changes(law, inputs->wanted_unm, error_unm, motion);
    if (changed) {
        slip_direction_call(&law->slip, inputs, wanted_unm, error_unm);
    }
    const bool turned =
        slip_direction_step(&law->slip, inputs, wanted_unm, error_unm, law->declined);
    const int32_t left_alone_unm =
        (law->standstill_band_unm + law->slip.friction_unm / NUMBERS.standstill_band)
        << law->slip.back_off;
    law->resting = motion == 0 && magnitude(error_unm) <= left_alone_unm;
    if (inputs->cell) {
        learn(law, error_unm, motion, inputs->limited);
    }
    const int32_t direction = law->slip.direction;
    const int32_t shift_unm = law->shift_q8_unm[direction > 0 ? 1 : 0] / 256;
    const int32_t aim_unm = fixed_add(wanted_unm, shift_unm, &saturations);
    const int32_t plain_unm = fixed_scale(wanted_unm, law->motor_per_load_torque, &saturations);
    const int32_t full_unm = sliding_motor_torque_unm(sliding, aim_unm, direction);
    law->held_taut = sliding_holds_taut(sliding, full_unm, direction);
    const int64_t extra_unm =
        ((int64_t)full_unm - plain_unm) * (int64_t)inputs->share_q16 / LAW_SHARE_ONE;
    const int32_t target_unm =
        law->slip.phase == SLIP_PHASE_UNKNOWN
            ? law->lag_q4_unm[0] / 16
            : fixed_clamp((int32_t)extra_unm, -EXTRA_MOST_UNM, EXTRA_MOST_UNM);
    if (changed || turned) {
        move_start(&law->move, law->held_unm, fixed_add(plain_unm, target_unm, &saturations),
                   sliding_slack_motor_unm(sliding));
    }
    const bool arrived = inputs->cell && direction * fixed_clamp(error_unm, -1, 1) <= 0;
    const bool more = direction * (target_unm - law->lag_q4_unm[1] / 16) > 0;
    const bool enough =
        arrived && (motion == 0 || (motion == direction && more && !move_runs(&law->move)));
    const int32_t damping_unm =
        fixed_clamp(fixed_scale(estimator->gap_speed_nm, law->damping, &saturations),
                    -EXTRA_MOST_UNM, EXTRA_MOST_UNM);
    const int32_t goes_unm = go_over(law, plain_unm, target_unm, damping_unm, enough,
                                     slowed(law, inputs->cell && motion == 0));
    const bool feeds_back = inputs->cell && !law->resting && !law->declined;
    const int32_t corrects_unm = feeds_back ? feedback_unm(law, error_unm) : 0;
    return answer_of(law, fixed_add(goes_unm, corrects_unm, &saturations));
}
