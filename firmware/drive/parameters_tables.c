/* parameters_tables.c: see parameters_tables.h. */
#include "parameters_tables.h"

#include <stddef.h>

#define VERSION 1u
#define FIRST_VALUE 4u

_Static_assert(FIRST_VALUE + TABLES_KNOTS == PARAMETERS_TABLE_WORDS, "the layout is that of table");

static uint8_t byte_of(uint32_t word, uint32_t number) {
    return (uint8_t)(word >> 8u * number);
}

table_settings_t parameters_table(const uint32_t words[PARAMETERS_TABLE_WORDS]) {
    table_settings_t table = {
        .place = (table_place_t)byte_of(words[0], 1),
        .argument = (table_argument_t)byte_of(words[0], 2),
        .direction = (table_direction_t)byte_of(words[0], 3),
        .repeats = byte_of(words[1], 0) != 0,
        .knots = byte_of(words[1], 1),
        .first = (int32_t)words[2],
        .span = words[3],
    };
    for (uint32_t i = 0; i < TABLES_KNOTS; i++) {
        table.value[i] = (int32_t)words[FIRST_VALUE + i];
    }
    return table;
}

static bool is_all_zero(const uint32_t words[PARAMETERS_TABLE_WORDS]) {
    uint32_t any = 0;
    for (uint32_t i = 0; i < PARAMETERS_TABLE_WORDS; i++) {
        any |= words[i];
    }
    return any == 0;
}

table_defect_t parameters_table_words_defect(const uint32_t words[PARAMETERS_TABLE_WORDS]) {
    if (byte_of(words[0], 0) != VERSION) {
        return is_all_zero(words) ? TABLE_DEFECT_NONE : TABLE_DEFECT_VERSION;
    }
    const bool known = byte_of(words[0], 1) != TABLE_PLACE_NONE &&
                       byte_of(words[0], 1) < TABLE_PLACE_COUNT &&
                       byte_of(words[0], 2) < TABLE_ARGUMENT_COUNT &&
                       byte_of(words[0], 3) < TABLE_DIRECTION_COUNT && byte_of(words[1], 0) <= 1;
    return known ? TABLE_DEFECT_NONE : TABLE_DEFECT_MEANING;
}

/* Friction of the sliding pair at the load, 2 r T0 m: exact for one radius all the way. */
static int32_t friction_unm(const dictionary_t *dictionary, const cable_settings_t *cable) {
    const uint64_t force_un =
        2u * (uint64_t)(uint32_t)cable->pretension_un * cable_wrap_q24(cable) / FIXED_Q24_ONE;
    const uint64_t torque_unm = force_un * dictionary->load_pulley_radius_nm / 1000000000u;
    return torque_unm < INT32_MAX ? (int32_t)torque_unm : INT32_MAX;
}

table_defect_t parameters_table_defect(const dictionary_t *dictionary,
                                       const cable_settings_t *cable,
                                       const uint32_t words[PARAMETERS_TABLE_WORDS]) {
    const table_defect_t defect = parameters_table_words_defect(words);
    if (defect != TABLE_DEFECT_NONE) {
        return defect;
    }
    const tables_bounds_t bounds = {
        .friction_unm = cable != NULL ? friction_unm(dictionary, cable) : INT32_MAX,
        .limit_unm = (int32_t)dictionary->motor_torque_limit_unm,
        .motor_pulley_radius_nm = dictionary->motor_pulley_radius_nm,
        .load_pulley_radius_nm = dictionary->load_pulley_radius_nm,
    };
    const table_settings_t table = parameters_table(words);
    return tables_check(&table, &bounds);
}
