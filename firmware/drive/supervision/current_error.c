/* current_error.c: see current_error.h. */
#include "current_error.h"

#define LAG_TICKS 16 /* 4 ms */

static int32_t magnitude(int32_t value) {
    return value < 0 ? -value : value;
}

int32_t current_error_step(current_error_t *error, int32_t commanded_ua, int32_t measured_ua) {
    const int32_t change_ua = magnitude(commanded_ua - error->commanded_ua);
    error->commanded_ua = commanded_ua;
    const int32_t lag_ua = error->lag_ua - error->lag_ua / LAG_TICKS;
    error->lag_ua = lag_ua < INT32_MAX - change_ua ? lag_ua + change_ua : INT32_MAX;
    const int32_t off_ua = magnitude(commanded_ua - measured_ua) - error->lag_ua;
    return off_ua > 0 ? off_ua : 0;
}
