/* erase.h: erases a storage sector while watchdog, clock and bus are served.
 *
 * While a sector is erased, for one to two seconds, nothing can be read from the flash, neither
 * code nor vectors. So this waits in SRAM with interrupts off: it feeds the independent watchdog,
 * counts the control periods that go by, and sends a heartbeat every 50 ms. The bridge must be off.
 */
#ifndef BOWDEN_STM32F405_ERASE_H
#define BOWDEN_STM32F405_ERASE_H

#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

/* Erases a sector of flash.h; `heartbeat` is sent meanwhile when the first mailbox is free. Returns
 * the control periods that have gone by, at most ERASE_PERIODS_MAX. */
uint32_t erase_sector(uint32_t sector, const can_frame_t *heartbeat);

/* 3 s: a sector takes at most two. */
#define ERASE_PERIODS_MAX (3000000u / BOARD_CONTROL_PERIOD_US)

#endif
