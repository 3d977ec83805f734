/* law_model_inversion.c: see law_model_inversion.h. */
#include "law_model_inversion.h"

#define EXTRA_MOST_UNM (1 << 26) /* in Q4 that is the range of int32_t */

/* Every number of the law. Found on developing seeds of the compensation benchmark unless a source
 * is given; "1/x" divides, "2^-3" counts eighths. The range is where the arithmetic holds. */
static const struct {
    int32_t damping_per_s;  /* 1/s, 0 .. 1000: D / J, below what 2 ms of encoder delay allow */
    int32_t move_damping;   /* 1, 1 .. 10: times that in a move, whose plan knows the speed */
    uint32_t turned_lags;   /* lags, 1 .. 1000: a change of direction has turned the friction
                               over; settled at standstill after twice this */
    int32_t direction_band; /* 1/x of friction, 1 .. 100: error that changes the direction */
    int32_t rest_band;      /* 1/x of friction, 1 .. 1000: error left alone at standstill: less
                               than stiction makes it jump */
    uint32_t strokes_per_s; /* 1/s, 1 .. 1000: no operator turns around faster */
    uint32_t halving_lags;  /* lags, 1 .. 1000: each halves the band of a direction that stays */
    int32_t correcting;     /* 1, 1 .. 10: at standstill an error is corrected so much slower,
                               the load cell is late */
    int32_t back_part;      /* 1/x of windup, 1 .. 100: a load that comes back so far is moved
                               by the operator */
    uint32_t back_off_most; /* 2^x, 0 .. 8: 4/3 of the friction; a load that is moved back makes
                               twice that */
    int32_t thrown_part;    /* 1/x of friction times backlash, 1 .. 100: what a load is given in a
                               change of direction when friction builds up late */
    int32_t late_windup_q3; /* 2^-3 of windup, 1 .. 64: lead of the motor over the model then;
                               stiffness that is off makes less */
    int32_t late_most;      /* 1, 0 .. 10: so many late changes slow the later ones down */
    int32_t sure_limit_q3;  /* 2^-3 of the limit, 1 .. 8: friction is known to 15 %, so the motor
                               is sure to turn over this part of its limit */
    int32_t lands_within;   /* 1/x of friction, 1 .. 100: where turning over twice the friction
                               ends, as well as that is known */
    int32_t felt_part;      /* 1/x of friction, 1 .. 1000: left to be felt while the load moves:
                               covers what encoders and cell are late by, to the passive side */
} NUMBERS = {
    .damping_per_s = 100,
    .move_damping = 3,
    .turned_lags = 8,
    .direction_band = 6,
    .rest_band = 32,
    .strokes_per_s = 6,
    .halving_lags = 32,
    .correcting = 2,
    .back_part = 4,
    .back_off_most = 3,
    .thrown_part = 8,
    .late_windup_q3 = 5,
    .late_most = 2,
    .sure_limit_q3 = 7,
    .lands_within = 3,
    .felt_part = 25,
};

/* What moves the phase on; the table is explained in law_model_inversion.h. */
typedef enum {
    EVENT_DIRECTION_FOUND,
    EVENT_REVERSED,
    EVENT_SET_POINT_CHANGED,
    EVENT_FRICTION_TURNED,
    EVENT_SETTLED,
    EVENT_OTHER_LAW,
} event_t;

static const struct {
    inversion_phase_t from;
    event_t event;
    inversion_phase_t to;
} TRANSITIONS[] = {
    {INVERSION_UNKNOWN, EVENT_DIRECTION_FOUND, INVERSION_TURNING},
    {INVERSION_TURNING, EVENT_FRICTION_TURNED, INVERSION_TURNED},
    {INVERSION_TURNED, EVENT_SETTLED, INVERSION_SETTLED},
    {INVERSION_TURNING, EVENT_REVERSED, INVERSION_TURNING},
    {INVERSION_TURNED, EVENT_REVERSED, INVERSION_TURNING},
    {INVERSION_SETTLED, EVENT_REVERSED, INVERSION_TURNING},
    {INVERSION_TURNED, EVENT_SET_POINT_CHANGED, INVERSION_TURNING},
    {INVERSION_SETTLED, EVENT_SET_POINT_CHANGED, INVERSION_TURNING},
    {INVERSION_TURNING, EVENT_OTHER_LAW, INVERSION_UNKNOWN},
    {INVERSION_TURNED, EVENT_OTHER_LAW, INVERSION_UNKNOWN},
    {INVERSION_SETTLED, EVENT_OTHER_LAW, INVERSION_UNKNOWN},
};

/* Takes the transition of the event, where the phase has one. */
static void take(law_model_inversion_t *law, event_t event) {
    for (uint32_t i = 0; i < sizeof TRANSITIONS / sizeof TRANSITIONS[0]; i++) {
        if (TRANSITIONS[i].from == law->phase && TRANSITIONS[i].event == event) {
            law->phase = TRANSITIONS[i].to;
            return;
        }
    }
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
        .lag_ticks = lag_ticks,
        .turned_ticks = NUMBERS.turned_lags * (uint32_t)lag_ticks,
        .friction_unm = fixed_clamp(friction_unm, 0, 1 << 30), /* 8/6 of it is still in range */
        .felt_unm = settings->friction_unm / NUMBERS.felt_part,
        .thrown_pj = (int64_t)friction_unm * load_urad / NUMBERS.thrown_part,
        .rest_band_unm = settings->rest_band_unm,
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
    take(law, EVENT_OTHER_LAW);
    law->direction = 0;
    law->declined = false;
    law->held_unm = motor_torque_unm;
    law->last_wanted_unm = inputs->wanted_unm;
    move_end(&law->move);
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

/* How much the error may be before the slip direction changes: with a cell less the longer the
 * direction has stayed, twice as much for each count of the back-off; at standstill half more than
 * the last change left. */
static int32_t dead_band_unm(const law_model_inversion_t *law, int32_t motion, bool cell) {
    const uint32_t stayed = law->turn_ticks / (NUMBERS.halving_lags * (uint32_t)law->lag_ticks);
    const uint32_t halvings = cell ? NUMBERS.back_off_most - law->back_off : 0;
    const int32_t band_unm = law->friction_unm / NUMBERS.direction_band << law->back_off;
    const int32_t waited_unm =
        (band_unm >> (stayed < halvings ? stayed : halvings)) + 2 * law->rest_band_unm;
    const int32_t left_unm = motion == 0 ? law->left_unm + law->left_unm / 2 : 0;
    return waited_unm > left_unm ? waited_unm : left_unm;
}

static void forget_back_off(law_model_inversion_t *law) {
    law->back_off = 0;
    law->left_unm = 0;
}

/* Remembers where a change of direction begins. */
static void mark_turn(law_model_inversion_t *law, const law_inputs_t *inputs) {
    const estimator_t *estimator = inputs->estimator;
    law->turn_ticks = 0;
    law->turn_arc_nm = estimator->mark_nm;
    law->turn_far_nm = estimator->mark_nm;
    law->turn_innovation_nm = estimator->innovation_nm;
    law->turn_given_pj = inputs->given_pj;
    law->outran = false;
}

/* Time goes on in the phase. */
static void pass_tick(law_model_inversion_t *law) {
    if (law->turn_ticks < UINT32_MAX) {
        law->turn_ticks++;
    }
    if (law->turn_ticks == law->turned_ticks + 1u) {
        take(law, EVENT_FRICTION_TURNED);
    } else if (law->turn_ticks == 2u * law->turned_ticks + 1u) {
        take(law, EVENT_SETTLED);
    }
}

/* A set point that has moved slowly, and as far as a change of direction needs, is a new one. */
static void follow_set_point(law_model_inversion_t *law, int32_t wanted_unm, bool calm) {
    uint32_t saturations = 0; /* far is far */
    const int32_t change_unm = fixed_subtract(wanted_unm, law->settled_unm, &saturations);
    if (calm && magnitude(change_unm) > law->friction_unm / NUMBERS.direction_band) {
        forget_back_off(law);
        law->settled_unm = wanted_unm;
        law->called_for = true;
    }
}

/* What is there stays until it is wrong, or the load moves. */
static void find_direction(law_model_inversion_t *law, const law_inputs_t *inputs,
                           int32_t towards) {
    const int32_t motion = inputs->estimator->load_direction;
    law->direction = motion != 0 ? motion : towards;
    if (law->direction != 0) {
        take(law, EVENT_DIRECTION_FOUND);
        mark_turn(law, inputs);
        law->called_for = false;
    }
}

/* A load that comes back ends the back-off; what a change has left at standstill is noted. */
static void watch_turn(law_model_inversion_t *law, const estimator_t *estimator, int32_t error_unm,
                       bool calm) {
    uint32_t saturations = 0; /* far travel is far */
    const int32_t back_nm =
        law->direction * fixed_subtract(law->turn_far_nm, estimator->mark_nm, &saturations);
    if (back_nm < 0) {
        law->turn_far_nm = estimator->mark_nm;
    } else if (calm && back_nm > estimator->windup_nm / NUMBERS.back_part) {
        forget_back_off(law);
    }
    if (estimator->load_direction == 0 && law->back_off > 0 &&
        law->turn_ticks == 2u * law->turned_ticks) {
        law->left_unm = magnitude(fixed_clamp(error_unm, -EXTRA_MOST_UNM, EXTRA_MOST_UNM));
    }
}

/* Energy that the load has been given since the direction changed. */
static int64_t given_pj(const law_model_inversion_t *law, const law_inputs_t *inputs) {
    return (int64_t)(inputs->given_pj - law->turn_given_pj);
}

/* Does the operator move the load against the slip direction? The motor pulls it the other way, so
 * it is not the drive, unless the drive has given it the energy to come back. */
static bool operator_moves_back(const law_model_inversion_t *law, const law_inputs_t *inputs) {
    return inputs->estimator->load_direction == -law->direction && given_pj(law, inputs) <= 0;
}

/* Turns the slip direction over. Unless the load moves back, has made a stroke or the set point is
 * new that costs back-off. */
static void reverse(law_model_inversion_t *law, const law_inputs_t *inputs, bool calm,
                    bool moved_back) {
    const estimator_t *estimator = inputs->estimator;
    uint32_t saturations = 0; /* far travel is far */
    const int32_t travel_nm = fixed_subtract(estimator->mark_nm, law->turn_arc_nm, &saturations);
    const bool stroke = travel_nm * law->direction > estimator->windup_nm / 2;
    if (calm && stroke && !inputs->owes) {
        forget_back_off(law);
    } else if (!law->called_for && !moved_back && law->back_off < NUMBERS.back_off_most) {
        law->back_off++;
    }
    law->called_for = false;
    law->direction = -law->direction;
    take(law, EVENT_REVERSED);
    mark_turn(law, inputs);
}

/* Follows the load that the operator moves back at once, all else when the last change is over.
 * Says whether a planned move is to turn the friction over. */
static bool choose_direction(law_model_inversion_t *law, const law_inputs_t *inputs,
                             int32_t wanted_unm, int32_t error_unm) {
    const estimator_t *estimator = inputs->estimator;
    const int32_t motion = estimator->load_direction;
    const int32_t band_unm = dead_band_unm(law, motion, inputs->cell);
    pass_tick(law);
    const bool calm = law->turn_ticks > estimator->ticks_per_s / NUMBERS.strokes_per_s;
    follow_set_point(law, wanted_unm, calm);
    const int32_t called_unm = law->declined ? 0 : error_unm;
    const int32_t towards = (called_unm > band_unm) - (called_unm < -band_unm);
    if (law->phase == INVERSION_UNKNOWN) {
        find_direction(law, inputs, towards);
        return false;
    }
    watch_turn(law, estimator, error_unm, calm);
    const bool moved_back = operator_moves_back(law, inputs);
    const bool settled = law->phase == INVERSION_SETTLED || moved_back ||
                         (law->phase == INVERSION_TURNED && motion != 0);
    if (towards == -law->direction && motion != law->direction && settled) {
        reverse(law, inputs, calm, moved_back);
        return moved_back && inputs->cell && law->late == 0;
    }
    return false;
}

/* Does the set point change at once? Not where the motor might bring it but never take it back. */
static bool set_point_changes(law_model_inversion_t *law, int32_t wanted_unm, int32_t error_unm,
                              int32_t motion) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t jump_unm = fixed_subtract(wanted_unm, law->last_wanted_unm, &saturations);
    const bool jumps = magnitude(jump_unm) > law->rest_band_unm;
    law->last_wanted_unm = wanted_unm;
    if (motion != 0) {
        law->declined = false;
    } else if (jumps) {
        law->declined =
            law->weak && magnitude(error_unm) <= law->friction_unm / NUMBERS.lands_within;
    }
    return jumps && !law->declined;
}

/* The set point has changed at once: the slip direction is that of the error, as the motor outruns
 * the load. */
static void take_set_point(law_model_inversion_t *law, const law_inputs_t *inputs,
                           int32_t wanted_unm, int32_t error_unm) {
    const int32_t towards = (error_unm > law->rest_band_unm) - (error_unm < -law->rest_band_unm);
    if (towards != 0) {
        law->direction = towards;
        take(law, EVENT_DIRECTION_FOUND);
    }
    take(law, EVENT_SET_POINT_CHANGED);
    mark_turn(law, inputs);
    forget_back_off(law);
    law->settled_unm = wanted_unm;
    law->called_for = true;
}

/* Where friction builds up late it does not hold the motor while the direction changes: the motor
 * runs ahead and throws the load. With a cell the energy that the load is given tells: a load that
 * the operator moves back meanwhile takes none, however large the error. Without, the motor's lead
 * over the model. Each such change makes the next ones slower. */
static void notice_late_friction(law_model_inversion_t *law, const law_inputs_t *inputs) {
    const estimator_t *estimator = inputs->estimator;
    if (law->phase != INVERSION_TURNING || law->outran) {
        return;
    }
    uint32_t saturations = 0; /* far ahead is far ahead */
    const int32_t direction = law->direction;
    const int32_t ahead_nm =
        fixed_subtract(estimator->innovation_nm, law->turn_innovation_nm, &saturations);
    const bool thrown = given_pj(law, inputs) > law->thrown_pj;
    const bool ahead = direction * ahead_nm > estimator->windup_nm / 8 * NUMBERS.late_windup_q3;
    law->outran = inputs->cell ? thrown : ahead;
    if (law->outran && law->late < NUMBERS.late_most) {
        law->late++;
    }
}

/* Takes the load cell's error up into the shift of this direction. */
static void learn(law_model_inversion_t *law, int32_t error_unm, int32_t motion, bool limited) {
    const int32_t known = law->direction > 0 ? error_unm : -error_unm;
    const int32_t towards = law->direction == 0 ? magnitude(error_unm) : known;
    const bool turned = law->turn_ticks > law->turned_ticks;
    const bool useful = motion == law->direction || towards > 0;
    if (law->integral_ticks == 0 || law->declined || !turned || !useful || law->resting ||
        (limited && towards > 0)) {
        return;
    }
    const int32_t most_q8 = fixed_clamp(law->friction_unm, 0, 1 << 22) * 256;
    const int32_t step_q8 = fixed_clamp(error_unm, -(1 << 22), 1 << 22) * 256 / law->integral_ticks;
    for (int32_t sign = -1; sign <= 1; sign += 2) {
        if (law->direction == 0 || law->direction == sign) { /* unknown: it may be either */
            int32_t *shift = &law->shift_q8_unm[sign > 0 ? 1 : 0];
            *shift = fixed_clamp(*shift + step_q8, -most_q8, most_q8);
        }
    }
}

/* The motor torque at which the pair holds `extra_unm` more than the plain one: at once by a move
 * when a new set point has begun one, else along two lags. `enough`: friction holds what is there.
 */
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
        if (enough) {
            move_end(&law->move);
        }
        return fixed_subtract(moving_unm, NUMBERS.move_damping * damping_unm, &saturations);
    }
    move_end(&law->move);
    if (enough) {
        lag[0] = lag[1];
    } else {
        lag[0] += (extra_unm * 16 - lag[0]) / (slower * law->lag_ticks);
        lag[1] += (lag[0] - lag[1]) / (slower * law->lag_ticks);
    }
    law->held_unm = fixed_add(plain_unm, lag[1] / 16, &saturations);
    return fixed_subtract(law->held_unm, damping_unm, &saturations);
}

static int32_t slowed(const law_model_inversion_t *law, bool feels_its_way) {
    const int32_t corrects = feels_its_way && law->back_off > 0 ? NUMBERS.correcting - 1 : 0;
    return 1 + (corrects > law->late ? corrects : law->late);
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
    const int32_t wanted_unm =
        fixed_subtract(inputs->wanted_unm, motion * law->felt_unm, &saturations);
    const int32_t error_unm = fixed_subtract(wanted_unm, inputs->load_torque_unm, &saturations);
    const bool changed = set_point_changes(law, inputs->wanted_unm, error_unm, motion);
    if (changed) {
        take_set_point(law, inputs, wanted_unm, error_unm);
    }
    const bool moved_back = choose_direction(law, inputs, wanted_unm, error_unm);
    notice_late_friction(law, inputs);
    const int32_t left_alone_unm = (law->rest_band_unm + law->friction_unm / NUMBERS.rest_band)
                                   << law->back_off;
    law->resting = motion == 0 && magnitude(error_unm) <= left_alone_unm;
    if (inputs->cell) {
        learn(law, error_unm, motion, inputs->limited);
    }
    const int32_t direction = law->direction;
    const int32_t shift_unm = law->shift_q8_unm[direction > 0 ? 1 : 0] / 256;
    const int32_t aim_unm = fixed_add(wanted_unm, shift_unm, &saturations);
    const int32_t plain_unm = fixed_scale(wanted_unm, law->motor_per_load_torque, &saturations);
    const int32_t full_unm = sliding_motor_torque_unm(sliding, aim_unm, direction);
    law->held_taut = sliding_holds_taut(sliding, full_unm, direction);
    const int64_t extra_unm =
        ((int64_t)full_unm - plain_unm) * (int64_t)inputs->share_q16 / LAW_SHARE_ONE;
    const int32_t target_unm =
        law->phase == INVERSION_UNKNOWN
            ? law->lag_q4_unm[0] / 16
            : fixed_clamp((int32_t)extra_unm, -EXTRA_MOST_UNM, EXTRA_MOST_UNM);
    if (changed || moved_back) {
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
    return answer_of(law, go_over(law, plain_unm, target_unm, damping_unm, enough,
                                  slowed(law, inputs->cell && motion == 0)));
}
