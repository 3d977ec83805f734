/* motor_speed.c: see motor_speed.h. */
#include "motor_speed.h"

#include "../board.h"

/* 2 pi rad a turn and 1e6 us a second over 2 ms, times 1e6 for the division. */
#define TWO_PI_1E6 UINT64_C(6283185)
#define WINDOW_US (MOTOR_SPEED_TICKS * BOARD_CONTROL_PERIOD_US)

/* A change that is seen by so much may go on: the sum of the monitor holds eight periods of it. */
#define PERIODS 8
#define MOST_UV 40000000

static int32_t limited(int64_t uv) {
    return (int32_t)(uv > MOST_UV ? MOST_UV : uv < -MOST_UV ? -MOST_UV : uv);
}

void motor_speed_step(motor_speed_t *speed, int32_t counts, uint32_t constant_unm_per_a,
                      uint32_t counts_per_turn, current_monitor_motor_t *motor) {
    if (constant_unm_per_a != speed->constant_unm_per_a ||
        counts_per_turn != speed->counts_per_turn) {
        speed->constant_unm_per_a = constant_unm_per_a;
        speed->counts_per_turn = counts_per_turn;
        speed->uv_per_count =
            limited((int64_t)(TWO_PI_1E6 * constant_unm_per_a / WINDOW_US / counts_per_turn));
    }
    const uint32_t before = (speed->next + MOTOR_SPEED_TICKS) % (2u * MOTOR_SPEED_TICKS);
    const uint32_t oldest = (uint32_t)speed->counts[speed->next];
    const uint32_t middle = (uint32_t)speed->counts[before];
    const int32_t now = (int32_t)((uint32_t)counts - middle);
    const int32_t change = now - (int32_t)(middle - oldest);
    speed->counts[speed->next] = counts;
    speed->next = (speed->next + 1u) % (2u * MOTOR_SPEED_TICKS);
    motor->back_emf_uv = limited((int64_t)now * speed->uv_per_count);
    const int32_t change_uv =
        limited((int64_t)(change < 0 ? -change : change) * speed->uv_per_count);
    motor->uncertain_ua = (int32_t)((int64_t)change_uv * motor->per_uv_q16 * PERIODS / 65536);
}
