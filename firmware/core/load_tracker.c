/* load_tracker.c: see load_tracker.h. */
#include "load_tracker.h"

#include "fixed.h"

#define TAUS_PER_S 200                 /* a tremor's 10 Hz are three radians in 2 pi tau */
#define AHEAD_TAUS 2                   /* the motor turns friction over in two to three lags */
#define LEAST_PER_256 384              /* counts per tau: 1.5 */
#define BEHIND_MOST_Q8 (1 << 27)       /* 0.5 mm: three times that is in range */
#define SPEED_MOST_Q8 (1 << 29)        /* 8 m/s at 4 kHz */
#define ACCELERATION_MOST_Q8 (1 << 24) /* 1000 m/s^2 at 4 kHz */
#define COUNT_MOST_NM (1 << 22)

load_tracker_t load_tracker_of(uint32_t ticks_per_s, int32_t count_nm) {
    const int32_t tau = (int32_t)(ticks_per_s / TAUS_PER_S);
    return (load_tracker_t){
        .tau_ticks = tau,
        .least_q8_nm = fixed_clamp(count_nm, 1, COUNT_MOST_NM) * LEAST_PER_256 / tau,
    };
}

static int32_t within(int32_t value, int32_t most) {
    return fixed_clamp(value, -most, most);
}

void load_tracker_step(load_tracker_t *tracker, int32_t step_nm) {
    const int32_t tau = tracker->tau_ticks;
    const int32_t expected_q8 = tracker->speed_q8_nm + tracker->acceleration_q8_nm / 2;
    const int32_t surprise_q8 = within(step_nm, COUNT_MOST_NM) * 256 - expected_q8;
    const int32_t behind_q8 =
        within(tracker->behind_q8_nm + within(surprise_q8, BEHIND_MOST_Q8), BEHIND_MOST_Q8);
    /* three poles at 1/tau: gains 3/tau, 3/tau^2, 1/tau^3 */
    const int32_t part_q8 = behind_q8 / tau;
    const int32_t speed_q8 = tracker->speed_q8_nm + tracker->acceleration_q8_nm + 3 * part_q8 / tau;
    tracker->behind_q8_nm = behind_q8 - 3 * part_q8;
    tracker->speed_q8_nm = within(speed_q8, SPEED_MOST_Q8);
    tracker->acceleration_q8_nm =
        within(tracker->acceleration_q8_nm + part_q8 / (tau * tau), ACCELERATION_MOST_Q8);
}

int32_t load_tracker_direction(const load_tracker_t *tracker) {
    const int64_t ahead_ticks = (int64_t)AHEAD_TAUS * tracker->tau_ticks;
    const int64_t speed_q8 = tracker->speed_q8_nm + tracker->acceleration_q8_nm * ahead_ticks;
    return (speed_q8 > tracker->least_q8_nm) - (speed_q8 < -tracker->least_q8_nm);
}
