/* scaling.h: from converter codes to the units of board.h. Pure.
 *
 * A window holds the samples since the last control tick, five as a rule: their mean has more
 * resolution than one code, the noise of the amplifiers being the dither. Division rounds to
 * nearest, halves away from zero.
 */
#ifndef BOWDEN_STM32F405_SCALING_H
#define BOWDEN_STM32F405_SCALING_H

#include <stdbool.h>
#include <stdint.h>

/* Motor current: 0.1007 V/A around half the scale of 3.3 V: +-16.4 A. */
#define SCALING_CURRENT_ZERO_CODE 2048
#define SCALING_CURRENT_UA_PER_CODE 8000
/* Load cell: its counts are sixteenths of a code. */
#define SCALING_LOAD_CELL_ZERO_CODE 2048
#define SCALING_LOAD_CELL_COUNTS_PER_CODE 16
/* Bus voltage: divider to 41 V full scale. */
#define SCALING_BUS_MV_PER_CODE 10
/* Conduit temperature: TMP36, 500 mV at 0 degC and 10 mV/K; 3300 mV / 4096 a code. */
#define SCALING_TEMPERATURE_ZERO_MDEGC 50000

#define SCALING_WINDOW_MAX 16u /* samples; more are not added */

/* Sums of codes over `count` samples, 0 .. SCALING_WINDOW_MAX. */
typedef struct {
    uint32_t count;
    int32_t current, load_cell, bus_voltage, temperature;
} scaling_window_t;

/* In the units of board_sensors_t. */
typedef struct {
    int32_t motor_current_ua, load_cell_counts, bus_voltage_mv, conduit_temperature_mdegc;
} scaling_result_t;

/* Means of a window; false, and `result` untouched, for an empty one. */
bool scaling_window(const scaling_window_t *window, scaling_result_t *result);

/* One sample, for the current loop. */
static inline int32_t scaling_current_ua(int32_t code) {
    return (code - SCALING_CURRENT_ZERO_CODE) * SCALING_CURRENT_UA_PER_CODE;
}

static inline int32_t scaling_bus_mv(int32_t code) {
    return code * SCALING_BUS_MV_PER_CODE;
}

#endif
