/* limits.c: see limits.h. */
#include "limits.h"

#include "../../meanings.h"

/* The conduit's limit takes the torque away over so much before it. */
#define CONDUIT_BAND_MDEGC 10000

void limits_configure(limits_t *limits, const dictionary_t *dictionary, int32_t board_ua) {
    limits->board_ua = board_ua > 0 ? board_ua : INT32_MAX;
    limits->torque_per_current = ratio_of(dictionary->torque_constant_unm_per_a, 1000000);
    limits->meter = (heat_meter_t){0}; /* the next tick combines them anew */
    limits->conduit_mdegc = (int32_t)dictionary->conduit_temperature_limit_mdegc;
    heat_configure(&limits->motor, dictionary->motor_current_continuous_ua,
                   dictionary->motor_thermal_time_ms);
    heat_configure(&limits->bridge, dictionary->bridge_current_continuous_ua,
                   dictionary->bridge_thermal_time_ms);
}

/* The smallest of what the parts allow. */
static void combine(limits_t *limits, int32_t conduit_mdegc) {
    uint32_t saturations = 0; /* a torque beyond 2 kN m is as good as no limit */
    const int32_t by_motor_ua = heat_limit_ua(&limits->motor, limits->board_ua);
    const int32_t by_bridge_ua = heat_limit_ua(&limits->bridge, limits->board_ua);
    int32_t most_ua = limits->board_ua;
    limits->acting = LIMITS_ACTIVE_BOARD_CURRENT;
    if (by_motor_ua < most_ua) {
        most_ua = by_motor_ua;
        limits->acting = LIMITS_ACTIVE_MOTOR_HEAT;
    }
    if (by_bridge_ua < most_ua) {
        most_ua = by_bridge_ua;
        limits->acting = LIMITS_ACTIVE_BRIDGE_HEAT;
    }
    limits->torque_unm = fixed_scale(most_ua, limits->torque_per_current, &saturations);
    const int32_t room_mdegc = limits->conduit_mdegc - conduit_mdegc;
    if (room_mdegc < CONDUIT_BAND_MDEGC) {
        const int32_t share_mdegc = room_mdegc > 0 ? room_mdegc : 0;
        limits->torque_unm =
            (int32_t)((int64_t)limits->torque_unm * share_mdegc / CONDUIT_BAND_MDEGC);
        limits->acting = LIMITS_ACTIVE_CONDUIT_HEAT;
    }
}

void limits_step(limits_t *limits, int32_t motor_current_ua, int32_t conduit_mdegc) {
    heat_measure(&limits->meter, motor_current_ua);
    switch (limits->meter.ticks) {
    case 0:
        heat_step(&limits->motor, limits->meter.mean_ma2);
        break;
    case HEAT_STEP_TICKS / 4:
        heat_step(&limits->bridge, limits->meter.mean_ma2);
        break;
    case HEAT_STEP_TICKS / 2:
    case 1: /* also in the first tick of all */
        combine(limits, conduit_mdegc);
        break;
    default:
        break;
    }
}
