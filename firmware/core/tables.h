/* tables.h: what the cable model has no law for, as curves: friction over angle, speed,
 * temperature; torque over angle; what a sensor reads too much.
 *
 * A table adds its value at a *place*, over an *argument*, in both directions of the load's motion
 * or in one only; those of one place add up. Between knots, which are evenly spaced, it is linear;
 * beyond the ends it is flat, or it repeats. Places:
 *
 *   friction_factor    f, mu becomes mu (1 + f)
 *   load_torque        what the load feels on top of the cables' torque
 *   motor_torque       what the cables feel on top of the motor's
 *   load_angle, motor_angle, load_cell    what is added to the reading, to be true
 *   motor_gain, load_cell_gain            g, the reading becomes reading (1 + g)
 *
 * One table a tick takes its turn, so each is at most 2 ms old. tables_check() refuses what the
 * host may not ask for. Pure; no division but by periods of tables that repeat.
 */
#ifndef BOWDEN_CORE_TABLES_H
#define BOWDEN_CORE_TABLES_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"
#include "fixed.h"

#define TABLES 8
#define TABLES_KNOTS 33
#define TABLES_FACTOR_ONE 16384 /* Q14 */
#define TABLES_FACTOR_LEAST (TABLES_FACTOR_ONE / 8)
#define TABLES_FACTOR_MOST (4 * TABLES_FACTOR_ONE)

/* One table as it is written; units in the dictionary. */
typedef struct {
    table_place_t place;
    table_argument_t argument;
    table_direction_t direction;
    bool repeats; /* `span` is its period, and the first knot is the last one again */
    uint8_t knots;
    int32_t first; /* of the argument */
    uint32_t span; /* from the first knot to the last */
    int32_t value[TABLES_KNOTS];
} table_settings_t;

/* What the bounds of tables follow from. */
typedef struct {
    int32_t friction_unm; /* of the sliding pair at the load */
    int32_t limit_unm;    /* of the motor */
    uint32_t motor_pulley_radius_nm, load_pulley_radius_nm;
} tables_bounds_t;

/* A table ready to be looked up. */
typedef struct {
    const table_settings_t *settings;
    ratio_t knots_q24; /* of the argument's unit */
} table_t;

/* What all tables say now; [0] for motion towards negative angles or [1] positive ones. */
typedef struct {
    int32_t friction_ppm[2];
    int32_t load_torque_unm[2], motor_torque_unm[2];
    int32_t load_angle_urad, motor_angle_urad, load_cell_unm;
    int32_t motor_gain_ppm, load_cell_gain_ppm;
} tables_sums_t;

/* One in Q20. */
#define TABLES_GAIN_ONE (1 << 20)

typedef struct {
    table_settings_t settings[TABLES];
    table_t table[TABLES]; /* those in use */
    uint8_t count;
    bool has_friction, has_load_speed, has_motor_speed;
    uint8_t turn; /* whose turn it is */
    tables_sums_t gathering;
    tables_sums_t now;
    int32_t motor_gain_q20, motor_inverse_q20; /* 1 + g and its inverse */
    int32_t load_cell_gain_q20;
    uint32_t friction_q14[2]; /* 1 + f, within TABLES_FACTOR_LEAST .. MOST */
    /* speeds of both ends, filtered over 8 ms */
    int32_t load_speed_urad_per_s, motor_speed_urad_per_s;
    int32_t last_load_urad, last_motor_urad;
    bool started;
} tables_t;

/* What a tick measures. */
typedef struct {
    int32_t load_reading_urad, motor_reading_urad; /* as the encoders have it */
    int32_t conduit_mdegc;
    uint32_t ticks_per_s;
} tables_inputs_t;

/* Checks one table. Refused are curves that cannot be looked up, values that the motor could not
 * give, and what would make the compensation active:
 *
 *   too_steep   A torque over an angle is given late, by t = 3 ms: at the speed v it is off by
 *               h' v t. Over a closed path that gives the load up to h' v t of energy a radian,
 *               which the friction that compensation leaves (1/25 of F, law_model_inversion.c)
 *               must take: h' <= F/25 / (v t), v = 8 rad/s (40 deg at 2 Hz): h' <= F/0.6 per rad.
 *   beyond_friction   A torque that depends on the direction or the speed is a loss that will be
 *               made good, whether it is there or not. More than the friction F of the pair
 *               is none that F could cover.
 */
table_defect_t tables_check(const table_settings_t *table, const tables_bounds_t *bounds);

/* Takes the settings, which stay in *tables; tables_check() has found them fine. Slow. */
void tables_configure(tables_t *tables);

/* One tick. */
void tables_step(tables_t *tables, const tables_inputs_t *inputs);

/* The value of a table, rounded, within 1 of the exact. */
int32_t tables_value(const table_t *table, int32_t argument);

#endif
