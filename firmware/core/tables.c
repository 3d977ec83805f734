/* tables.c: see tables.h. */
#include "tables.h"

#define ONE_Q24 (1 << 24)
#define PPM 1000000
#define SPEED_TICKS 32 /* time constant of the speeds */
#define STEP_MOST_URAD 500000

/* Bounds that do not depend on the rig. */
#define VALUE_MOST ((1 << 23) - 1) /* a knot's fraction has 24 bits */
#define FACTOR_LEAST_PPM (-900000)
#define FACTOR_MOST_PPM 3000000
#define ANGLE_MOST_URAD 500000
#define GAIN_MOST_PPM 500000

/* ---- checks ---- */

static bool is_angle(table_argument_t argument) {
    return argument == TABLE_ARGUMENT_LOAD_ANGLE || argument == TABLE_ARGUMENT_MOTOR_ANGLE;
}

static bool is_torque(table_place_t place) {
    return place == TABLE_PLACE_LOAD_TORQUE || place == TABLE_PLACE_MOTOR_TORQUE;
}

/* What the load has of the motor, in the unit of the motor's side. */
static int32_t at_motor(int32_t load_value, const tables_bounds_t *bounds) {
    return (int32_t)((int64_t)load_value * bounds->motor_pulley_radius_nm /
                     bounds->load_pulley_radius_nm);
}

/* Largest value of a place, either way but for the friction factor. */
static int32_t most_of(table_place_t place, const tables_bounds_t *bounds) {
    switch (place) {
    case TABLE_PLACE_FRICTION_FACTOR:
        return FACTOR_MOST_PPM;
    case TABLE_PLACE_MOTOR_TORQUE:
        return fixed_clamp(bounds->limit_unm, 0, VALUE_MOST);
    case TABLE_PLACE_LOAD_TORQUE: {
        const int64_t most = (int64_t)bounds->limit_unm * bounds->load_pulley_radius_nm /
                             bounds->motor_pulley_radius_nm;
        return most < VALUE_MOST ? (int32_t)most : VALUE_MOST;
    }
    case TABLE_PLACE_LOAD_ANGLE:
    case TABLE_PLACE_MOTOR_ANGLE:
        return ANGLE_MOST_URAD;
    case TABLE_PLACE_MOTOR_GAIN:
    case TABLE_PLACE_LOAD_CELL_GAIN:
        return GAIN_MOST_PPM;
    default:
        return VALUE_MOST;
    }
}

/* The friction that a torque of this place may stand for. */
static int32_t friction_at(table_place_t place, const tables_bounds_t *bounds) {
    return place == TABLE_PLACE_LOAD_TORQUE ? bounds->friction_unm
                                            : at_motor(bounds->friction_unm, bounds);
}

/* Steepest torque over angle at its own side: of the motor's a radian is 1/rho of the load's. */
static int64_t steepest_unm_per_rad(const table_settings_t *table, const tables_bounds_t *bounds) {
    const int32_t friction_unm = friction_at(table->place, bounds);
    const bool over_motor = table->argument == TABLE_ARGUMENT_MOTOR_ANGLE;
    const int32_t side_unm = over_motor ? at_motor(friction_unm, bounds) : friction_unm;
    return (int64_t)side_unm * 10 / 6;
}

static table_defect_t check_torque(const table_settings_t *table, const tables_bounds_t *bounds) {
    const bool loss = table->direction != TABLE_DIRECTION_BOTH ||
                      table->argument == TABLE_ARGUMENT_LOAD_SPEED ||
                      table->argument == TABLE_ARGUMENT_MOTOR_SPEED;
    const int32_t friction_unm = friction_at(table->place, bounds);
    const int64_t steepest = steepest_unm_per_rad(table, bounds);
    for (uint32_t i = 0; i < table->knots; i++) {
        if (loss && (table->value[i] > friction_unm || table->value[i] < -friction_unm)) {
            return TABLE_DEFECT_BEYOND_FRICTION;
        }
        if (i > 0 && is_angle(table->argument)) {
            const int64_t rise = (int64_t)table->value[i] - table->value[i - 1u];
            const int64_t size = rise < 0 ? -rise : rise;
            if (size * (int64_t)(table->knots - 1u) * PPM > steepest * table->span) {
                return TABLE_DEFECT_TOO_STEEP;
            }
        }
    }
    return TABLE_DEFECT_NONE;
}

table_defect_t tables_check(const table_settings_t *table, const tables_bounds_t *bounds) {
    if (table->place == TABLE_PLACE_NONE) {
        return TABLE_DEFECT_NONE;
    }
    if (table->knots < 1 || table->knots > TABLES_KNOTS || (table->knots > 1 && table->span == 0) ||
        table->span > INT32_MAX || (table->repeats && table->knots < 2)) {
        return TABLE_DEFECT_KNOTS;
    }
    const int32_t most = most_of(table->place, bounds);
    const int32_t least = table->place == TABLE_PLACE_FRICTION_FACTOR ? FACTOR_LEAST_PPM : -most;
    for (uint32_t i = 0; i < table->knots; i++) {
        if (table->value[i] > most || table->value[i] < least) {
            return TABLE_DEFECT_VALUE;
        }
    }
    if (table->repeats && table->value[0] != table->value[table->knots - 1u]) {
        return TABLE_DEFECT_JUMPS;
    }
    return is_torque(table->place) ? check_torque(table, bounds) : TABLE_DEFECT_NONE;
}

/* ---- the tick ---- */

static int32_t interpolated(const int32_t *value, int32_t at_q24) {
    const int32_t fraction = at_q24 & (ONE_Q24 - 1);
    const int64_t part = ((int64_t)value[1] - value[0]) * fraction;
    return value[0] + (int32_t)((part + (part < 0 ? -ONE_Q24 / 2 : ONE_Q24 / 2)) / ONE_Q24);
}

int32_t tables_value(const table_t *table, int32_t argument) {
    const table_settings_t *settings = table->settings;
    uint32_t saturations = 0; /* far beyond an end is flat, too */
    int32_t past = fixed_subtract(argument, settings->first, &saturations);
    const int32_t span = (int32_t)settings->span;
    if (settings->repeats) {
        past %= span;
        past += past < 0 ? span : 0;
    }
    if (settings->knots == 1 || past <= 0) {
        return settings->value[0];
    }
    if (past >= span) {
        return settings->value[settings->knots - 1u];
    }
    const int32_t at_q24 = fixed_scale(past, table->knots_q24, &saturations);
    const int32_t knot = at_q24 / ONE_Q24;
    const int32_t last = settings->knots - 1;
    return knot >= last ? settings->value[last] : interpolated(&settings->value[knot], at_q24);
}

#define ONE_Q30 (1 << 30)
#define Q14_PER_PPM_Q30 17592186
#define Q20_PER_PPM_Q30 1125899907

static int32_t gain_q20(int32_t ppm) {
    return (int32_t)((int64_t)ppm * Q20_PER_PPM_Q30 / ONE_Q30) + TABLES_GAIN_ONE;
}

static uint32_t factor_q14(int32_t ppm) {
    const int32_t q14 = (int32_t)((int64_t)ppm * Q14_PER_PPM_Q30 / ONE_Q30) + TABLES_FACTOR_ONE;
    return (uint32_t)fixed_clamp(q14, TABLES_FACTOR_LEAST, TABLES_FACTOR_MOST);
}

void tables_configure(tables_t *tables) {
    tables->count = 0;
    tables->has_friction = false;
    tables->has_load_speed = false;
    tables->has_motor_speed = false;
    tables->turn = 0;
    tables->started = false;
    tables->gathering = (tables_sums_t){0};
    tables->now = (tables_sums_t){0};
    for (uint32_t i = 0; i < TABLES; i++) {
        const table_settings_t *settings = &tables->settings[i];
        if (settings->place == TABLE_PLACE_NONE) {
            continue;
        }
        const uint64_t pieces = settings->knots - 1u;
        tables->table[tables->count++] = (table_t){
            .settings = settings,
            .knots_q24 = ratio_of(pieces << 24, settings->span > 0 ? settings->span : 1u),
        };
        tables->has_load_speed |= settings->argument == TABLE_ARGUMENT_LOAD_SPEED;
        tables->has_motor_speed |= settings->argument == TABLE_ARGUMENT_MOTOR_SPEED;
        tables->has_friction |= settings->place == TABLE_PLACE_FRICTION_FACTOR;
    }
    tables->friction_q14[0] = TABLES_FACTOR_ONE;
    tables->friction_q14[1] = TABLES_FACTOR_ONE;
    tables->motor_gain_q20 = TABLES_GAIN_ONE;
    tables->motor_inverse_q20 = TABLES_GAIN_ONE;
    tables->load_cell_gain_q20 = TABLES_GAIN_ONE;
}

static void add_by_direction(int32_t sums[2], table_direction_t direction, int32_t value) {
    uint32_t saturations = 0; /* eight values of 2^23 fit */
    if (direction != TABLE_DIRECTION_POSITIVE) {
        sums[0] = fixed_add(sums[0], value, &saturations);
    }
    if (direction != TABLE_DIRECTION_NEGATIVE) {
        sums[1] = fixed_add(sums[1], value, &saturations);
    }
}

static void add(tables_sums_t *sums, const table_settings_t *table, int32_t value) {
    switch (table->place) {
    case TABLE_PLACE_FRICTION_FACTOR:
        add_by_direction(sums->friction_ppm, table->direction, value);
        break;
    case TABLE_PLACE_LOAD_TORQUE:
        add_by_direction(sums->load_torque_unm, table->direction, value);
        break;
    case TABLE_PLACE_MOTOR_TORQUE:
        add_by_direction(sums->motor_torque_unm, table->direction, value);
        break;
    case TABLE_PLACE_LOAD_ANGLE:
        sums->load_angle_urad += value;
        break;
    case TABLE_PLACE_MOTOR_ANGLE:
        sums->motor_angle_urad += value;
        break;
    case TABLE_PLACE_LOAD_CELL:
        sums->load_cell_unm += value;
        break;
    case TABLE_PLACE_MOTOR_GAIN:
        sums->motor_gain_ppm += value;
        break;
    case TABLE_PLACE_LOAD_CELL_GAIN:
        sums->load_cell_gain_ppm += value;
        break;
    default:
        break;
    }
}

/* An encoder's own curve goes over its reading, all others over the true angle. */
static int32_t argument_of(const tables_t *tables, const table_settings_t *table,
                           const tables_inputs_t *inputs) {
    const bool own =
        table->place == TABLE_PLACE_LOAD_ANGLE || table->place == TABLE_PLACE_MOTOR_ANGLE;
    uint32_t saturations = 0; /* an angle beyond the range has left every table */
    switch (table->argument) {
    case TABLE_ARGUMENT_LOAD_ANGLE:
        return fixed_add(inputs->load_reading_urad, own ? 0 : tables->now.load_angle_urad,
                         &saturations);
    case TABLE_ARGUMENT_MOTOR_ANGLE:
        return fixed_add(inputs->motor_reading_urad, own ? 0 : tables->now.motor_angle_urad,
                         &saturations);
    case TABLE_ARGUMENT_LOAD_SPEED:
        return tables->load_speed_urad_per_s;
    case TABLE_ARGUMENT_MOTOR_SPEED:
        return tables->motor_speed_urad_per_s;
    case TABLE_ARGUMENT_CONDUIT_TEMPERATURE:
    default:
        return inputs->conduit_mdegc;
    }
}

/* What a tick multiplies by; the division only where it is needed. */
static void take_factors(tables_t *tables) {
    const tables_sums_t *now = &tables->now;
    tables->friction_q14[0] = factor_q14(now->friction_ppm[0]);
    tables->friction_q14[1] = factor_q14(now->friction_ppm[1]);
    const int32_t gain =
        fixed_clamp(gain_q20(now->motor_gain_ppm), TABLES_GAIN_ONE / 4, 4 * TABLES_GAIN_ONE);
    if (gain != tables->motor_gain_q20) {
        tables->motor_gain_q20 = gain;
        tables->motor_inverse_q20 = (int32_t)((INT64_C(1) << 40) / gain);
    }
    tables->load_cell_gain_q20 = gain_q20(now->load_cell_gain_ppm);
}

static void take_turn(tables_t *tables, const tables_inputs_t *inputs) {
    const table_t *table = &tables->table[tables->turn];
    add(&tables->gathering, table->settings,
        tables_value(table, argument_of(tables, table->settings, inputs)));
    tables->turn++;
    if (tables->turn == tables->count) {
        tables->turn = 0;
        tables->now = tables->gathering;
        tables->gathering = (tables_sums_t){0};
        take_factors(tables);
    }
}

static void follow_speed(int32_t *speed_urad_per_s, int32_t *last_urad, int32_t urad,
                         uint32_t ticks_per_s) {
    uint32_t saturations = 0; /* a jump is no speed */
    const int32_t step_urad = fixed_clamp(fixed_subtract(urad, *last_urad, &saturations),
                                          -STEP_MOST_URAD, STEP_MOST_URAD);
    *last_urad = urad;
    *speed_urad_per_s += (step_urad * (int32_t)ticks_per_s - *speed_urad_per_s) / SPEED_TICKS;
}

void tables_step(tables_t *tables, const tables_inputs_t *inputs) {
    if (tables->count == 0) {
        return;
    }
    if (!tables->started) { /* all at once */
        tables->started = true;
        tables->last_load_urad = inputs->load_reading_urad;
        tables->last_motor_urad = inputs->motor_reading_urad;
        for (uint32_t i = 0; i < 2u * TABLES && i < 2u * tables->count; i++) {
            take_turn(tables, inputs); /* twice: the angles are corrected by then */
        }
    }
    if (tables->has_load_speed) {
        follow_speed(&tables->load_speed_urad_per_s, &tables->last_load_urad,
                     inputs->load_reading_urad, inputs->ticks_per_s);
    }
    if (tables->has_motor_speed) {
        follow_speed(&tables->motor_speed_urad_per_s, &tables->last_motor_urad,
                     inputs->motor_reading_urad, inputs->ticks_per_s);
    }
    take_turn(tables, inputs);
}
