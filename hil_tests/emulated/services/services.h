/* services.h: what any part of the machine may ask for. */
#ifndef EMULATED_SERVICES_H
#define EMULATED_SERVICES_H

#include "state.h"

void schedule(machine_t *m, int event, tick_t at);
/* A rule of the manual that the program broke; a use of what the emulator does not do. */
void note(machine_t *m, const char *format, ...) __attribute__((format(printf, 2, 3)));
void unmodelled(machine_t *m, const char *format, ...) __attribute__((format(printf, 2, 3)));
void request_reset(machine_t *m, uint32_t cause); /* RCC_CSR flag; performed between blocks */
uint64_t ticks_to_ns(tick_t ticks);
void schedule_next(machine_t *m); /* after a slot has changed: finds the earliest */

#endif
