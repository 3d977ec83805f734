/* fast_loop.h: the 20 kHz loop: sample, protect, control the current.
 *
 * Runs in the converter's interrupt (adc_handler). The control tick sets what it must do with
 * fast_loop_command() and takes what it has seen with fast_loop_take().
 */
#ifndef BOWDEN_STM32F405_FAST_LOOP_H
#define BOWDEN_STM32F405_FAST_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "current_loop.h"
#include "current_monitor.h"
#include "scaling.h"

/* A sample beyond it, 15 A, opens the bridge at once. */
#define FAST_LOOP_CURRENT_MAX_UA SUPERVISION_OVERCURRENT_LIMIT_UA

/* The load cell's amplifier is broken or saturated when a code is this close to either end. */
#define FAST_LOOP_RAIL_CODES 2

/* Everything that was seen since it was last taken. */
typedef struct {
    scaling_window_t window;
    bool overcurrent;       /* by a sample, or by the bridge's own fault line */
    bool current_model;     /* the current does not follow from the voltage */
    bool inputs_differ;     /* not every sample had the same code on all four inputs */
    bool load_cell_at_rail; /* any sample */
    bool load_cell_moved;   /* its code was not the same in all samples, the one before included */
} fast_loop_report_t;

/* Takes the report and starts a new one; false, and `taken` untouched, while the loop itself is at
 * work on it: then it goes into the next. Call it from a higher priority than the converter's. */
bool fast_loop_take(fast_loop_report_t *taken);

/* What the current sensor reads with the bridge off, mean of 256 samples: it is taken off every
 * current. It is measured anew all the time that the bridge is off; the last one holds. */
int32_t fast_loop_zero_ua(void);

/* The motor for the current monitor; in every control tick. */
void fast_loop_motor(const current_monitor_motor_t *motor);

/* The current controller's gains; only while the bridge is off. */
void fast_loop_tune(current_loop_gains_t of_winding);

/* Instead of the current control, while `wanted` and the bridge is on: trace the winding. A new
 * trace begins when it was not wanted before. */
void fast_loop_trace_winding(bool wanted);

/* The last trace when it is full, else NULL. */
const int32_t *fast_loop_winding_ua(void);

/* What to do from the next sample on. Bridge off takes effect at once; after an overcurrent the
 * bridge stays off until it has been commanded off. */
void fast_loop_command(int32_t current_ua, bool bridge_on);

#endif
