/* index_search.h: the zero of both angles from the index pulses of the encoders.
 *
 * The load's index comes once in its range, so it says where the load is. The motor's comes in
 * every turn; which turn it was follows from the load, because the cables hold both ends together
 * within their stretch, far less than a turn of the motor. Where they are further apart than a
 * quarter of a turn (a cable is off or slack) nothing is concluded, and the search goes on.
 *
 * A pulse counts where it begins in positive direction. At 4000 counts per turn and 20 rad/s,
 * faster than an operator moves, the latency of its interrupt (at most 6 us) is a thirteenth of a
 * count.
 *
 * Pure.
 */
#ifndef BOWDEN_DRIVE_INDEX_SEARCH_H
#define BOWDEN_DRIVE_INDEX_SEARCH_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"
#include "../core/fixed.h"

/* Where the index pulses lie, and what a count is. */
typedef struct {
    int32_t motor_position_counts, load_position_counts; /* of the index, from the zero */
    int32_t motor_counts_per_turn;
    ratio_t motor_arc_nm_per_count, load_arc_nm_per_count;
} index_search_settings_t;

typedef struct {
    bool seeks;
    board_index_t motor, load; /* passed since the start, or since the search began */
} index_search_t;

/* Counts of the encoders at the zero of the angles. */
typedef struct {
    bool holds;
    int32_t motor_counts, load_counts;
} index_zero_t;

/* One tick. `wanted`: a host wants the zero; the search begins when it did not before. */
void index_search_step(index_search_t *search, const board_sensors_t *sensors, bool wanted);

/* The zero, once both pulses have come since the search began. */
index_zero_t index_search_zero(const index_search_t *search,
                               const index_search_settings_t *settings,
                               const board_sensors_t *sensors);

#endif
