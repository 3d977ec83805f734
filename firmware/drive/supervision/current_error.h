/* current_error.h: does the motor current follow its command?
 *
 * A current that lags its command by a time constant T is off by no more than the changes of the
 * command, each forgotten with T; so is one that is late by less. T is 4 ms, several times what an
 * amplifier needs, and what is beyond that is an error. Pure.
 */
#ifndef BOWDEN_DRIVE_SUPERVISION_CURRENT_ERROR_H
#define BOWDEN_DRIVE_SUPERVISION_CURRENT_ERROR_H

#include <stdint.h>

typedef struct {
    int32_t commanded_ua; /* in the last tick */
    int32_t lag_ua;       /* what the lag explains, >= 0 */
} current_error_t;

/* One tick: by how much the measured current is off, beyond the lag; 0 where it is not.
 * `commanded_ua`: until this tick. Both within +-2^30. */
int32_t current_error_step(current_error_t *error, int32_t commanded_ua, int32_t measured_ua);

#endif
