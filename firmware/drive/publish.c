/* publish.c: see publish.h. */
#include "publish.h"

#include <stddef.h>

/* Of the places along a cable, model_tension_along_a: the one at the load, counted from 0. */
#define LAST_PLACE 10u

/* later - earlier of counters that may wrap; the compilers used define the cast as modulo 2^32. */
static int32_t counts_since(int32_t later, int32_t earlier) {
    return (int32_t)((uint32_t)later - (uint32_t)earlier);
}

void publish_sensors(drive_t *drive, const board_sensors_t *sensors) {
    const parameters_t *parameters = &drive->parameters;
    dictionary_t *dictionary = &drive->dictionary;
    uint32_t *count = &drive->saturations;
    dictionary->motor_encoder_counts = sensors->motor_encoder_counts;
    dictionary->load_encoder_counts = sensors->load_encoder_counts;
    dictionary->motor_angle_urad =
        fixed_scale(counts_since(sensors->motor_encoder_counts, drive->reference.motor_zero_counts),
                    parameters->motor_urad_per_count, count);
    dictionary->load_angle_urad =
        fixed_scale(counts_since(sensors->load_encoder_counts, drive->reference.load_zero_counts),
                    parameters->load_urad_per_count, count);
    const int32_t torque =
        fixed_scale(sensors->motor_current_ua, parameters->torque_per_current, count);
    dictionary->motor_torque_unm = fixed_clamp(torque, -PUBLISH_I24_MAX, PUBLISH_I24_MAX);
    const int32_t cell = fixed_scale(
        fixed_subtract(sensors->load_cell_counts, parameters->load_cell_zero_counts, count),
        parameters->load_cell_magnitude, count);
    const int32_t load_torque = parameters->load_cell_inverted ? -cell : cell;
    dictionary->load_torque_unm = fixed_clamp(load_torque, -PUBLISH_I24_MAX, PUBLISH_I24_MAX);
    /* without compensation the motor's position is not used: then it may turn without bound */
    uint32_t ignored = 0;
    uint32_t *motor_count = drive->rendering.law == COMPENSATION_LAW_NONE ? &ignored : count;
    drive->motor_arc_nm =
        fixed_scale(counts_since(sensors->motor_encoder_counts, drive->motor_zero_counts),
                    parameters->motor_arc_nm_per_count, motor_count);
    drive->load_arc_nm =
        fixed_scale(counts_since(sensors->load_encoder_counts, drive->load_zero_counts),
                    parameters->load_arc_nm_per_count, count);
    dictionary->motor_current_ua = sensors->motor_current_ua;
    dictionary->bus_voltage_mv = sensors->bus_voltage_mv;
    dictionary->conduit_temperature_mdegc = sensors->conduit_temperature_mdegc;
}

/* One place of each cable a tick: all of them in one would make it too long. */
static void publish_profile(drive_t *drive) {
    dictionary_t *dictionary = &drive->dictionary;
    const transmission_t *transmission = &drive->transmission;
    const cable_path_t *path = &transmission->path;
    const uint32_t place = drive->tension_place;
    const uint8_t node = (uint8_t)((place * path->segments + LAST_PLACE / 2u) / LAST_PLACE);
    dictionary->model_tension_along_a_un[place] =
        (uint32_t)cable_node_tension_un(&transmission->a, path, node);
    dictionary->model_tension_along_b_un[place] =
        (uint32_t)cable_node_tension_un(&transmission->b, path, node);
    drive->tension_place = place < LAST_PLACE ? (uint8_t)(place + 1u) : 0u;
}

void publish_model(drive_t *drive) {
    dictionary_t *dictionary = &drive->dictionary;
    transmission_t *transmission = &drive->transmission;
    uint32_t *count = &drive->saturations;
    if (rendering_publish(&drive->rendering, dictionary)) {
        supervision_tell_fallback(&drive->node, dictionary->compensation_fallback,
                                  dictionary->compensation_level);
    }
    if (!drive->configured) {
        return;
    }
    const int32_t zero_urad =
        fixed_scale(counts_since(drive->motor_zero_counts, drive->reference.motor_zero_counts),
                    drive->parameters.motor_urad_per_count, count);
    dictionary->model_motor_angle_urad =
        fixed_add(zero_urad, transmission_motor_angle_urad(transmission), count);
    dictionary->model_load_torque_unm = transmission_load_torque_unm(transmission);
    dictionary->model_tension_motor_a_un = (uint32_t)transmission->a.end[CABLE_PROXIMAL].tension_un;
    dictionary->model_tension_load_a_un = (uint32_t)transmission->a.end[CABLE_DISTAL].tension_un;
    dictionary->model_tension_motor_b_un = (uint32_t)transmission->b.end[CABLE_PROXIMAL].tension_un;
    dictionary->model_tension_load_b_un = (uint32_t)transmission->b.end[CABLE_DISTAL].tension_un;
    publish_profile(drive);
}

void publish_state(drive_t *drive, const board_sensors_t *sensors) {
    dictionary_t *dictionary = &drive->dictionary;
    const uint32_t by_model = drive->transmission.saturations;
    const uint32_t room = UINT32_MAX - by_model;
    dictionary->saturation_count =
        by_model + (drive->saturations < room ? drive->saturations : room);
    const bool no_taut = (drive->transmission.flags & TRANSMISSION_NO_TAUT_CABLE) != 0;
    uint16_t flags = drive->transmission.flags & (TRANSMISSION_SLACK_A | TRANSMISSION_SLACK_B);
    if (no_taut) {
        flags |= MODEL_FLAGS_NO_TAUT_CABLE;
    }
    if (dictionary->saturation_count > 0) {
        flags |= MODEL_FLAGS_SATURATED;
    }
    if (drive->command.limited) {
        flags |= MODEL_FLAGS_TORQUE_LIMIT;
    }
    dictionary->model_flags = flags;
    const supervision_t *supervision = &drive->supervision;
    uint16_t status = (uint16_t)(state_status_bits(drive->state) | STATUSWORD_REMOTE);
    if (sensors->bus_voltage_mv >= supervision->settings.bus_min_mv) {
        status |= STATUSWORD_VOLTAGE_ENABLED;
    }
    if (drive->command.limited) {
        status |= STATUSWORD_INTERNAL_LIMIT;
    }
    if (supervision->settings.deadline_ticks == 0) {
        status |= STATUSWORD_NO_DEADLINE;
    }
    if (drive_is_halted(drive) && drive->command.torque_unm == 0) {
        status |= STATUSWORD_TARGET_REACHED;
    }
    dictionary->statusword = status;
    dictionary->supervision_present = supervision->present;
    dictionary->supervision_latched = supervision->latched;
    dictionary->fault_reset_refused = supervision->refused;
    const bool own_limit = supervision->limits.torque_unm >= drive->parameters.torque.limit_unm;
    const uint8_t acting = own_limit ? LIMITS_ACTIVE_MOTOR_TORQUE : supervision->limits.acting;
    dictionary->limits_active = drive->command.limited ? acting : 0;
    dictionary->mode_of_operation_display = dictionary->mode_of_operation;
    dictionary->motor_torque_command_unm = drive->command.torque_unm;
    dictionary->tx_overflow_count = node_tx_overflow_count(&drive->node);
}

void publish_sample(drive_t *drive, const board_sensors_t *sensors) {
    dictionary_t *dictionary = &drive->dictionary;
    if (node_sample_due(&drive->node, sensors->time_us)) {
        dictionary->sample_counter++;
        dictionary->sample_counter_low = (uint8_t)dictionary->sample_counter;
        dictionary->device_time_us = sensors->time_us;
    }
}

void publish_winding(drive_t *drive, const board_winding_t *winding, bool traces) {
    dictionary_t *dictionary = &drive->dictionary;
    if (traces) {
        dictionary->winding_test_state = WINDING_TEST_STATE_UNDER_WAY;
    } else if (dictionary->winding_test_state == WINDING_TEST_STATE_UNDER_WAY) {
        const bool done = winding->trace_ua != NULL;
        dictionary->winding_test_state = done ? WINDING_TEST_STATE_DONE : WINDING_TEST_STATE_FAILED;
        dictionary->winding_test_voltage_uv = winding->voltage_uv;
        for (uint32_t i = 0; done && i < BOARD_WINDING_SAMPLES; i++) {
            dictionary->winding_trace_ua[i] = winding->trace_ua[i];
        }
    }
}
