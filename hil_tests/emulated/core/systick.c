/* systick.c: the core's timer (PM0214 4.5) and the cycle counter of the debug unit.
 *
 * DWT_CYCCNT counts executed instructions times the option cycles_per_instruction, plus entry and
 * return of exceptions. It stands still in WFI, as on a chip without a debugger.
 */
#include "core.h"

#include <string.h>

static tick_t ticks_per_count(const machine_t *m) {
    return TICKS_PER_SECOND / m->rcc.hclk_hz * (m->systick.csr & 4u ? 1 : 8);
}

static uint32_t counts_left(const machine_t *m) {
    const systick_t *s = &m->systick;
    if (!(s->csr & 1u)) {
        return s->start_count;
    }
    tick_t passed = m->now > s->start_time ? (m->now - s->start_time) / ticks_per_count(m) : 0;
    if (s->start_count == 0 && passed > 0) { /* the first clock after a write loads RVR */
        return s->rvr - (uint32_t)(passed - 1);
    }
    return passed < s->start_count ? s->start_count - (uint32_t)passed : 0;
}

static void plan(machine_t *m, uint32_t count, tick_t from) {
    systick_t *s = &m->systick;
    s->start_count = count;
    s->start_time = from;
    bool counts = (s->csr & 1u) && s->rvr != 0;
    tick_t clocks = count != 0 ? count : (tick_t)s->rvr + 1;
    schedule(m, EVENT_SYSTICK, counts ? from + clocks * ticks_per_count(m) : NEVER);
}

void systick_event(machine_t *m, tick_t at) {
    m->systick.csr |= 1u << 16;
    if (m->systick.csr & 2u) {
        exception_pend(m, SYSTICK);
    }
    plan(m, 0, at);
}

void systick_clock_changed(machine_t *m, bool before) {
    systick_t *s = &m->systick;
    tick_t awake = m->now - m->cpu.slept;
    tick_t per_cycle = TICKS_PER_SECOND / m->rcc.hclk_hz;
    if (before) {
        s->start_count = counts_left(m);
        s->cycles_base += awake / per_cycle;
    } else {
        plan(m, s->start_count, m->now);
        s->cycles_base -= awake / per_cycle;
    }
}

static uint32_t cycle_counter(const machine_t *m) {
    tick_t awake = m->now - m->cpu.slept;
    return (uint32_t)(awake / (TICKS_PER_SECOND / m->rcc.hclk_hz) + m->systick.cycles_base);
}

uint32_t systick_read(machine_t *m, uint32_t offset) {
    systick_t *s = &m->systick;
    uint32_t value = s->csr;
    switch (offset) {
    case 0x10:
        s->csr &= m->peeking ? ~0u : ~(1u << 16);
        return value;
    case 0x14:
        return s->rvr;
    case 0x18:
        return counts_left(m);
    case 0x1C:
        return 0x4000493Eu; /* CALIB: 18750 in 1 ms at HCLK/8 = 18.75 MHz */
    case 0x1000:
        return s->dwt_ctrl;
    case 0x1004:
        return s->dwt_ctrl & 1u ? cycle_counter(m) : 0;
    default:
        return 0;
    }
}

void systick_write(machine_t *m, uint32_t offset, uint32_t value) {
    systick_t *s = &m->systick;
    uint32_t left = counts_left(m);
    switch (offset) {
    case 0x10:
        s->csr = (s->csr & 1u << 16) | (value & 7u);
        plan(m, left, m->now);
        break;
    case 0x14:
        s->rvr = value & 0xFFFFFFu;
        plan(m, left, m->now);
        break;
    case 0x18: /* any write clears the counter and COUNTFLAG */
        s->csr &= ~(1u << 16);
        plan(m, 0, m->now);
        break;
    case 0x1000:
        s->dwt_ctrl = value;
        break;
    case 0x1004:
        s->cycles_base += (uint64_t)value - cycle_counter(m);
        break;
    default:
        break;
    }
}

void systick_reset(machine_t *m) {
    uint64_t cycles = m->systick.cycles_base;
    memset(&m->systick, 0, sizeof m->systick);
    m->systick.cycles_base = cycles;
    m->systick.dwt_ctrl = 0x40000000u;
    schedule(m, EVENT_SYSTICK, NEVER);
}
