/* law_inversion.c: see law_inversion.h. */
#include "law_inversion.h"

#define DAMPING_PER_S 100 /* D / J: below what 2 ms of delay in the encoders allow */
#define MOVE_DAMPING 3    /* times that in a move, whose plan knows the speed */
#define SETTLED_LAGS 8    /* a change of side has settled; at rest twice this */
#define SIDE_BAND 6       /* an error above 1/6 of the friction changes the side */
#define REST_BAND 32      /* at rest 1/32 of it is left alone: less than stiction makes it jump */
#define STROKES_PER_S 6   /* no hand turns around faster */
#define WAIT_LAGS 32      /* each time that a side has stayed so long halves the band */
#define CORRECTING 2      /* at rest an error is corrected so much slower: the cell is late */
#define BACK_PART 4       /* of the windup: a load that comes back so far is moved by the hand */
#define PATIENCE_MOST 3   /* 4/3 of the friction; a load that is moved back makes twice that */

/* Friction that comes late: after a change of side the load feels this part of it too much, or the
 * motor is ahead of the model by this part of the windup, which stiffness that is off is not. */
#define LATE_FRICTION 3
#define LATE_WINDUP_Q3 5
#define LATE_MOST 2

/* Friction is known to 15 % or so: the motor is sure to turn over 7/8 of its limit, and turning
 * twice the friction over lands within 1/3 of it. */
#define SURE_LIMIT_Q3 7
#define LANDS_WITHIN 3

#define EXTRA_MOST (1 << 26) /* uN m; in Q4 that is the range of int32_t */

inversion_t inversion_of(const transmission_t *transmission, const sliding_t *sliding,
                         uint32_t ticks_per_s, uint32_t motor_inertia_gmm2,
                         int32_t torque_limit_unm, int32_t rest_band_unm,
                         uint32_t integral_gain_mhz) {
    const transmission_settings_t *pair = &transmission->settings;
    const uint32_t inertia = motor_inertia_gmm2 > 0 ? motor_inertia_gmm2 : 1;
    /* omega = sqrt(k / J); uN m and g mm^2 are 1e-6 and 1e-9 */
    const uint64_t stiffness = (uint64_t)(uint32_t)sliding->motor_unm_per_rad;
    const uint32_t omega_rad_per_s = fixed_root(stiffness * 1000u / inertia, 32);
    const uint32_t lag = ticks_per_s / (omega_rad_per_s > 0 ? omega_rad_per_s : 1u);
    uint32_t saturations = 0;
    const ratio_t motor_per_load =
        ratio_of(pair->motor_pulley_radius_nm, pair->load_pulley_radius_nm);
    /* the taut friction at the load: what arrives less when the motor gives as much */
    const int32_t motor_friction_unm = sliding_motor_torque_unm(sliding, 0, 1);
    const int32_t friction_unm =
        fixed_scale(motor_friction_unm, ratio_reciprocal(motor_per_load), &saturations);
    return (inversion_t){
        .motor_per_load_torque = motor_per_load,
        /* D = J DAMPING_PER_S in 1e-9 N m s; a speed of 1 nm a tick is ticks_per_s / r_nm rad/s */
        .damping = ratio_of((uint64_t)inertia * DAMPING_PER_S * ticks_per_s,
                            (uint64_t)pair->motor_pulley_radius_nm * 1000u),
        .lag_ticks = (int32_t)(lag > 0 ? lag : 1u),
        .friction_unm = fixed_clamp(friction_unm, 0, 1 << 30), /* 8/6 of it is still in range */
        .rest_band_unm = rest_band_unm,
        .weak = motor_friction_unm > (int64_t)torque_limit_unm * SURE_LIMIT_Q3 / 8,
        .move = move_of((int32_t)(lag > 0 ? lag : 1u), torque_limit_unm,
                        MOVE_DAMPING * DAMPING_PER_S, ticks_per_s),
        .integral_ticks =
            integral_gain_mhz > 0 ? (int32_t)(ticks_per_s * 1000u / integral_gain_mhz) + 1 : 0,
    };
}

void inversion_follow(inversion_t *inversion, int32_t motor_torque_unm, int32_t wanted_unm) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t plain_unm =
        fixed_scale(wanted_unm, inversion->motor_per_load_torque, &saturations);
    const int32_t extra_unm = fixed_subtract(motor_torque_unm, plain_unm, &saturations);
    const int32_t limited_unm = fixed_clamp(extra_unm, -EXTRA_MOST, EXTRA_MOST);
    inversion->lag_q4_unm[0] = limited_unm * 16;
    inversion->lag_q4_unm[1] = limited_unm * 16;
    inversion->side = 0;
    inversion->declined = false;
    inversion->held_unm = motor_torque_unm;
    inversion->last_asked_unm = wanted_unm;
    move_end(&inversion->move);
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

/* How much the error may be before the side changes: with a cell less the longer the side has
 * stayed, twice as much for each unit of patience lost; at rest half more than the last change
 * left. */
static int32_t side_band_unm(const inversion_t *inversion, int32_t direction, bool cell) {
    const uint32_t stayed = inversion->side_ticks / (WAIT_LAGS * (uint32_t)inversion->lag_ticks);
    const uint32_t eager = cell ? PATIENCE_MOST - inversion->patience : 0;
    const int32_t band_unm = inversion->friction_unm / SIDE_BAND << inversion->patience;
    const int32_t waited_unm =
        (band_unm >> (stayed < eager ? stayed : eager)) + 2 * inversion->rest_band_unm;
    const int32_t left_unm = direction == 0 ? inversion->left_unm + inversion->left_unm / 2 : 0;
    return waited_unm > left_unm ? waited_unm : left_unm;
}

/* Remembers where a change of side begins. */
static void mark_change(inversion_t *inversion, const estimator_t *estimator) {
    inversion->side_ticks = 0;
    inversion->side_arc_nm = estimator->mark_nm;
    inversion->side_far_nm = estimator->mark_nm;
    inversion->side_innovation_nm = estimator->innovation_nm;
    inversion->outran = false;
}

/* Chooses the side. */
static void choose_side(inversion_t *inversion, const estimator_t *estimator,
                        const inversion_inputs_t *inputs, int32_t error_unm) {
    uint32_t saturations = 0; /* far travel is far */
    const int32_t direction = estimator->load_direction;
    const int32_t band_unm = side_band_unm(inversion, direction, inputs->cell);
    if (inversion->side_ticks < UINT32_MAX) {
        inversion->side_ticks++;
    }
    const int32_t change_unm =
        fixed_subtract(inputs->wanted_unm, inversion->settled_unm, &saturations);
    const bool calm = inversion->side_ticks > estimator->ticks_per_s / STROKES_PER_S;
    if (calm && magnitude(change_unm) > inversion->friction_unm / SIDE_BAND) {
        inversion->patience = 0;
        inversion->left_unm = 0;
        inversion->settled_unm = inputs->wanted_unm;
        inversion->called_for = true;
    }
    const int32_t called_unm = inversion->declined ? 0 : error_unm;
    const int32_t towards = called_unm > band_unm ? 1 : (called_unm < -band_unm ? -1 : 0);
    if (inversion->side == 0) { /* what is there stays until it is wrong, or the load moves */
        inversion->side = direction != 0 ? direction : towards;
        if (inversion->side != 0) {
            mark_change(inversion, estimator);
        }
        inversion->called_for = inversion->called_for && inversion->side == 0;
        return;
    }
    const int32_t back_nm =
        inversion->side * fixed_subtract(inversion->side_far_nm, estimator->mark_nm, &saturations);
    if (back_nm < 0) {
        inversion->side_far_nm = estimator->mark_nm;
    } else if (calm && back_nm > estimator->windup_nm / BACK_PART) {
        inversion->patience = 0;
        inversion->left_unm = 0;
    }
    if (direction == 0 && inversion->patience > 0 &&
        inversion->side_ticks == 2 * SETTLED_LAGS * (uint32_t)inversion->lag_ticks) {
        inversion->left_unm = magnitude(fixed_clamp(error_unm, -EXTRA_MOST, EXTRA_MOST));
    }
    const uint32_t lags = direction != 0 ? SETTLED_LAGS : 2 * SETTLED_LAGS;
    const bool settled = inversion->side_ticks > lags * (uint32_t)inversion->lag_ticks;
    if (towards != -inversion->side || direction == inversion->side || !settled) {
        return;
    }
    const int32_t travel_nm =
        fixed_subtract(estimator->mark_nm, inversion->side_arc_nm, &saturations);
    const bool stroke = travel_nm * inversion->side > estimator->windup_nm / 2;
    if (calm && stroke && !inputs->owes) {
        inversion->patience = 0;
        inversion->left_unm = 0;
    } else if (!inversion->called_for && inversion->patience < PATIENCE_MOST) {
        inversion->patience++;
    }
    inversion->called_for = false;
    inversion->side = -inversion->side;
    mark_change(inversion, estimator);
}

/* Is something else wanted at once? Not where the motor might bring it but never take it back. */
static bool wishes(inversion_t *inversion, int32_t asked_unm, int32_t error_unm,
                   int32_t direction) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t jump_unm = fixed_subtract(asked_unm, inversion->last_asked_unm, &saturations);
    const bool jumps = magnitude(jump_unm) > inversion->rest_band_unm;
    inversion->last_asked_unm = asked_unm;
    if (direction != 0) {
        inversion->declined = false;
    } else if (jumps) {
        inversion->declined =
            inversion->weak && magnitude(error_unm) <= inversion->friction_unm / LANDS_WITHIN;
    }
    return jumps && !inversion->declined;
}

/* Something else is wanted at once: the side is that of the error, as the motor outruns the load.
 */
static void take_wish(inversion_t *inversion, const estimator_t *estimator,
                      const inversion_inputs_t *inputs, int32_t error_unm) {
    const int32_t towards =
        (error_unm > inversion->rest_band_unm) - (error_unm < -inversion->rest_band_unm);
    if (towards != 0) {
        inversion->side = towards;
    }
    mark_change(inversion, estimator);
    inversion->patience = 0;
    inversion->left_unm = 0;
    inversion->settled_unm = inputs->wanted_unm;
    inversion->called_for = true;
}

/* Where friction builds up late it does not hold the motor while the side changes: the motor runs
 * ahead and pulls the load along. Each such change makes the next ones slower. */
static void notice_late_friction(inversion_t *inversion, const estimator_t *estimator, bool cell,
                                 int32_t error_unm) {
    const int32_t side = inversion->side;
    const uint32_t changes_ticks = (uint32_t)(SETTLED_LAGS * inversion->lag_ticks);
    if (side == 0 || inversion->outran || inversion->side_ticks > changes_ticks) {
        return;
    }
    uint32_t saturations = 0; /* far ahead is far ahead */
    const int32_t ahead_nm =
        fixed_subtract(estimator->innovation_nm, inversion->side_innovation_nm, &saturations);
    const bool pulls = -side * error_unm > inversion->friction_unm / LATE_FRICTION;
    const bool ahead = side * ahead_nm > estimator->windup_nm / 8 * LATE_WINDUP_Q3;
    inversion->outran = cell ? pulls : ahead;
    if (inversion->outran && inversion->late < LATE_MOST) {
        inversion->late++;
    }
}

/* Takes the load cell's error up into the shift of this side. */
static void learn(inversion_t *inversion, int32_t error_unm, int32_t direction, bool limited) {
    const int32_t towards = inversion->side > 0 ? error_unm : -error_unm;
    const bool settled = inversion->side_ticks > (uint32_t)(SETTLED_LAGS * inversion->lag_ticks);
    const bool useful = direction == inversion->side || towards > 0;
    if (inversion->integral_ticks == 0 || inversion->declined || !settled || !useful ||
        inversion->resting || (limited && towards > 0)) {
        return;
    }
    int32_t *shift = &inversion->shift_q8_unm[inversion->side > 0 ? 1 : 0];
    const int32_t most_q8 = fixed_clamp(inversion->friction_unm, 0, 1 << 22) * 256;
    const int32_t step_q8 =
        fixed_clamp(error_unm, -(1 << 22), 1 << 22) * 256 / inversion->integral_ticks;
    *shift = fixed_clamp(*shift + step_q8, -most_q8, most_q8);
}

/* The motor torque at which the side holds `extra_unm` more than the plain one: at once by a move
 * when a wish has begun one, else along two lags. `enough`: friction holds what is there. */
static int32_t go_over(inversion_t *inversion, int32_t plain_unm, int32_t extra_unm,
                       int32_t damping_unm, bool enough, int32_t slower) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    int32_t *lag = inversion->lag_q4_unm;
    if (move_runs(&inversion->move)) {
        const int32_t to_unm = fixed_add(plain_unm, extra_unm, &saturations);
        const int32_t moving_unm = move_step(&inversion->move, to_unm);
        inversion->held_unm = move_static_unm(&inversion->move);
        const int32_t held_extra_unm = fixed_subtract(inversion->held_unm, plain_unm, &saturations);
        lag[0] = fixed_clamp(held_extra_unm, -EXTRA_MOST, EXTRA_MOST) * 16;
        lag[1] = lag[0];
        if (enough) {
            move_end(&inversion->move);
        }
        return fixed_subtract(moving_unm, MOVE_DAMPING * damping_unm, &saturations);
    }
    move_end(&inversion->move);
    if (enough) {
        lag[0] = lag[1];
    } else {
        lag[0] += (extra_unm * 16 - lag[0]) / (slower * inversion->lag_ticks);
        lag[1] += (lag[0] - lag[1]) / (slower * inversion->lag_ticks);
    }
    inversion->held_unm = fixed_add(plain_unm, lag[1] / 16, &saturations);
    return fixed_subtract(inversion->held_unm, damping_unm, &saturations);
}

int32_t inversion_step(inversion_t *inversion, const sliding_t *sliding,
                       const estimator_t *estimator, const inversion_inputs_t *inputs) {
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int32_t direction = estimator->load_direction;
    const int32_t error_unm =
        fixed_subtract(inputs->wanted_unm, inputs->load_torque_unm, &saturations);
    const bool wish = wishes(inversion, inputs->asked_unm, error_unm, direction);
    if (wish) {
        take_wish(inversion, estimator, inputs, error_unm);
    }
    choose_side(inversion, estimator, inputs, error_unm);
    notice_late_friction(inversion, estimator, inputs->cell, error_unm);
    const int32_t rest_unm = (inversion->rest_band_unm + inversion->friction_unm / REST_BAND)
                             << inversion->patience;
    inversion->resting = direction == 0 && magnitude(error_unm) <= rest_unm;
    if (inputs->cell) {
        learn(inversion, error_unm, direction, inputs->limited);
    }
    const int32_t side = inversion->side;
    const int32_t shift_unm = inversion->shift_q8_unm[side > 0 ? 1 : 0] / 256;
    const int32_t aim_unm = fixed_add(inputs->wanted_unm, shift_unm, &saturations);
    const int32_t plain_unm =
        fixed_scale(inputs->wanted_unm, inversion->motor_per_load_torque, &saturations);
    const int32_t full_unm = sliding_motor_torque_unm(sliding, aim_unm, side);
    inversion->held_taut = sliding_holds_taut(sliding, full_unm, side);
    const int64_t extra_unm =
        ((int64_t)full_unm - plain_unm) * (int64_t)inputs->share_q16 / INVERSION_SHARE_ONE;
    const int32_t target_unm = side == 0 ? inversion->lag_q4_unm[0] / 16
                                         : fixed_clamp((int32_t)extra_unm, -EXTRA_MOST, EXTRA_MOST);
    if (wish) {
        move_start(&inversion->move, inversion->held_unm,
                   fixed_add(plain_unm, target_unm, &saturations),
                   sliding_slack_motor_unm(sliding));
    }
    const bool feels_its_way = inputs->cell && direction == 0;
    const bool arrived = inputs->cell && side * fixed_clamp(error_unm, -1, 1) <= 0;
    const bool more = side * (target_unm - inversion->lag_q4_unm[1] / 16) > 0;
    const bool enough =
        arrived && (direction == 0 || (direction == side && more && !move_runs(&inversion->move)));
    const int32_t corrects = feels_its_way && inversion->patience > 0 ? CORRECTING - 1 : 0;
    const int32_t slower = 1 + (corrects > inversion->late ? corrects : inversion->late);
    const int32_t damping_unm =
        fixed_clamp(fixed_scale(estimator->gap_speed_nm, inversion->damping, &saturations),
                    -EXTRA_MOST, EXTRA_MOST);
    return go_over(inversion, plain_unm, target_unm, damping_unm, enough, slower);
}
