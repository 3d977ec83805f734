/* winding.c: see winding.h. */
#include "winding.h"

int32_t winding_step(winding_t *winding, int32_t current_ua) {
    if (winding_is_done(winding)) {
        return 0;
    }
    const int32_t along_ua = winding->negative ? -current_ua : current_ua;
    winding->since++;
    if (along_ua >= WINDING_TURN_UA || winding->since >= WINDING_TURN_SAMPLES) {
        winding->negative = !winding->negative;
        winding->since = 0;
    }
    const int32_t positive = winding->negative ? 0 : 1;
    winding->trace_ua[winding->count] = current_ua / 2 * 2 + positive;
    winding->count++;
    return winding->negative ? -WINDING_DUTY : WINDING_DUTY;
}

bool winding_is_done(const winding_t *winding) {
    return winding->count >= BOARD_WINDING_SAMPLES;
}
