/* homing.c: see homing.h. */
#include "homing.h"

static bool from_index(drive_t *drive, const board_sensors_t *sensors) {
    const dictionary_t *dictionary = &drive->dictionary;
    const index_zero_t zero = index_search_zero(
        &drive->index_search,
        &(index_search_settings_t){
            .motor_position_counts = dictionary->index_position_motor_counts,
            .load_position_counts = dictionary->index_position_load_counts,
            .motor_counts_per_turn = (int32_t)dictionary->motor_encoder_resolution_counts_per_turn,
            .motor_arc_nm_per_count = drive->parameters.motor_arc_nm_per_count,
            .load_arc_nm_per_count = drive->parameters.load_arc_nm_per_count,
        },
        sensors);
    if (zero.holds) {
        reference_set(&drive->reference, zero.motor_counts, zero.load_counts,
                      ANGLE_REFERENCE_INDEXED);
    }
    return zero.holds;
}

/* From the zero of the angles; modulo 2^32, like the counts. */
static int32_t found_counts(const board_index_t *index, int32_t zero_counts) {
    return index->passed ? (int32_t)((uint32_t)index->counts - (uint32_t)zero_counts) : INT32_MIN;
}

/* With the bridge on nothing is set: a zero that jumps would move the tunnel. */
void homing_step(drive_t *drive, const board_sensors_t *sensors) {
    dictionary_t *dictionary = &drive->dictionary;
    reference_t *reference = &drive->reference;
    const uint8_t asked = state_bridge_on(drive->state) ? HOMING_NONE : dictionary->homing;
    reference_step(reference, sensors->motor_encoder_counts, sensors->load_encoder_counts);
    index_search_step(&drive->index_search, sensors, asked == HOMING_INDEX);
    dictionary->homing = HOMING_NONE;
    if (asked == HOMING_HERE) {
        reference_set(reference, sensors->motor_encoder_counts, sensors->load_encoder_counts,
                      ANGLE_REFERENCE_HOMED);
    } else if (asked == HOMING_INDEX && !from_index(drive, sensors)) {
        dictionary->homing = HOMING_INDEX;
    }
    dictionary->angle_reference = (uint8_t)reference->state;
    dictionary->index_found_motor_counts =
        found_counts(&drive->index_search.motor, reference->motor_zero_counts);
    dictionary->index_found_load_counts =
        found_counts(&drive->index_search.load, reference->load_zero_counts);
}
