/* ports.h: calls from a lower layer to a higher one, which defines them.
 *
 * A pin or timer that changes an output lets the bridge catch up first; the CAN controller claims
 * the wire; a write to the flash lets what is due happen; the core's registers are unicorn's. */
#ifndef EMULATED_PORTS_H
#define EMULATED_PORTS_H

#include "state.h"

/* ---- board/bridge.c ---- */
void bridge_advance(machine_t *m, tick_t at); /* call before anything that changes its voltage */
double bridge_sensed_a(machine_t *m);         /* what the current amplifier makes of the current */
void bridge_check_enabled(machine_t *m);      /* and this after it */

/* ---- board/can_bus.c ---- */
void can_bus_arbitrate(machine_t *m, tick_t at);
void can_bus_drop_node(machine_t *m); /* the node left the bus in mid-frame (reset) */
tick_t can_bit_ticks(const machine_t *m);

/* ---- system/bus.c ---- */
void bus_fault(machine_t *m, uint32_t address); /* of the running access */

/* ---- system/cpu.c ---- */
void cpu_forget_code(machine_t *m); /* the flash has changed */
uint8_t *memory_at(machine_t *m, uint32_t address, uint32_t length);
uint32_t cpu_get(machine_t *m, int reg);
void cpu_set(machine_t *m, int reg, uint32_t value);

/* ---- system/events.c ---- */
void events_run(machine_t *m);

#endif
