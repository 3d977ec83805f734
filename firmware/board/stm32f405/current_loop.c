/* current_loop.c: see current_loop.h. Voltages in microvolts: at most 41e6. */
#include "current_loop.h"

/* Voltages beyond it, 536 V, are all alike: far beyond any supply, within 32 bits in each sum. */
#define VOLTAGE_MAX_UV (1 << 29)

/* A zero of the controller that is faster than the converter samples would ring. */
#define KI_PER_KP_MAX_Q16 32768u

current_loop_gains_t current_loop_gains(uint32_t resistance_uohm, uint32_t inductance_nh) {
    /* 2 pi 1000 Hz 1 nH and 2 pi 1000 Hz 1 uohm 50 us, in 2^-16 V/A */
    const uint32_t kp_q16 = (uint32_t)((uint64_t)inductance_nh * 411775u / 1000000u);
    const uint32_t ki_q16 = (uint32_t)((uint64_t)resistance_uohm * 20589u / 1000000u);
    const uint32_t ratio_q16 = (uint32_t)((uint64_t)resistance_uohm * 32768u / 10u / inductance_nh);
    const bool fits = ratio_q16 <= KI_PER_KP_MAX_Q16;
    return (current_loop_gains_t){
        .kp_q16 = (int32_t)kp_q16,
        .ki_q16 = (int32_t)(fits ? ki_q16 : kp_q16 / 2u),
        .ki_per_kp_q16 = (int32_t)(fits ? ratio_q16 : KI_PER_KP_MAX_Q16),
    };
}

static int32_t clamp(int32_t value, int32_t limit) {
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* value * gain / 2^16, to nearest, halves away from zero: a shift rounds towards minus infinity, so
 * a negative product gets a little less than a half. The limit is seen in the product's high word.
 */
static int32_t scale(int32_t value, int32_t gain_q16) {
    const int64_t product = (int64_t)value * gain_q16;
    const int32_t high = (int32_t)(product >> 32);
    if (high >= VOLTAGE_MAX_UV >> 16 || high < -(VOLTAGE_MAX_UV >> 16)) {
        return high < 0 ? -VOLTAGE_MAX_UV : VOLTAGE_MAX_UV;
    }
    return (int32_t)((product + 32768 + (high >> 31)) >> 16);
}

int32_t current_loop_step(current_loop_t *loop, const current_loop_gains_t *gains,
                          int32_t reference_ua, int32_t current_ua, int32_t bus_mv) {
    if (bus_mv < CURRENT_LOOP_BUS_MIN_MV) {
        loop->integral_uv = 0;
        return 0;
    }
    const int32_t error_ua = clamp(reference_ua, CURRENT_LOOP_REFERENCE_MAX_UA) - current_ua;
    const int32_t limit_uv = bus_mv * (1000 / 20 * 19); /* 95 % of the supply */
    const int32_t wanted_uv = scale(error_ua, gains->kp_q16) + loop->integral_uv;
    const int32_t voltage_uv = clamp(wanted_uv, limit_uv);
    /* The error that the output at its limit can mend is smaller by excess / Kp; only that is
     * integrated (Hanus' conditioning). */
    const int32_t excess_uv = wanted_uv - voltage_uv;
    loop->integral_uv = clamp(loop->integral_uv + scale(error_ua, gains->ki_q16) -
                                  scale(excess_uv, gains->ki_per_kp_q16),
                              limit_uv);
    return clamp(voltage_uv / 1000 * CURRENT_LOOP_TOP / bus_mv, CURRENT_LOOP_DUTY_MAX);
}
