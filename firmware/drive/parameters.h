/* parameters.h: from the object dictionary's raw values to what the control tick computes with.
 *
 * Ranges of single entries are the dictionary's; here is what only shows when entries meet. A
 * configuration that cannot run is named by the entry to change: index << 8 | sub-index.
 */
#ifndef BOWDEN_DRIVE_PARAMETERS_H
#define BOWDEN_DRIVE_PARAMETERS_H

#include <stdint.h>

#include "../core/compensation.h"
#include "../core/fixed.h"
#include "../core/transmission.h"
#include "../core/tunnel.h"
#include "../meanings.h"
#include "command.h"
#include "dictionary.h"
#include "fallback.h"
#include "torque_command.h"

/* Constants of the tick. */
typedef struct {
    ratio_t motor_urad_per_count;
    ratio_t load_urad_per_count;
    ratio_t motor_arc_nm_per_count;
    ratio_t load_arc_nm_per_count;
    ratio_t torque_per_current;   /* uN m per uA */
    ratio_t current_per_torque;   /* uA per uN m */
    ratio_t load_cell_magnitude;  /* uN m per count, without the sign of the gain */
    ratio_t load_per_motor_angle; /* 1 / transmission ratio */
    bool load_cell_inverted;
    int32_t load_cell_zero_counts;
    torque_command_settings_t torque;
    command_ramps_t ramps;
    torque_course_t quick_stop, halt;
    uint8_t tunnel_angle_source;
    tunnel_t tunnel;
} parameters_t;

/* Computes the tick's constants. */
parameters_t parameters_of(const dictionary_t *dictionary);

/* Computes the transmission's settings. */
transmission_settings_t parameters_transmission(const dictionary_t *dictionary);

/* The compensation's settings; its law is not among them. */
compensation_settings_t parameters_compensation(const dictionary_t *dictionary);

/* Settings of the fallback. `model_refused`: the transmission could not be configured. */
fallback_settings_t parameters_fallback(const dictionary_t *dictionary, bool model_refused);

/* 0: the configuration can run, its tables apart (parameters_tables.h); else the culprit. */
uint32_t parameters_defect(const dictionary_t *dictionary);

#endif
