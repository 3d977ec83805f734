/* heat.c: see heat.h. */
#include "heat.h"

#include "../../board/board.h"

#define ONE_Q24 (INT64_C(1) << 24)
#define LIMITS_FROM_Q24 (ONE_Q24 * 9 / 10)
#define EXCESSIVE_Q24 (ONE_Q24 * 11 / 10)
#define MOST_Q24 (ONE_Q24 << 14) /* keeps products within 64 bits */
#define MOST_MA 65000u
#define STEP_US (HEAT_STEP_TICKS * BOARD_CONTROL_PERIOD_US)

void heat_configure(heat_t *heat, uint32_t continuous_ua, uint32_t time_ms) {
    const uint64_t square_ma2 = (uint64_t)(continuous_ua / 1000u) * (continuous_ua / 1000u);
    heat->continuous_ua = (int32_t)continuous_ua;
    heat->per_ma2_q40 = (UINT64_C(1) << 40) / square_ma2;
    heat->share_q24 = (uint32_t)((uint64_t)ONE_Q24 * STEP_US / (1000u * (uint64_t)time_ms));
}

void heat_measure(heat_meter_t *meter, int32_t current_ua) {
    const uint32_t magnitude_ma = (uint32_t)(current_ua < 0 ? -current_ua : current_ua) / 1000u;
    const uint32_t current_ma = magnitude_ma < MOST_MA ? magnitude_ma : MOST_MA;
    meter->sum_ma2 += current_ma * current_ma; /* 65000^2 fits */
    meter->ticks++;
    if (meter->ticks == HEAT_STEP_TICKS) {
        meter->mean_ma2 = (uint32_t)(meter->sum_ma2 / HEAT_STEP_TICKS);
        meter->sum_ma2 = 0;
        meter->ticks = 0;
    }
}

void heat_step(heat_t *heat, uint32_t mean_ma2) {
    const int64_t wanted_q24 = (int64_t)(mean_ma2 * heat->per_ma2_q40 >> 16);
    const int64_t reached_q24 = wanted_q24 < MOST_Q24 ? wanted_q24 : MOST_Q24;
    heat->heat_q24 += (reached_q24 - heat->heat_q24) * heat->share_q24 / ONE_Q24;
}

int32_t heat_limit_ua(const heat_t *heat, int32_t most_ua) {
    if (heat->heat_q24 < LIMITS_FROM_Q24 || most_ua <= heat->continuous_ua) {
        return most_ua;
    }
    const int64_t room_q24 = heat->heat_q24 < ONE_Q24 ? ONE_Q24 - heat->heat_q24 : 0;
    const int64_t more_ua = (int64_t)(most_ua - heat->continuous_ua) * room_q24 * 10 / ONE_Q24;
    return heat->continuous_ua + (int32_t)more_ua;
}

bool heat_is_excessive(const heat_t *heat) {
    return heat->heat_q24 > EXCESSIVE_Q24;
}
