/* core.h: the Cortex-M4 beside its instructions. */
#ifndef EMULATED_CORE_H
#define EMULATED_CORE_H

#include "ports.h"
#include "services/services.h"

/* ---- account.c ---- */
void account_enter(machine_t *m);                /* depth has grown */
void account_leave(machine_t *m, int exception); /* before depth shrinks */
void account_sleep(machine_t *m);
void account_wake(machine_t *m);

/* ---- exceptions.c ---- */
void exception_pend(machine_t *m, int exception);
void irq_level(machine_t *m, int irq, bool asserted);
int exception_takeable(machine_t *m); /* 0: none */
bool exception_wakes(machine_t *m);   /* a pending one would end WFI, PRIMASK aside */
void exception_enter(machine_t *m, int exception);
void exception_return(machine_t *m, uint32_t exc_return);
void exception_fault(machine_t *m, const fault_t *fault);
int execution_priority(const machine_t *m);

/* ---- mpu.c ---- */
bool mpu_permits(const machine_t *m, uint32_t address, int access);
uint32_t mpu_read(machine_t *m, uint32_t offset);
void mpu_write(machine_t *m, uint32_t offset, uint32_t value);
void mpu_changed(machine_t *m); /* registers or active exceptions; takes effect at the next stop */
void mpu_apply(machine_t *m);
void mpu_reset(machine_t *m);

/* ---- scs.c ---- */
void nvic_reset(machine_t *m);
uint32_t scs_read(machine_t *m, uint32_t offset);
void scs_write(machine_t *m, uint32_t offset, uint32_t value, unsigned size);

/* ---- systick.c ---- */
uint32_t systick_read(machine_t *m, uint32_t offset);
void systick_write(machine_t *m, uint32_t offset, uint32_t value);
void systick_event(machine_t *m, tick_t at);
void systick_reset(machine_t *m);
void systick_clock_changed(machine_t *m, bool before);

#endif
