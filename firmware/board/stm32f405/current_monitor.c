/* current_monitor.c: see current_monitor.h. */
#include "current_monitor.h"

#define PERIOD_NS 50000u
#define FORGETS_SHIFT 3 /* eight periods */
#define BEGINS 3u       /* samples until voltage and current are of the same period */
/* Of the supply: two legs lose 0.5 us each in 50 us, against the current. */
#define DEAD_TIME_SHARE 50
/* Within it, the converter's noise, the dead time has no direction. */
#define DIRECTION_UA 100000

current_monitor_motor_t current_monitor_motor(uint32_t resistance_uohm, uint32_t inductance_nh) {
    const uint64_t per_uv_q16 = (uint64_t)PERIOD_NS * 65536u / inductance_nh;
    return (current_monitor_motor_t){
        .per_uv_q16 = (int32_t)per_uv_q16,
        .per_ua_q16 = (int32_t)(per_uv_q16 * resistance_uohm / 1000000u),
    };
}

/* Towards minus infinity: half a microampere does not matter here, and a division would. */
static int32_t q16(int32_t value, int32_t factor_q16) {
    return (int32_t)((int64_t)value * factor_q16 >> 16);
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

bool current_monitor_step(current_monitor_t *monitor, const current_monitor_motor_t *motor,
                          int32_t current_ua, int32_t bus_mv) {
    const int32_t change_ua = current_ua - monitor->current_ua;
    const int32_t mean_ua = monitor->current_ua + change_ua / 2;
    const int32_t lost_uv = bus_mv * (1000 / DEAD_TIME_SHARE);
    const int32_t dead_uv = mean_ua > DIRECTION_UA    ? lost_uv
                            : mean_ua < -DIRECTION_UA ? -lost_uv
                                                      : 0;
    const int32_t driving_uv = monitor->last_uv - dead_uv - motor->back_emf_uv;
    monitor->last_uv = monitor->next_uv;
    monitor->current_ua = current_ua;
    if (monitor->samples < BEGINS) {
        monitor->samples++;
        return false;
    }
    const int32_t follows_ua = q16(driving_uv, motor->per_uv_q16) - q16(mean_ua, motor->per_ua_q16);
    monitor->off_ua += change_ua - follows_ua - (monitor->off_ua >> FORGETS_SHIFT);
    const int32_t allowed_ua =
        CURRENT_MONITOR_LIMIT_UA + magnitude(current_ua) / 5 * 2 + motor->uncertain_ua;
    return magnitude(monitor->off_ua) > allowed_ua;
}

void current_monitor_note(current_monitor_t *monitor, int32_t duty, int32_t bus_mv) {
    monitor->next_uv = duty * bus_mv / 21 * 5; /* 1000 uV a mV over 4200 counts */
}
