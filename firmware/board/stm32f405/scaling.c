/* scaling.c: see scaling.h. */
#include "scaling.h"

/* numerator / denominator, denominator > 0, to nearest, halves away from zero. */
static int32_t divide(int32_t numerator, int32_t denominator) {
    const int32_t half = denominator / 2;
    return (numerator >= 0 ? numerator + half : numerator - half) / denominator;
}

bool scaling_window(const scaling_window_t *window, scaling_result_t *result) {
    const int32_t count = (int32_t)window->count;
    if (count == 0) {
        return false;
    }
    /* Largest numerators, of 16 samples: 2.6e8, 5.2e5, 6.6e5 and 1.4e9. */
    const int32_t current = window->current - count * SCALING_CURRENT_ZERO_CODE;
    const int32_t load_cell = window->load_cell - count * SCALING_LOAD_CELL_ZERO_CODE;
    *result = (scaling_result_t){
        .motor_current_ua = divide(current * SCALING_CURRENT_UA_PER_CODE, count),
        .load_cell_counts = divide(load_cell * SCALING_LOAD_CELL_COUNTS_PER_CODE, count),
        .bus_voltage_mv = divide(window->bus_voltage * SCALING_BUS_MV_PER_CODE, count),
        /* 3300 mV / 4096 * 100 mdegC/mV = 20625 / 256 mdegC a code */
        .conduit_temperature_mdegc =
            divide(window->temperature * 20625, 256 * count) - SCALING_TEMPERATURE_ZERO_MDEGC,
    };
    return true;
}
