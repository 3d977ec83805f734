/* winding.h: the motor's winding under an alternating voltage: a trace of its current. Pure.
 *
 * A relay: 10 % of the supply, turned round when the current reaches 0.8 A or after 40 periods. So
 * the current stays small whatever the winding is, its mean is near 0 and the rotor hardly moves,
 * and both the slope of the current (inductance) and its bend (resistance) are in the trace. What
 * follows from it is the host's business.
 */
#ifndef BOWDEN_STM32F405_WINDING_H
#define BOWDEN_STM32F405_WINDING_H

#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

/* Duty difference of the legs, of a full scale of 4200. */
#define WINDING_DUTY 420
#define WINDING_TURN_UA 800000
#define WINDING_TURN_SAMPLES 40u

typedef struct {
    uint32_t count; /* samples in the trace; start with all 0 */
    uint32_t since; /* samples since the voltage was turned round */
    bool negative;
    int32_t trace_ua[BOARD_WINDING_SAMPLES]; /* bit 0: the voltage put out now is positive */
} winding_t;

/* One sample, 20 kHz. Returns the duty to put out, 0 once the trace is full. */
int32_t winding_step(winding_t *winding, int32_t current_ua);

/* Is the trace full? */
bool winding_is_done(const winding_t *winding);

#endif
