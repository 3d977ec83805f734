/* drive.c: see drive.h. */
#include "drive.h"

#include <stddef.h>

#include "configuration_step.h"
#include "homing.h"
#include "publish.h"
#include "supervision/fault_log.h"
#include "table_write.h"

#define TICKS_PER_SECOND (1000000u / BOARD_CONTROL_PERIOD_US)

/* Reports to the host where the configuration comes from, and warns unless it is all that was saved
 * by this firmware. Detail: the first entry that was not taken, the outcome in the high byte. */
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

/* As it was stored, else the board's own. */
static uint8_t own_node_id(const board_identity_t *identity) {
    uint32_t stored = 0;
    const bool found =
        storage_find(identity->saved, identity->saved_words, LSS_NODE_ID_INDEX, 0, &stored);
    return found && stored >= 1 && stored <= 127 ? (uint8_t)stored : identity->node_id;
}

void drive_init(drive_t *drive, const board_identity_t *identity) {
    /* No configuration has this revision: the first tick takes the defaults. */
    *drive = (drive_t){
        .state = STATE_NOT_READY_TO_SWITCH_ON,
        .configuration = {.revision = UINT32_MAX, .taken = UINT32_MAX},
    };
    node_init(&drive->node, DICTIONARY, DICTIONARY_COUNT, &drive->dictionary, own_node_id(identity),
              0);
    dictionary_t *dictionary = &drive->dictionary;
    drive->current_max_ua = identity->current_max_ua;
    dictionary->node_id = drive->node.od.node_id;
    dictionary->identity_serial_number = identity->serial_number;
    dictionary->reset_cause = (uint8_t)identity->reset;
    dictionary->board_current_limit_ua = (uint32_t)identity->current_max_ua;
    dictionary->board_current_trip_ua = SUPERVISION_OVERCURRENT_LIMIT_UA;
    drive->reference = reference_of(identity->reset, identity->reference);
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
                            &drive->parameters.ramps);
}

bool drive_is_halted(const drive_t *drive) {
    return drive->state == STATE_OPERATION_ENABLED &&
           (drive->dictionary.controlword & CONTROLWORD_HALT) != 0;
}

/* A frame that changes neither controlword nor NMT state asks for nothing that the last tick has
 * not noted already. */
void drive_receive(drive_t *drive, const can_frame_t *frame) {
    const uint16_t before = drive->dictionary.controlword;
    const bool was_operational = is_operational(drive);
    node_receive(&drive->node, frame);
    uint16_t withheld = 0;
    if (node_take_withheld(&drive->node, &withheld) && command_is_stop(drive->state, withheld)) {
        drive->dictionary.controlword = withheld;
    }
    if (drive->dictionary.controlword != before || is_operational(drive) != was_operational) {
        note_command(drive);
    }
}

/* Does the torque follow what is wanted? Not while it stops. */
static bool follows(const drive_t *drive) {
    return drive->state == STATE_OPERATION_ENABLED && !drive_is_halted(drive) &&
           drive->asked.slows == COMMAND_NONE;
}

/* Does this command lead to the next higher state? Then the configuration must stand. */
static bool leads_up(drive_state_t state, state_command_t command) {
    return (state == STATE_READY_TO_SWITCH_ON &&
            (command == COMMAND_SWITCH_ON || command == COMMAND_ENABLE_OPERATION)) ||
           (state == STATE_SWITCHED_ON && command == COMMAND_ENABLE_OPERATION);
}

/* ---- state ---- */

/* `running`: current flows or is about to. `late`: the last tick was longer than a period, as it
 * may be; so the overrun that the board reports is none. While a compensation is configured, a
 * broken load cell and a refused model are not faults: the fallback (fallback.h) has a level
 * without them. */
static supervision_inputs_t watched(drive_t *drive, const board_sensors_t *sensors, bool up,
                                    bool late) {
    const dictionary_t *dictionary = &drive->dictionary;
    uint32_t ignored = 0;
    const bool compensates = drive->rendering.law != COMPENSATION_LAW_NONE;
    const uint32_t expected =
        (late ? BOARD_FAULT_TICK_OVERRUN : 0u) | (compensates ? BOARD_FAULT_LOAD_CELL : 0u);
    return (supervision_inputs_t){
        .board_faults = sensors->faults & ~expected,
        .powered = up || is_powered(drive->state),
        .running = state_bridge_on(drive->state) || (up && drive->state == STATE_SWITCHED_ON),
        .in_fault = drive->state == STATE_FAULT,
        .reference_lost = dictionary->mode_of_operation == MODE_OF_OPERATION_TUNNEL &&
                          !reference_is_known(&drive->reference),
        .configuration_refused = up && !drive->configured && !compensates,
        .host_commanded = node_take_commanded(&drive->node),
        .heartbeat_lost = node_host_lost(&drive->node),
        .host_restarted = node_host_restarted(&drive->node),
        .rpdo_late = node_rpdo_late(&drive->node),
        .namesake = node_take_namesake(&drive->node),
        .motor_counts = sensors->motor_encoder_counts,
        .load_counts = sensors->load_encoder_counts,
        .apart_nm = fixed_subtract(drive->motor_arc_nm, drive->load_arc_nm, &ignored),
        .load_angle_urad = dictionary->load_angle_urad,
        .motor_torque_unm = dictionary->motor_torque_unm,
        .commanded_ua = drive->commanded_ua,
        .motor_current_ua = sensors->motor_current_ua,
        .bus_voltage_mv = sensors->bus_voltage_mv,
        .conduit_mdegc = sensors->conduit_temperature_mdegc,
    };
}

static void step_state(drive_t *drive, const board_sensors_t *sensors, bool late) {
    const drive_state_t before = drive->state;
    const bool torque_gone = drive->command.torque_unm == 0;
    const state_command_t wanted = command_slow_down(
        &drive->asked, before, effective_command(drive), &drive->parameters.ramps, torque_gone);
    const bool up = leads_up(before, wanted);
    const bool waits = up && !configuration_stands(drive);
    const supervision_inputs_t inputs = watched(drive, sensors, up && !waits, late);
    supervision_t *supervision = &drive->supervision;
    supervision_step(supervision, &inputs);
    drive->state = state_next(before, waits ? COMMAND_NONE : wanted,
                              (state_events_t){
                                  .fault = supervision->present != 0,
                                  .fault_reset = drive->asked.fault_reset,
                                  .quick_stop_done = torque_gone,
                              });
    const uint32_t fresh = supervision_latch(supervision, &drive->node, &inputs);
    if (fresh != 0) {
        fault_log_add(&drive->dictionary, fresh, drive->uptime_s);
        drive->saving.log_has_grown = true;
    }
    if (drive->state == STATE_FAULT_REACTION_ACTIVE) {
        drive->dictionary.error_code = supervision_code(fresh);
    } else if (before == STATE_FAULT && drive->asked.fault_reset) {
        const bool taken = drive->state != STATE_FAULT;
        supervision_reset(supervision, &drive->node, taken);
        drive->dictionary.error_code = taken ? EMCY_NO_ERROR : drive->dictionary.error_code;
    }
    command_done(&drive->asked);
    drive->node.od.config_locked = state_bridge_on(drive->state);
}

/* ---- torque command ---- */

static int32_t tunnel_angle_urad(drive_t *drive) {
    switch (drive->parameters.tunnel_angle_source) {
    case TUNNEL_ANGLE_SOURCE_MOTOR:
        return drive->corrected.motor_angle_urad;
    case TUNNEL_ANGLE_SOURCE_SCALED_MOTOR:
        return fixed_scale(drive->corrected.motor_angle_urad,
                           drive->parameters.load_per_motor_angle, &drive->saturations);
    case TUNNEL_ANGLE_SOURCE_LOAD:
    default:
        return drive->corrected.load_angle_urad;
    }
}

static int32_t target_torque_unm(drive_t *drive) {
    if (!follows(drive)) {
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
        torque_command_idle(&drive->command);
        return;
    }
    torque_course_t course = TORQUE_FOLLOWS;
    if (drive->state == STATE_QUICK_STOP_ACTIVE) {
        course = parameters->quick_stop;
    } else if (drive->asked.slows != COMMAND_NONE) {
        course = TORQUE_STOPS_BY_SLEW;
    } else if (drive_is_halted(drive)) {
        course = parameters->halt;
    }
    torque_command_settings_t settings = parameters->torque;
    settings.limit_unm = fixed_clamp(drive->supervision.limits.torque_unm, 0, settings.limit_unm);
    torque_command_step(&drive->command, &settings, course, wanted_unm);
}

/* ---- the model and what it gives ---- */

/* The motor torque that is to be given, from the one that is asked for. */
static int32_t render(drive_t *drive, const board_sensors_t *sensors) {
    const dictionary_t *dictionary = &drive->dictionary;
    const int32_t cell_unm = dictionary->load_torque_unm;
    const corrected_t *corrected = &drive->corrected;
    return rendering_step(
        &drive->rendering, &drive->transmission,
        &(rendering_inputs_t){
            .active = follows(drive) && dictionary->mode_of_operation != MODE_OF_OPERATION_NONE &&
                      dictionary->mode_of_operation != MODE_OF_OPERATION_WINDING,
            .load_cell_broken = (sensors->faults & BOARD_FAULT_LOAD_CELL) != 0,
            .load_cell_saturated = cell_unm == PUBLISH_I24_MAX || cell_unm == -PUBLISH_I24_MAX,
            .load_cell_counts = sensors->load_cell_counts,
            .asked_unm = target_torque_unm(drive),
            .motor_arc_nm = corrected->motor_arc_nm,
            .load_arc_nm = corrected->load_arc_nm,
            .motor_torque_unm = corrected->motor_torque_unm,
            .load_cell_unm = corrected->load_cell_unm,
            .tables = drive->tables.count > 0 ? &drive->tables : NULL,
        });
}

/* ---- the tick ---- */

static void correct_readings(drive_t *drive) {
    const dictionary_t *dictionary = &drive->dictionary;
    if (drive->tables.count == 0) {
        drive->corrected =
            corrected_by_nothing(dictionary, drive->load_arc_nm, drive->motor_arc_nm);
        return;
    }
    const bool first = !drive->tables.started;
    drive->corrected = corrected_step(&drive->tables, &drive->corrected_start, dictionary,
                                      drive->load_arc_nm, drive->motor_arc_nm);
    if (first) { /* the arcs begin at 0, whatever the tables' values there */
        drive->corrected_start.sums = drive->tables.now;
        drive->corrected.load_arc_nm = drive->load_arc_nm;
        drive->corrected.motor_arc_nm = drive->motor_arc_nm;
    }
}

static void pass_time(drive_t *drive) {
    drive->second_ticks++;
    if (drive->second_ticks == TICKS_PER_SECOND) {
        drive->second_ticks = 0;
        drive->uptime_s++;
    }
}

void drive_tick(drive_t *drive, const board_sensors_t *sensors, board_actuators_t *actuators) {
    const bool late = drive->late;
    const bool starts = drive->state == STATE_NOT_READY_TO_SWITCH_ON;
    drive->late = node_take_communication_reset(&drive->node) || starts;
    pass_time(drive);
    note_command(drive);
    homing_step(drive, sensors);
    if (starts) {
        configuration_step(drive, sensors, true); /* all of it */
    }
    if (!table_write_step(&drive->node, &drive->dictionary, drive->configuration.entries_run)) {
        configuration_step(drive, sensors, leads_up(drive->state, effective_command(drive)));
    }
    publish_sensors(drive, sensors);
    correct_readings(drive);
    step_state(drive, sensors, late);
    step_command(drive, render(drive, sensors));
    publish_model(drive);
    publish_state(drive, sensors);
    publish_sample(drive, sensors);
    const bool traces =
        follows(drive) && drive->dictionary.mode_of_operation == MODE_OF_OPERATION_WINDING;
    publish_winding(drive, &sensors->winding, traces);
    node_follow_bus(&drive->node, sensors->bus);
    node_tick(&drive->node, sensors->time_us);
    drive->commanded_ua = fixed_scale(drive->command.torque_unm,
                                      drive->parameters.current_per_torque, &drive->saturations);
    *actuators = (board_actuators_t){
        .bridge_enabled = state_bridge_on(drive->state),
        .motor_current_ua = drive->commanded_ua,
        .winding_test = traces,
        .reference = reference_to_keep(&drive->reference, sensors->motor_encoder_counts,
                                       sensors->load_encoder_counts),
    };
    if (saving_step(&drive->saving, &drive->node, sensors->store, actuators)) {
        node_error_clear(&drive->node, EMCY_CONFIGURATION_CHANGED);
    }
    drive->late |= drive->saving.began;
    actuators->reset_requested = node_reset_requested(&drive->node) && !drive->saving.busy;
    drive->dictionary.storage_state = (uint8_t)drive->saving.state;
}
