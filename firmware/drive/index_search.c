/* index_search.c: see index_search.h. Counts may wrap like the encoders'. */
#include "index_search.h"

static int32_t less(int32_t a, int32_t b) {
    return (int32_t)((uint32_t)a - (uint32_t)b);
}

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

void index_search_step(index_search_t *search, const board_sensors_t *sensors, bool wanted) {
    if (wanted && !search->seeks) {
        search->motor.passed = false;
        search->load.passed = false;
    }
    search->seeks = wanted;
    if (sensors->motor_index.passed) {
        search->motor = sensors->motor_index;
    }
    if (sensors->load_index.passed) {
        search->load = sensors->load_index;
    }
}

index_zero_t index_search_zero(const index_search_t *search,
                               const index_search_settings_t *settings,
                               const board_sensors_t *sensors) {
    if (!search->seeks || !search->motor.passed || !search->load.passed) {
        return (index_zero_t){.holds = false};
    }
    const int32_t load_zero = less(search->load.counts, settings->load_position_counts);
    const int32_t motor_zero = less(search->motor.counts, settings->motor_position_counts);
    uint32_t saturations = 0;
    const int32_t turn_nm = fixed_scale(settings->motor_counts_per_turn,
                                        settings->motor_arc_nm_per_count, &saturations);
    const int32_t load_nm = fixed_scale(less(sensors->load_encoder_counts, load_zero),
                                        settings->load_arc_nm_per_count, &saturations);
    const int32_t motor_nm = fixed_scale(less(sensors->motor_encoder_counts, motor_zero),
                                         settings->motor_arc_nm_per_count, &saturations);
    const int32_t apart_nm = fixed_subtract(motor_nm, load_nm, &saturations);
    if (saturations > 0 || turn_nm <= 0) {
        return (index_zero_t){.holds = false};
    }
    const int32_t half_nm = apart_nm < 0 ? -(turn_nm / 2) : turn_nm / 2;
    const int32_t turns = fixed_add(apart_nm, half_nm, &saturations) / turn_nm;
    const int32_t rest_nm = apart_nm - turns * turn_nm;
    return (index_zero_t){
        .holds = magnitude(rest_nm) <= turn_nm / 4,
        .motor_counts = less(motor_zero, -turns * settings->motor_counts_per_turn),
        .load_counts = load_zero,
    };
}
