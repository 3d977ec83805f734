/* slip_direction.c: see slip_direction.h. */
#include "slip_direction.h"

#define ERROR_MOST_UNM (1 << 26) /* an error beyond it is as large */

/* Every number of the direction. Found on developing seeds of the compensation benchmark unless a
 * source is given; "1/x" divides, "2^-3" counts eighths. The range is where the arithmetic holds.
 */
static const struct {
    uint32_t turned_lags;   /* lags, 1 .. 1000: a change of direction has turned the friction
                               over; settled at standstill after twice this */
    int32_t direction_band; /* 1/x of friction, 1 .. 100: error that changes the direction */
    uint32_t halving_lags;  /* lags, 1 .. 1000: each halves the band of a direction that stays */
    int32_t back_part;      /* 1/x of windup, 1 .. 100: a load that comes back so far is moved
                               by the operator */
    uint32_t back_off_most; /* 2^x, 0 .. 8: 4/3 of the friction; a load that is moved back makes
                               twice that */
    int32_t thrown_part;    /* 1/x of friction times backlash, 1 .. 100: what a load is given in a
                               change of direction when friction builds up late: 1/25 to 1/16
                               where it does so by 16 ms */
    int32_t late_windup_q3; /* 2^-3 of windup, 1 .. 64: lead of the motor over the model then;
                               stiffness that is off makes less */
    int32_t late_most;      /* 1, 0 .. 10: so many late changes slow the later ones down */
} NUMBERS = {
    .turned_lags = 8,
    .direction_band = 6,
    .halving_lags = 32,
    .back_part = 4,
    .back_off_most = 3,
    .thrown_part = 24,
    .late_windup_q3 = 5,
    .late_most = 2,
};

/* What moves the phase on; the table is explained in slip_direction.h. */
typedef enum {
    EVENT_DIRECTION_FOUND,
    EVENT_REVERSED,
    EVENT_SET_POINT_CHANGED,
    EVENT_FRICTION_TURNED,
    EVENT_SETTLED,
    EVENT_OTHER_LAW,
} event_t;

static const struct {
    slip_phase_t from;
    event_t event;
    slip_phase_t to;
} TRANSITIONS[] = {
    {SLIP_PHASE_UNKNOWN, EVENT_DIRECTION_FOUND, SLIP_PHASE_TURNING},
    {SLIP_PHASE_TURNING, EVENT_FRICTION_TURNED, SLIP_PHASE_TURNED},
    {SLIP_PHASE_TURNED, EVENT_SETTLED, SLIP_PHASE_SETTLED},
    {SLIP_PHASE_TURNING, EVENT_REVERSED, SLIP_PHASE_TURNING},
    {SLIP_PHASE_TURNED, EVENT_REVERSED, SLIP_PHASE_TURNING},
    {SLIP_PHASE_SETTLED, EVENT_REVERSED, SLIP_PHASE_TURNING},
    {SLIP_PHASE_TURNED, EVENT_SET_POINT_CHANGED, SLIP_PHASE_TURNING},
    {SLIP_PHASE_SETTLED, EVENT_SET_POINT_CHANGED, SLIP_PHASE_TURNING},
    {SLIP_PHASE_TURNING, EVENT_OTHER_LAW, SLIP_PHASE_UNKNOWN},
    {SLIP_PHASE_TURNED, EVENT_OTHER_LAW, SLIP_PHASE_UNKNOWN},
    {SLIP_PHASE_SETTLED, EVENT_OTHER_LAW, SLIP_PHASE_UNKNOWN},
};

/* Takes the transition of the event, where the phase has one. */
static void take(slip_direction_t *slip, event_t event) {
    for (uint32_t i = 0; i < sizeof TRANSITIONS / sizeof TRANSITIONS[0]; i++) {
        if (TRANSITIONS[i].from == slip->phase && TRANSITIONS[i].event == event) {
            slip->phase = TRANSITIONS[i].to;
            return;
        }
    }
}

slip_direction_t slip_direction_of(int32_t lag_ticks, int32_t friction_unm, int32_t load_urad,
                                   int32_t standstill_band_unm) {
    return (slip_direction_t){
        .lag_ticks = lag_ticks,
        .turned_ticks = NUMBERS.turned_lags * (uint32_t)lag_ticks,
        .friction_unm = friction_unm,
        .thrown_pj = (int64_t)friction_unm * load_urad / NUMBERS.thrown_part,
        .standstill_band_unm = standstill_band_unm,
    };
}

void slip_direction_lose(slip_direction_t *slip) {
    take(slip, EVENT_OTHER_LAW);
    slip->direction = 0;
}

bool slip_direction_has_turned(const slip_direction_t *slip) {
    return slip->turn_ticks > slip->turned_ticks;
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

/* How much the error may be before the slip direction changes: with a cell less the longer the
 * direction has stayed, twice as much for each count of the back-off; at standstill half more than
 * the last change left. */
static int32_t dead_band_unm(const slip_direction_t *slip, int32_t motion, bool cell) {
    const uint32_t stayed = slip->turn_ticks / (NUMBERS.halving_lags * (uint32_t)slip->lag_ticks);
    const uint32_t halvings = cell ? NUMBERS.back_off_most - slip->back_off : 0;
    const int32_t band_unm = slip->friction_unm / NUMBERS.direction_band << slip->back_off;
    const int32_t waited_unm =
        (band_unm >> (stayed < halvings ? stayed : halvings)) + 2 * slip->standstill_band_unm;
    const int32_t left_unm = motion == 0 ? slip->left_unm + slip->left_unm / 2 : 0;
    return waited_unm > left_unm ? waited_unm : left_unm;
}

static void forget_back_off(slip_direction_t *slip) {
    slip->back_off = 0;
    slip->left_unm = 0;
}

/* Remembers where a change of direction begins. */
static void mark_turn(slip_direction_t *slip, const law_inputs_t *inputs) {
    const estimator_t *estimator = inputs->estimator;
    slip->turn_ticks = 0;
    slip->turn_arc_nm = estimator->mark_nm;
    slip->turn_far_nm = estimator->mark_nm;
    slip->turn_innovation_nm = estimator->innovation_nm;
    slip->turn_given_pj = inputs->given_pj;
    slip->outran = false;
}

/* Time goes on in the phase. */
static void pass_tick(slip_direction_t *slip) {
    if (slip->turn_ticks < UINT32_MAX) {
        slip->turn_ticks++;
    }
    if (slip->turn_ticks == slip->turned_ticks + 1u) {
        take(slip, EVENT_FRICTION_TURNED);
    } else if (slip->turn_ticks == 2u * slip->turned_ticks + 1u) {
        take(slip, EVENT_SETTLED);
    }
}

/* A set point that has moved slowly, and as far as a change of direction needs, is a new one. */
static void follow_set_point(slip_direction_t *slip, int32_t wanted_unm) {
    uint32_t saturations = 0; /* far is far */
    const int32_t change_unm = fixed_subtract(wanted_unm, slip->settled_unm, &saturations);
    if (magnitude(change_unm) > slip->friction_unm / NUMBERS.direction_band) {
        forget_back_off(slip);
        slip->settled_unm = wanted_unm;
        slip->called_for = true;
    }
}

/* What is there stays until it is wrong, or the load moves. */
static void find_direction(slip_direction_t *slip, const law_inputs_t *inputs, int32_t towards) {
    const int32_t motion = inputs->estimator->load_direction;
    slip->direction = motion != 0 ? motion : towards;
    if (slip->direction != 0) {
        take(slip, EVENT_DIRECTION_FOUND);
        mark_turn(slip, inputs);
        slip->called_for = false;
    }
}

/* A load that comes back ends the back-off; what a change has left at standstill is noted. */
static void watch_turn(slip_direction_t *slip, const estimator_t *estimator, int32_t error_unm) {
    uint32_t saturations = 0; /* far travel is far */
    const int32_t back_nm =
        slip->direction * fixed_subtract(slip->turn_far_nm, estimator->mark_nm, &saturations);
    if (back_nm < 0) {
        slip->turn_far_nm = estimator->mark_nm;
    } else if (back_nm > estimator->windup_nm / NUMBERS.back_part) {
        forget_back_off(slip);
    }
    if (estimator->load_direction == 0 && slip->back_off > 0 &&
        slip->turn_ticks == 2u * slip->turned_ticks) {
        slip->left_unm = magnitude(fixed_clamp(error_unm, -ERROR_MOST_UNM, ERROR_MOST_UNM));
    }
}

/* Energy that the load has been given since the direction changed. */
static int64_t given_pj(const slip_direction_t *slip, const law_inputs_t *inputs) {
    return (int64_t)(inputs->given_pj - slip->turn_given_pj);
}

/* Does the operator turn the load around? It has moved against the slip direction, or by a count,
 * and goes on. The motor pulls it the other way, so it is not the drive, unless the drive has given
 * it the energy to come back. */
static bool operator_turns(const slip_direction_t *slip, const law_inputs_t *inputs) {
    const estimator_t *estimator = inputs->estimator;
    const int32_t back = -slip->direction;
    const bool begins =
        estimator->creep_direction == back && load_tracker_direction(&estimator->load) == back;
    return (begins || estimator->load_direction == back) && given_pj(slip, inputs) <= 0;
}

/* Turns the slip direction over. Unless the operator has turned the load around or made a stroke,
 * or the set point is new, that costs back-off. */
static void reverse(slip_direction_t *slip, const law_inputs_t *inputs, bool by_operator) {
    const estimator_t *estimator = inputs->estimator;
    uint32_t saturations = 0; /* far travel is far */
    const int32_t travel_nm = fixed_subtract(estimator->mark_nm, slip->turn_arc_nm, &saturations);
    const bool stroke = travel_nm * slip->direction > estimator->windup_nm / 2;
    if (stroke && !inputs->owes) {
        forget_back_off(slip);
    } else if (!slip->called_for && !by_operator && slip->back_off < NUMBERS.back_off_most) {
        slip->back_off++;
    }
    slip->called_for = false;
    slip->direction = -slip->direction;
    take(slip, EVENT_REVERSED);
    mark_turn(slip, inputs);
}

/* As slip_direction_step; what is late is noticed after it. */
static bool choose_direction(slip_direction_t *slip, const law_inputs_t *inputs, int32_t wanted_unm,
                             int32_t error_unm, bool declined) {
    const estimator_t *estimator = inputs->estimator;
    const int32_t motion = estimator->load_direction;
    pass_tick(slip);
    follow_set_point(slip, wanted_unm);
    watch_turn(slip, estimator, error_unm);
    const bool by_operator = slip->phase != SLIP_PHASE_UNKNOWN && operator_turns(slip, inputs);
    if (by_operator) {
        forget_back_off(slip);
    }
    const int32_t band_unm = dead_band_unm(slip, motion, inputs->cell);
    const int32_t called_unm = declined ? 0 : error_unm;
    const int32_t towards = (called_unm > band_unm) - (called_unm < -band_unm);
    if (slip->phase == SLIP_PHASE_UNKNOWN) {
        find_direction(slip, inputs, towards);
        return false;
    }
    const bool settled = slip->phase == SLIP_PHASE_SETTLED || by_operator ||
                         (slip->phase == SLIP_PHASE_TURNED && motion != 0);
    const bool goes_on = !by_operator && (motion == slip->direction ||
                                          estimator->creep_direction == slip->direction);
    if (towards == -slip->direction && !goes_on && settled) {
        reverse(slip, inputs, by_operator);
        return by_operator && inputs->cell && slip->late == 0;
    }
    return false;
}

void slip_direction_call(slip_direction_t *slip, const law_inputs_t *inputs, int32_t wanted_unm,
                         int32_t error_unm) {
    const int32_t towards =
        (error_unm > slip->standstill_band_unm) - (error_unm < -slip->standstill_band_unm);
    if (towards != 0) {
        slip->direction = towards;
        take(slip, EVENT_DIRECTION_FOUND);
    }
    take(slip, EVENT_SET_POINT_CHANGED);
    mark_turn(slip, inputs);
    forget_back_off(slip);
    slip->settled_unm = wanted_unm;
    slip->called_for = true;
}

/* Where friction builds up late it does not hold the motor while the direction changes: the motor
 * runs ahead and throws the load. With a cell the energy that the load is given tells: a load that
 * the operator moves back meanwhile takes none, however large the error. Without, the motor's lead
 * over the model. Each such change makes the next ones slower. */
static void notice_late_friction(slip_direction_t *slip, const law_inputs_t *inputs) {
    const estimator_t *estimator = inputs->estimator;
    if (slip->phase != SLIP_PHASE_TURNING || slip->outran) {
        return;
    }
    uint32_t saturations = 0; /* far ahead is far ahead */
    const int32_t direction = slip->direction;
    const int32_t ahead_nm =
        fixed_subtract(estimator->innovation_nm, slip->turn_innovation_nm, &saturations);
    const bool thrown = given_pj(slip, inputs) > slip->thrown_pj;
    const bool ahead = direction * ahead_nm > estimator->windup_nm / 8 * NUMBERS.late_windup_q3;
    slip->outran = inputs->cell ? thrown : ahead;
    if (slip->outran && slip->late < NUMBERS.late_most) {
        slip->late++;
    }
}

bool slip_direction_step(slip_direction_t *slip, const law_inputs_t *inputs, int32_t wanted_unm,
                         int32_t error_unm, bool declined) {
    const bool plans_move = choose_direction(slip, inputs, wanted_unm, error_unm, declined);
    notice_late_friction(slip, inputs);
    return plans_move;
}
