/* system.h: the processor, and what holds everything together. */
#ifndef EMULATED_SYSTEM_H
#define EMULATED_SYSTEM_H

#include "board/board.h"

/* ---- bus.c ---- */
void bus_map(machine_t *m);

/* ---- cpu.c ---- */
bool cpu_open(machine_t *m);
void cpu_reset(machine_t *m);
int cpu_run(machine_t *m);

/* ---- machine.c ---- */
void perform_reset(machine_t *m);

#endif
