/* keep_reference.h: keeps the angles over a reset that spares the memory (drive/reference.h).
 *
 * The record lies in .noinit with a check word. SysTick alone writes it: while the control tick
 * hangs it goes on looking at the encoders' counters, until the reset. After a watchdog reset
 * without a late tick noted by SysTick the counters were not observed: then the angles are not
 * kept.
 */
#ifndef BOWDEN_STM32F405_KEEP_REFERENCE_H
#define BOWDEN_STM32F405_KEEP_REFERENCE_H

#include <stdbool.h>

#include "../board.h"
#include "encoders.h"

/* What the program before this one has kept, if that counts after this reset. Once, at start. */
board_reference_t kept_reference(reset_cause_t reset);

/* Of the last control tick, and the counters then. */
void keep_reference(board_reference_t reference, encoders_latch_t latch);

/* The control tick is late: has anything moved since? `hangs`: the watchdog is no longer fed. */
void watch_reference(encoders_latch_t latch, bool hangs);

#endif
