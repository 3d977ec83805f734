/* pins.h: the board's pin map (docs/hardware.md), set once at start. */
#ifndef BOWDEN_STM32F405_PINS_H
#define BOWDEN_STM32F405_PINS_H

#include <stdbool.h>

/* Gives every pin its function. Peripherals behind alternate functions need not run yet: their
 * outputs stay low or open. */
void pins_start(void);

void pins_lamp(bool on);

#endif
