/* drive.c: see drive.h. */
#include "drive.h"

#include "supervision.h"

#define TICKS_PER_SECOND (1000000u / BOARD_CONTROL_PERIOD_US)

/* A host writes many entries in a row; the model starts anew once, 50 ms after the last. */
#define SETTLED_TICKS (TICKS_PER_SECOND / 20u)

#define I24_MAX 8388607

/* Tells the host where the configuration comes from, and warns unless it is all that was saved by
 * this firmware. Detail: the first entry that was not taken, the outcome in the high byte. */
static void tell_origin(drive_t *drive, storage_report_t report) {
    dictionary_t *dictionary = &drive->dictionary;
    dictionary->configuration_origin_outcome = (uint8_t)report.outcome;
    dictionary->configuration_origin_first_entry = report.first;
    dictionary->configuration_origin_entries = report.entries;
    dictionary->configuration_origin_schema_hash = report.schema_hash;
    if (report.outcome != CONFIGURATION_ORIGIN_OUTCOME_DEFAULTS &&
        report.outcome != CONFIGURATION_ORIGIN_OUTCOME_COMPLETE) {
        node_error_set(&drive->node, EMCY_CONFIGURATION_CHANGED,
                       EMCY_CONFIGURATION_CHANGED_REGISTER,
                       (uint32_t)report.outcome << 24 | report.first);
    }
}

void drive_init(drive_t *drive, const board_identity_t *identity) {
    /* No configuration has these revisions: the first tick takes the defaults. */
    *drive = (drive_t){
        .state = STATE_NOT_READY_TO_SWITCH_ON,
        .configured_revision = UINT32_MAX,
        .seen_revision = UINT32_MAX,
    };
    node_init(&drive->node, DICTIONARY, DICTIONARY_COUNT, &drive->dictionary, identity->node_id, 0);
    dictionary_t *dictionary = &drive->dictionary;
    dictionary->identity_serial_number = identity->serial_number;
    dictionary->reset_cause = (uint8_t)identity->reset;
    dictionary->crash_record_crashes = identity->crash.crashes;
    dictionary->crash_record_cause = identity->crash.cause;
    dictionary->crash_record_program_counter = identity->crash.program_counter;
    dictionary->crash_record_stack_pointer = identity->crash.stack_pointer;
    dictionary->crash_record_tick = identity->crash.tick;
    tell_origin(drive, saving_recall(&drive->saving, &drive->node, identity));
}

bool drive_transmit(drive_t *drive, can_frame_t *frame) {
    return node_transmit(&drive->node, frame);
}

/* ---- what the host commands ---- */

static bool is_powered(drive_state_t state) {
    return state == STATE_SWITCHED_ON || state_bridge_on(state);
}

static bool is_operational(const drive_t *drive) {
    return node_state(&drive->node) == NMT_OPERATIONAL;
}

static void note_command(drive_t *drive) {
    command_note(&drive->asked, drive->state, drive->dictionary.controlword, is_operational(drive));
}

static state_command_t effective_command(const drive_t *drive) {
    return command_in_force(&drive->asked, drive->state, is_operational(drive),
                            drive->parameters.quick_stop_ramps);
}

static bool is_halted(const drive_t *drive) {
    return drive->state == STATE_OPERATION_ENABLED &&
           (drive->dictionary.controlword & CONTROLWORD_HALT) != 0;
}

void drive_receive(drive_t *drive, const can_frame_t *frame) {
    node_receive(&drive->node, frame);
    uint16_t withheld = 0;
    if (node_take_withheld(&drive->node, &withheld) && command_is_stop(drive->state, withheld)) {
        drive->dictionary.controlword = withheld;
    }
    note_command(drive);
}

/* Does this command lead to the next higher state? Then the configuration must stand. */
static bool leads_up(drive_state_t state, state_command_t command) {
    return (state == STATE_READY_TO_SWITCH_ON &&
            (command == COMMAND_SWITCH_ON || command == COMMAND_ENABLE_OPERATION)) ||
           (state == STATE_SWITCHED_ON && command == COMMAND_ENABLE_OPERATION);
}

/* ---- configuration ---- */

/* Takes the dictionary's configuration; the model starts from a virgin rig at the present angles.
 */
static void configure(drive_t *drive, const board_sensors_t *sensors) {
    dictionary_t *dictionary = &drive->dictionary;
    drive->configured_revision = drive->node.od.config_revision;
    drive->parameters = parameters_of(dictionary);
    drive->configured = false;
    drive->saturations = 0;
    if (dictionary->configuration_error == 0) {
        const transmission_settings_t settings = parameters_transmission(dictionary);
        drive->configured = transmission_configure(&drive->transmission, &settings);
    }
    rendering_configure(&drive->rendering, dictionary, &drive->transmission, drive->configured);
    drive->motor_zero_counts = sensors->motor_encoder_counts;
    drive->load_zero_counts = sensors->load_encoder_counts;
}

/* While the bridge is off: takes a changed configuration when it has settled, before the next step
 * up, or in the first tick. Returns true in the tick that takes it. */
static bool follow_configuration(drive_t *drive, const board_sensors_t *sensors) {
    if (state_bridge_on(drive->state)) {
        return false;
    }
    const uint32_t revision = drive->node.od.config_revision;
    if (revision != drive->seen_revision) {
        drive->seen_revision = revision;
        drive->settled_ticks = 0;
        drive->dictionary.configuration_error = parameters_defect(&drive->dictionary);
    } else if (drive->settled_ticks < SETTLED_TICKS) {
        drive->settled_ticks++;
    }
    const bool now = drive->state == STATE_NOT_READY_TO_SWITCH_ON ||
                     leads_up(drive->state, effective_command(drive));
    if (revision == drive->configured_revision || !(now || drive->settled_ticks == SETTLED_TICKS)) {
        return false;
    }
    configure(drive, sensors);
    return true;
}

/* ---- measured quantities ---- */

/* later - earlier of counters that may wrap; the compilers used define the cast as modulo 2^32. */
static int32_t counts_since(int32_t later, int32_t earlier) {
    return (int32_t)((uint32_t)later - (uint32_t)earlier);
}

static void publish_sensors(drive_t *drive, const board_sensors_t *sensors) {
    const parameters_t *parameters = &drive->parameters;
    dictionary_t *dictionary = &drive->dictionary;
    uint32_t *count = &drive->saturations;
    dictionary->motor_encoder_counts = sensors->motor_encoder_counts;
    dictionary->load_encoder_counts = sensors->load_encoder_counts;
    dictionary->motor_angle_urad =
        fixed_scale(sensors->motor_encoder_counts, parameters->motor_urad_per_count, count);
    dictionary->load_angle_urad =
        fixed_scale(sensors->load_encoder_counts, parameters->load_urad_per_count, count);
    const int32_t torque =
        fixed_scale(sensors->motor_current_ua, parameters->torque_per_current, count);
    dictionary->motor_torque_unm = fixed_clamp(torque, -I24_MAX, I24_MAX);
    const int32_t cell = fixed_scale(
        fixed_subtract(sensors->load_cell_counts, parameters->load_cell_zero_counts, count),
        parameters->load_cell_magnitude, count);
    const int32_t load_torque = parameters->load_cell_inverted ? -cell : cell;
    dictionary->load_torque_unm = fixed_clamp(load_torque, -I24_MAX, I24_MAX);
    dictionary->motor_current_ua = sensors->motor_current_ua;
    dictionary->bus_voltage_mv = sensors->bus_voltage_mv;
    dictionary->conduit_temperature_mdegc = sensors->conduit_temperature_mdegc;
}

/* ---- state ---- */

static void raise_fault(drive_t *drive, fault_t fault) {
    drive->dictionary.error_code = fault.code;
    node_error_set(&drive->node, fault.code, fault.register_bits, fault.detail);
}

/* `late`: the last tick took a configuration. That takes longer than a period, so the overrun that
 * the board reports is none; the bridge is off, and a step up waits for a tick that is on time.
 * While a compensation is configured, a broken load cell and a refused model are not faults: the
 * ladder (fallback.h) has a rung without them. */
static void step_state(drive_t *drive, const board_sensors_t *sensors, bool late) {
    dictionary_t *dictionary = &drive->dictionary;
    const state_command_t wanted = effective_command(drive);
    const bool waits = drive->took_configuration && !command_lowers(drive->state, wanted);
    const state_command_t command = waits ? COMMAND_NONE : wanted;
    const bool up = leads_up(drive->state, wanted);
    const bool running = state_bridge_on(drive->state) || (up && drive->state == STATE_SWITCHED_ON);
    const bool compensates = drive->rendering.law != COMPENSATION_LAW_NONE;
    const uint32_t expected =
        (late ? BOARD_FAULT_TICK_OVERRUN : 0u) | (compensates ? BOARD_FAULT_LOAD_CELL : 0u);
    fault_t fault =
        supervision_check(sensors->faults & ~expected, sensors->bus_voltage_mv,
                          up || is_powered(drive->state), running && node_host_lost(&drive->node));
    if (fault.code == EMCY_NO_ERROR && up && !drive->configured && !compensates) {
        fault = supervision_configuration_refused(dictionary->configuration_error);
    }
    const drive_state_t before = drive->state;
    drive->state = state_next(before, command,
                              (state_events_t){
                                  .fault = fault.code != EMCY_NO_ERROR,
                                  .fault_reset = drive->asked.fault_reset,
                                  .quick_stop_done = drive->command.torque_unm == 0,
                              });
    if (drive->state == STATE_FAULT_REACTION_ACTIVE) {
        raise_fault(drive, fault);
    } else if (before == STATE_FAULT && drive->state != STATE_FAULT) {
        supervision_clear(&drive->node);
        dictionary->error_code = EMCY_NO_ERROR;
    }
    command_done(&drive->asked);
    drive->node.od.config_locked = state_bridge_on(drive->state);
}

/* ---- torque command ---- */

static int32_t tunnel_angle_urad(drive_t *drive) {
    dictionary_t *dictionary = &drive->dictionary;
    switch (drive->parameters.tunnel_angle_source) {
    case TUNNEL_ANGLE_SOURCE_MOTOR:
        return dictionary->motor_angle_urad;
    case TUNNEL_ANGLE_SOURCE_SCALED_MOTOR:
        return fixed_scale(dictionary->motor_angle_urad, drive->parameters.load_per_motor_angle,
                           &drive->saturations);
    case TUNNEL_ANGLE_SOURCE_LOAD:
    default:
        return dictionary->load_angle_urad;
    }
}

static int32_t target_torque_unm(drive_t *drive) {
    if (drive->state != STATE_OPERATION_ENABLED || is_halted(drive)) {
        return 0;
    }
    switch (drive->dictionary.mode_of_operation) {
    case MODE_OF_OPERATION_TUNNEL:
        return tunnel_torque_unm(&drive->parameters.tunnel, tunnel_angle_urad(drive));
    case MODE_OF_OPERATION_TORQUE:
        return drive->dictionary.target_torque_unm;
    default:
        return 0;
    }
}

static void step_command(drive_t *drive, int32_t wanted_unm) {
    const parameters_t *parameters = &drive->parameters;
    if (!state_bridge_on(drive->state)) {
        torque_command_rest(&drive->command);
        return;
    }
    torque_course_t course = TORQUE_FOLLOWS;
    if (drive->state == STATE_QUICK_STOP_ACTIVE) {
        course = parameters->quick_stop;
    } else if (is_halted(drive)) {
        course = parameters->halt;
    }
    torque_command_step(&drive->command, &parameters->torque, course, wanted_unm);
}

/* ---- the model and what it gives ---- */

/* The motor torque that is to be given, from the one that is asked for. */
static int32_t render(drive_t *drive, const board_sensors_t *sensors) {
    const dictionary_t *dictionary = &drive->dictionary;
    const parameters_t *parameters = &drive->parameters;
    uint32_t *count = &drive->saturations;
    const int32_t motor_counts =
        counts_since(dictionary->motor_encoder_counts, drive->motor_zero_counts);
    const int32_t load_counts =
        counts_since(dictionary->load_encoder_counts, drive->load_zero_counts);
    /* without compensation nobody looks at the motor's place: then it is free to turn for ever */
    uint32_t ignored = 0;
    uint32_t *motor_count = drive->rendering.law == COMPENSATION_LAW_NONE ? &ignored : count;
    const int32_t cell_unm = dictionary->load_torque_unm;
    return rendering_step(
        &drive->rendering, &drive->transmission,
        &(rendering_inputs_t){
            .active = drive->state == STATE_OPERATION_ENABLED && !is_halted(drive) &&
                      dictionary->mode_of_operation != MODE_OF_OPERATION_NONE,
            .load_cell_broken = (sensors->faults & BOARD_FAULT_LOAD_CELL) != 0,
            .load_cell_saturated = cell_unm == I24_MAX || cell_unm == -I24_MAX,
            .load_cell_counts = sensors->load_cell_counts,
            .asked_unm = target_torque_unm(drive),
            .motor_arc_nm =
                fixed_scale(motor_counts, parameters->motor_arc_nm_per_count, motor_count),
            .load_arc_nm = fixed_scale(load_counts, parameters->load_arc_nm_per_count, count),
            .motor_torque_unm = dictionary->motor_torque_unm,
            .load_cell_unm = cell_unm,
        });
}

static void publish_model(drive_t *drive) {
    dictionary_t *dictionary = &drive->dictionary;
    transmission_t *transmission = &drive->transmission;
    uint32_t *count = &drive->saturations;
    if (rendering_publish(&drive->rendering, dictionary)) {
        supervision_tell_fallback(&drive->node, dictionary->compensation_fallback,
                                  dictionary->compensation_rung);
    }
    if (!drive->configured) {
        return;
    }
    const int32_t zero_urad =
        fixed_scale(drive->motor_zero_counts, drive->parameters.motor_urad_per_count, count);
    dictionary->model_motor_angle_urad =
        fixed_add(zero_urad, transmission_motor_angle_urad(transmission), count);
    dictionary->model_load_torque_unm = transmission_load_torque_unm(transmission);
    dictionary->model_tension_motor_a_un = (uint32_t)transmission->a.end[CABLE_PROXIMAL].tension_un;
    dictionary->model_tension_load_a_un = (uint32_t)transmission->a.end[CABLE_DISTAL].tension_un;
    dictionary->model_tension_motor_b_un = (uint32_t)transmission->b.end[CABLE_PROXIMAL].tension_un;
    dictionary->model_tension_load_b_un = (uint32_t)transmission->b.end[CABLE_DISTAL].tension_un;
}

/* ---- the tick ---- */

static void publish_state(drive_t *drive, const board_sensors_t *sensors) {
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
    uint16_t status = (uint16_t)(state_status_bits(drive->state) | STATUSWORD_REMOTE);
    if (sensors->bus_voltage_mv >= SUPERVISION_BUS_VOLTAGE_MIN_MV) {
        status |= STATUSWORD_VOLTAGE_ENABLED;
    }
    if (drive->command.limited) {
        status |= STATUSWORD_INTERNAL_LIMIT;
    }
    if (is_halted(drive) && drive->command.torque_unm == 0) {
        status |= STATUSWORD_TARGET_REACHED;
    }
    dictionary->statusword = status;
    dictionary->mode_of_operation_display = dictionary->mode_of_operation;
    dictionary->motor_torque_command_unm = drive->command.torque_unm;
    dictionary->tx_overflow_count = node_tx_overflow_count(&drive->node);
}

static void count_sample(drive_t *drive, const board_sensors_t *sensors) {
    dictionary_t *dictionary = &drive->dictionary;
    if (node_sample_due(&drive->node, sensors->time_us)) {
        dictionary->sample_counter++;
        dictionary->sample_counter_low = (uint8_t)dictionary->sample_counter;
        dictionary->device_time_us = sensors->time_us;
    }
}

void drive_tick(drive_t *drive, const board_sensors_t *sensors, board_actuators_t *actuators) {
    const bool late = drive->took_configuration;
    note_command(drive);
    drive->took_configuration = follow_configuration(drive, sensors);
    publish_sensors(drive, sensors);
    step_state(drive, sensors, late);
    step_command(drive, render(drive, sensors));
    publish_model(drive);
    publish_state(drive, sensors);
    count_sample(drive, sensors);
    node_follow_bus(&drive->node, sensors->bus);
    node_tick(&drive->node, sensors->time_us);
    *actuators = (board_actuators_t){
        .bridge_enabled = state_bridge_on(drive->state),
        .motor_current_ua = fixed_scale(drive->command.torque_unm,
                                        drive->parameters.current_per_torque, &drive->saturations),
    };
    if (saving_step(&drive->saving, &drive->node, sensors->store, actuators)) {
        node_error_clear(&drive->node, EMCY_CONFIGURATION_CHANGED);
    }
    actuators->reset_requested = node_reset_requested(&drive->node) && !drive->saving.busy;
    drive->dictionary.storage_state = (uint8_t)drive->saving.state;
}
