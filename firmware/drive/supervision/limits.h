/* limits.h: which torque may be asked for now: what the board can drive, and what motor, bridge and
 * conduit bear without getting too hot. A limit is no fault; it acts before there is one.
 *
 * Its parts are looked at in turn, one every 16 ticks, so that no tick pays for all of them.
 */
#ifndef BOWDEN_DRIVE_SUPERVISION_LIMITS_H
#define BOWDEN_DRIVE_SUPERVISION_LIMITS_H

#include "../../core/fixed.h"
#include "../dictionary.h"
#include "heat.h"

typedef struct {
    int32_t board_ua;           /* the most that the board drives */
    ratio_t torque_per_current; /* uN m per uA */
    int32_t conduit_mdegc;      /* conduit_temperature_limit */
    heat_meter_t meter;
    heat_t motor, bridge;
    int32_t torque_unm; /* what may be asked for */
    uint8_t acting;     /* LIMITS_ACTIVE_*: which limit that is */
} limits_t;

/* Takes the settings. board_ua 0: the board has no limit of its own. */
void limits_configure(limits_t *limits, const dictionary_t *dictionary, int32_t board_ua);

/* One tick. */
void limits_step(limits_t *limits, int32_t motor_current_ua, int32_t conduit_mdegc);

#endif
