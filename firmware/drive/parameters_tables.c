/* parameters_tables.c: see parameters_tables.h. */
#include "parameters_tables.h"

#define TABLE_PLACE_INDEX UINT32_C(0x2151)

static const int32_t *values_of(const dictionary_t *dictionary, uint32_t number) {
    const int32_t *const VALUES[TABLES] = {
        dictionary->table_1, dictionary->table_2, dictionary->table_3, dictionary->table_4,
        dictionary->table_5, dictionary->table_6, dictionary->table_7, dictionary->table_8,
    };
    return VALUES[number];
}

table_settings_t parameters_table(const dictionary_t *dictionary, uint32_t number) {
    table_settings_t table = {
        .place = (table_place_t)dictionary->table_place[number],
        .argument = (table_argument_t)dictionary->table_argument[number],
        .direction = (table_direction_t)dictionary->table_direction[number],
        .repeats = dictionary->table_repeats[number] != 0,
        .knots = dictionary->table_knots[number],
        .first = dictionary->table_first[number],
        .span = dictionary->table_span[number],
    };
    const int32_t *values = values_of(dictionary, number);
    for (uint32_t i = 0; i < TABLES_KNOTS; i++) {
        table.value[i] = values[i];
    }
    return table;
}

/* Friction of the sliding pair at the load, 2 r T0 m: exact for one radius all the way. */
static int32_t friction_unm(const dictionary_t *dictionary, const cable_settings_t *cable) {
    const uint64_t force_un =
        2u * (uint64_t)(uint32_t)cable->pretension_un * cable_wrap_q24(cable) / FIXED_Q24_ONE;
    const uint64_t torque_unm = force_un * dictionary->load_pulley_radius_nm / 1000000000u;
    return torque_unm < INT32_MAX ? (int32_t)torque_unm : INT32_MAX;
}

uint32_t parameters_table_defect(const dictionary_t *dictionary, const cable_settings_t *cable,
                                 table_defect_t *defect) {
    const tables_bounds_t bounds = {
        .friction_unm = friction_unm(dictionary, cable),
        .limit_unm = (int32_t)dictionary->motor_torque_limit_unm,
        .motor_pulley_radius_nm = dictionary->motor_pulley_radius_nm,
        .load_pulley_radius_nm = dictionary->load_pulley_radius_nm,
    };
    *defect = TABLE_DEFECT_NONE;
    for (uint32_t i = 0; i < TABLES; i++) {
        if (dictionary->table_place[i] == TABLE_PLACE_NONE) {
            continue;
        }
        const table_settings_t table = parameters_table(dictionary, i);
        *defect = tables_check(&table, &bounds);
        if (*defect != TABLE_DEFECT_NONE) {
            return TABLE_PLACE_INDEX << 8 | (i + 1u);
        }
    }
    return 0;
}
