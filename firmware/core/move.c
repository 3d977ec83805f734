/* move.c: see move.h. */
#include "move.h"

#include "fixed.h"

#define LAST_LAGS 8        /* after which 3/1000 are left */
#define SWIFT_LEAST 128    /* a of 1/2 */
#define SWIFT_MOST 768     /* a of 3: faster than waves run along the cables helps no more */
#define ROOT_BITS 9        /* of the root of SWIFT_MOST in Q8 */
#define MOST_UNM (1 << 26) /* 67 N m: all sums of (M2) stay in range */

move_t move_of(int32_t lag_ticks, int32_t limit_unm, int32_t damping_per_s, uint32_t ticks_per_s) {
    const int64_t square = (int64_t)lag_ticks * lag_ticks * 256;
    uint32_t saturations = 0; /* a resonance so slow is none */
    return (move_t){
        .lag_ticks = lag_ticks,
        .limit_unm = limit_unm,
        .damping_q8_ticks =
            fixed_saturate(square * damping_per_s / (int64_t)ticks_per_s, &saturations),
    };
}

/* What of a torque the motor can hold. */
static int32_t within_limit(const move_t *move, int32_t torque_unm) {
    const int32_t limit_unm = fixed_clamp(move->limit_unm, 0, MOST_UNM);
    return fixed_clamp(torque_unm, -limit_unm, limit_unm);
}

/* x of what is held, and back: one cable alone stretches twice as far. */
static int32_t place(const move_t *move, int32_t held_unm) {
    const int32_t held = fixed_clamp(held_unm, -MOST_UNM, MOST_UNM);
    return 2 * held - fixed_clamp(held, -move->slack_unm, move->slack_unm);
}

static int32_t held(const move_t *move, int32_t place_unm) {
    return (place_unm + fixed_clamp(place_unm, -move->slack_unm, move->slack_unm)) / 2;
}

void move_start(move_t *move, int32_t from_unm, int32_t to_unm, int32_t slack_unm) {
    move->slack_unm = fixed_clamp(slack_unm, 0, MOST_UNM);
    if (!move_runs(move)) {
        move->at_unm[0] = place(move, from_unm);
        move->at_unm[1] = move->at_unm[0];
    }
    const int32_t way_unm = place(move, within_limit(move, to_unm)) - move->at_unm[1];
    const int32_t size_unm = way_unm < 0 ? -way_unm : way_unm;
    const int32_t limit_unm = fixed_clamp(move->limit_unm, 0, MOST_UNM);
    /* a in Q8: the way in 256ths is at least 1 */
    move->swift_q8 = fixed_clamp(limit_unm / (size_unm / 256 + 1), SWIFT_LEAST, SWIFT_MOST);
    const int32_t root_q8 = (int32_t)fixed_root((uint32_t)move->swift_q8 * 256u, ROOT_BITS);
    const int32_t ticks = move->lag_ticks * 256 / root_q8;
    move->ticks = ticks > 0 ? ticks : 1;
    move->left_ticks = LAST_LAGS * move->ticks;
}

int32_t move_step(move_t *move, int32_t to_unm) {
    const int32_t to = place(move, within_limit(move, to_unm));
    int32_t *at = move->at_unm;
    at[0] += (to - at[0]) / move->ticks;
    at[1] += (at[0] - at[1]) / move->ticks;
    const int32_t slope = at[0] - at[1];
    const int32_t curve = to - at[0] - slope;
    move->inertia_unm = (int32_t)((int64_t)move->swift_q8 * curve / 256);
    uint32_t saturations = 0; /* the motor's limit is far below */
    const int64_t damped_q8 = (int64_t)(move->damping_q8_ticks / move->ticks) * slope;
    const int32_t damped_unm = fixed_saturate(damped_q8 / 256, &saturations);
    if (--move->left_ticks <= 0) {
        move->ticks = 0;
    }
    return fixed_add(fixed_add(held(move, at[1]), move->inertia_unm, &saturations), damped_unm,
                     &saturations);
}

int32_t move_static_unm(const move_t *move) {
    return held(move, move->at_unm[1]);
}

void move_end(move_t *move) {
    move->ticks = 0;
    move->inertia_unm = 0;
}

bool move_runs(const move_t *move) {
    return move->ticks > 0;
}
