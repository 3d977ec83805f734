/* current_loop.c: see current_loop.h. Voltages in microvolts: at most 41e6. */
#include "current_loop.h"

/* Volt per ampere, in 2^-16: 2 pi 1000 Hz 0.3 mH = 1.885; 2 pi 1000 Hz 0.6 ohm 50 us = 0.1885. */
#define KP_Q16 123534
#define KI_Q16 12353
#define KI_PER_KP_Q16 6554

static int32_t clamp(int32_t value, int32_t limit) {
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* value * gain / 2^16, to nearest. */
static int32_t scale(int32_t value, int32_t gain_q16) {
    const int64_t product = (int64_t)value * gain_q16;
    return (int32_t)((product + (product >= 0 ? 32768 : -32768)) / 65536);
}

int32_t current_loop_step(current_loop_t *loop, int32_t reference_ua, int32_t current_ua,
                          int32_t bus_mv) {
    if (bus_mv < CURRENT_LOOP_BUS_MIN_MV) {
        loop->integral_uv = 0;
        return 0;
    }
    const int32_t error_ua = clamp(reference_ua, CURRENT_LOOP_REFERENCE_MAX_UA) - current_ua;
    const int32_t limit_uv = bus_mv * (1000 / 20 * 19); /* 95 % of the supply */
    const int32_t wanted_uv = scale(error_ua, KP_Q16) + loop->integral_uv;
    const int32_t voltage_uv = clamp(wanted_uv, limit_uv);
    /* The error that the output at its limit can mend is smaller by excess / Kp; only that is
     * integrated (Hanus' conditioning). */
    const int32_t excess_uv = wanted_uv - voltage_uv;
    loop->integral_uv = clamp(
        loop->integral_uv + scale(error_ua, KI_Q16) - scale(excess_uv, KI_PER_KP_Q16), limit_uv);
    return clamp(voltage_uv / 1000 * CURRENT_LOOP_TOP / bus_mv, CURRENT_LOOP_DUTY_MAX);
}
