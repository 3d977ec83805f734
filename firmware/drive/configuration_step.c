/* configuration_step.c: see configuration_step.h. */
#include "configuration_step.h"

#include <stddef.h>

#include "parameters_tables.h"

#define TICKS_PER_SECOND (1000000u / BOARD_CONTROL_PERIOD_US)
#define SETTLED_TICKS (TICKS_PER_SECOND / 20u)

/* Pieces of the cables in a tick, of 2000 instructions each at most: with 20 segments 25 ticks. */
#define PIECES_PER_TICK 5u

/* More than all steps: tables, settling, pieces, parts. */
#define STEPS_MAX (TABLES + 1u + CABLE_BUILD_STEPS_MAX + 6u)

/* The next table in use from `first` on; TABLES: none. */
static uint8_t next_table(const dictionary_t *dictionary, uint8_t first) {
    uint8_t table = first;
    while (table < TABLES && dictionary->table[table][0] == 0) {
        table++;
    }
    return table;
}

/* What is found of the entries in this tick; tables follow, one in a tick. */
static void begin_checks(drive_t *drive) {
    dictionary_t *dictionary = &drive->dictionary;
    configuration_t *configuration = &drive->configuration;
    configuration->revision = drive->node.od.config_revision;
    configuration->settled_ticks = 0;
    configuration->next = next_table(dictionary, 0);
    dictionary->table_defect = TABLE_DEFECT_NONE;
    dictionary->configuration_error = parameters_defect(dictionary);
    configuration->entries_run = dictionary->configuration_error == 0;
    const bool tables = dictionary->configuration_error == 0 && configuration->next < TABLES;
    configuration->stage = tables ? CONFIGURATION_IS_CHECKED : CONFIGURATION_SETTLES;
    if (tables) {
        dictionary->configuration_error = CONFIGURATION_UNDER_CHECK;
    }
}

static void check_table(drive_t *drive) {
    dictionary_t *dictionary = &drive->dictionary;
    configuration_t *configuration = &drive->configuration;
    const uint8_t table = configuration->next;
    const transmission_settings_t settings = parameters_transmission(dictionary);
    const table_defect_t defect =
        parameters_table_defect(dictionary, &settings.cable, dictionary->table[table]);
    configuration->next = next_table(dictionary, (uint8_t)(table + 1u));
    if (defect != TABLE_DEFECT_NONE) {
        dictionary->table_defect = (uint8_t)defect;
        dictionary->configuration_error = PARAMETERS_TABLE_INDEX << 8 | (table + 1u);
        configuration->stage = CONFIGURATION_SETTLES;
    } else if (configuration->next == TABLES) {
        dictionary->configuration_error = 0;
        configuration->stage = CONFIGURATION_SETTLES;
    }
}

/* From here on the model stands still until it starts anew. */
static void begin_build(drive_t *drive) {
    const transmission_settings_t settings = parameters_transmission(&drive->dictionary);
    drive->configured = false;
    drive->rendering.model_runs = false;
    drive->configuration.next = 0;
    const bool runs = drive->dictionary.configuration_error == 0 &&
                      transmission_build_start(&drive->transmission, &settings);
    drive->configuration.stage = runs ? CONFIGURATION_IS_BUILT : CONFIGURATION_IS_TAKEN;
}

static void build(drive_t *drive) {
    for (uint32_t i = 0; i < PIECES_PER_TICK && !drive->configured; i++) {
        drive->configured = transmission_build_step(&drive->transmission);
    }
    if (drive->configured) {
        drive->configuration.stage = CONFIGURATION_IS_TAKEN;
    }
}

static void take_tables(drive_t *drive) {
    const dictionary_t *dictionary = &drive->dictionary;
    drive->tables.count = 0;
    for (uint32_t i = 0; drive->configured && i < TABLES; i++) {
        drive->tables.settings[i] = parameters_table(dictionary->table[i]);
    }
    if (drive->configured) {
        tables_configure(&drive->tables);
        drive->corrected_start = (corrected_start_t){
            .load_nm_per_urad = ratio_of(dictionary->load_pulley_radius_nm, 1000000),
            .motor_nm_per_urad = ratio_of(dictionary->motor_pulley_radius_nm, 1000000),
        };
    }
}

static void take_supervision(drive_t *drive) {
    const transmission_settings_t settings = parameters_transmission(&drive->dictionary);
    supervision_configure(&drive->supervision, &drive->dictionary, &settings.cable,
                          drive->current_max_ua);
}

/* The model starts with the last part. */
static void take(drive_t *drive, const board_sensors_t *sensors) {
    switch (drive->configuration.next++) {
    case 0:
        drive->parameters = parameters_of(&drive->dictionary);
        break;
    case 1:
        take_supervision(drive);
        break;
    case 2:
        take_tables(drive);
        break;
    case 3:
        rendering_configure(&drive->rendering, &drive->dictionary, &drive->transmission,
                            drive->configured);
        break;
    default:
        rendering_start(&drive->rendering, &drive->dictionary, &drive->transmission,
                        drive->configured);
        drive->saturations = 0;
        drive->motor_zero_counts = sensors->motor_encoder_counts;
        drive->load_zero_counts = sensors->load_encoder_counts;
        drive->configuration.taken = drive->configuration.revision;
        drive->configuration.stage = CONFIGURATION_STANDS;
        break;
    }
}

static void step(drive_t *drive, const board_sensors_t *sensors, bool now) {
    configuration_t *configuration = &drive->configuration;
    switch (configuration->stage) {
    case CONFIGURATION_IS_CHECKED:
        check_table(drive);
        break;
    case CONFIGURATION_SETTLES:
        configuration->settled_ticks++;
        if (now || configuration->settled_ticks == SETTLED_TICKS) {
            begin_build(drive);
        }
        break;
    case CONFIGURATION_IS_BUILT:
        build(drive);
        break;
    case CONFIGURATION_IS_TAKEN:
        take(drive, sensors);
        break;
    case CONFIGURATION_STANDS:
    default:
        break;
    }
}

bool configuration_stands(const drive_t *drive) {
    return drive->configuration.stage == CONFIGURATION_STANDS &&
           drive->configuration.revision == drive->node.od.config_revision;
}

void configuration_step(drive_t *drive, const board_sensors_t *sensors, bool now) {
    if (state_bridge_on(drive->state)) {
        return;
    }
    if (drive->node.od.config_revision != drive->configuration.revision) {
        begin_checks(drive); /* anew, whatever was under way */
    } else {
        step(drive, sensors, now);
    }
    const bool starts = drive->state == STATE_NOT_READY_TO_SWITCH_ON;
    for (uint32_t i = 0; starts && i < STEPS_MAX; i++) {
        step(drive, sensors, true);
    }
}
