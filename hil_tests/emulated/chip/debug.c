/* debug.c: a debugger that halts the core, and what stands still with it (RM0090 38.16).
 *
 * The freeze bits of DBGMCU_APB1_FZ and APB2_FZ act while the core is halted; modelled for the IWDG
 * and TIM1. RM0090 does not say what the outputs of a frozen TIM1 do; the manuals of similar chips
 * say that they open, as after a break. The option frozen_timer_drives is the other reading: they
 * keep driving. Not modelled: SysTick, which really stops.
 */
#include "chip.h"

enum { IWDG_STOP = 1u << 12, TIM1_STOP = 1u << 0 };

uint32_t debug_read(const machine_t *m, uint32_t offset) {
    switch (offset) {
    case 0x0:
        return 0x10076413u; /* DBGMCU_IDCODE: STM32F405 revision 1 */
    case 0x4:
        return m->debug.cr;
    case 0x8:
        return m->debug.apb1_fz;
    case 0xC:
        return m->debug.apb2_fz;
    default:
        return 0;
    }
}

void debug_write(machine_t *m, uint32_t offset, uint32_t value) {
    m->debug.cr = offset == 0x4 ? value : m->debug.cr;
    m->debug.apb1_fz = offset == 0x8 ? value : m->debug.apb1_fz;
    m->debug.apb2_fz = offset == 0xC ? value : m->debug.apb2_fz;
}

/* Only power-on clears them (38.16.3). */
void debug_power_on(machine_t *m) {
    m->debug = (debug_t){.halted = m->debug.halted};
}

void machine_halt(machine_t *m, bool halted) {
    if (m->debug.halted == halted) {
        return;
    }
    m->debug.halted = halted;
    bridge_advance(m, m->now);
    tim_freeze(m, 1, halted && (m->debug.apb2_fz & TIM1_STOP));
    bridge_check_enabled(m);
    iwdg_freeze(m, halted && (m->debug.apb1_fz & IWDG_STOP));
}
