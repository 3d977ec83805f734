/* torque_command.h: the motor torque that is commanded, on its way to the one that is wanted.
 *
 * While it follows it keeps the torque limit and the slew limit. While it stops (quick stop, halt)
 * it goes to 0 along a straight line whose duration is bounded, whatever the slew limit is; another
 * way to stop begins a line of its own. Pure.
 */
#ifndef BOWDEN_DRIVE_TORQUE_COMMAND_H
#define BOWDEN_DRIVE_TORQUE_COMMAND_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"

#define TORQUE_COMMAND_TICKS_PER_MS (1000u / BOARD_CONTROL_PERIOD_US)

/* No stop takes longer. */
#define TORQUE_COMMAND_STOP_MAX_TICKS (200u * TORQUE_COMMAND_TICKS_PER_MS)

typedef struct {
    int32_t limit_unm; /* >= 0 */
    uint32_t slew_unm_per_s;
    uint32_t stop_ticks; /* 1 .. TORQUE_COMMAND_STOP_MAX_TICKS */
} torque_command_settings_t;

typedef enum {
    TORQUE_FOLLOWS,
    TORQUE_STOPS,         /* to 0 in stop_ticks */
    TORQUE_STOPS_BY_SLEW, /* to 0 by the slew limit, or in the longest time if that is sooner */
} torque_course_t;

typedef struct {
    int32_t torque_unm;
    uint32_t slew_remainder; /* of the last division of the slew by the tick rate */
    int32_t stop_step_unm;   /* a tick, while it stops */
    torque_course_t course;  /* of the last tick */
    bool limited;            /* the torque limit cuts the wanted torque */
} torque_command_t;

/* The bridge is off: no torque, nothing to remember. */
void torque_command_idle(torque_command_t *command);

/* One tick towards `wanted_unm`, or to 0 while it stops. */
void torque_command_step(torque_command_t *command, const torque_command_settings_t *settings,
                         torque_course_t course, int32_t wanted_unm);

#endif
