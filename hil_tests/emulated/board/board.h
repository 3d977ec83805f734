/* board.h: what is wired to the chip. */
#ifndef EMULATED_BOARD_H
#define EMULATED_BOARD_H

#include "chip/chip.h"

/* ---- can_bus.c ---- */
void can_bus_event(machine_t *m, tick_t at);

#endif
