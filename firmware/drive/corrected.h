/* corrected.h: sensor readings, corrected by the tables (core/tables.h).
 *
 * The dictionary and the bus carry uncorrected readings, so that a recording stays raw; tunnel,
 * model and laws use these.
 */
#ifndef BOWDEN_DRIVE_CORRECTED_H
#define BOWDEN_DRIVE_CORRECTED_H

#include "../core/tables.h"
#include "dictionary.h"

typedef struct {
    int32_t load_angle_urad, motor_angle_urad;
    int32_t load_arc_nm, motor_arc_nm; /* from where the model started */
    int32_t load_cell_unm;
    int32_t motor_torque_unm; /* what the motor's current gives */
} corrected_t;

/* Where the model started. */
typedef struct {
    tables_sums_t sums; /* of the tables there */
    ratio_t load_nm_per_urad, motor_nm_per_urad;
} corrected_start_t;

/* One tick: looks the tables up. The arcs are those of the readings; `start`: where
 * the model started. */
corrected_t corrected_step(tables_t *tables, const corrected_start_t *start,
                           const dictionary_t *dictionary, int32_t load_arc_nm,
                           int32_t motor_arc_nm);

/* Readings as they are: there are no tables. */
corrected_t corrected_by_nothing(const dictionary_t *dictionary, int32_t load_arc_nm,
                                 int32_t motor_arc_nm);

#endif
