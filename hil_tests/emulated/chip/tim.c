/* tim.c: counters of TIM1 to TIM8 (RM0090 chapters 17, 18, 20): counting, update events, preload.
 *
 * A running counter is a start time and a start value; its count at any moment is computed, and
 * only overflows and underflows are events. Output stages and break: pwm.c. Encoder edges:
 * encoder.c. Not modelled, and noted when used: DMA, input capture, compare interrupts, slave
 * modes other than the encoder's.
 */
#include "chip.h"

#include <string.h>

enum { CEN = 1, UDIS = 2, URS = 4, OPM = 8, DIR = 16, CMS = 0x60, ARPE = 0x80 };
enum { UIF = 1, BIF = 0x80, UIE = 1, BIE = 0x80 };

static bool is_advanced(int n) {
    return n == 1 || n == 8;
}

static uint32_t width_mask(int n) {
    return n == 2 || n == 5 ? 0xFFFFFFFFu : 0xFFFFu;
}

bool tim_is_encoder(const tim_t *t) {
    return (t->smcr & 7u) >= 1 && (t->smcr & 7u) <= 3;
}

uint32_t tim_clock_hz(const machine_t *m, int n) {
    return is_advanced(n) ? m->rcc.tim1_hz : m->rcc.tim2_hz;
}

tick_t tim_ticks_per_count(const machine_t *m, int n) {
    return TICKS_PER_SECOND / tim_clock_hz(m, n) * (m->tim[n].psc_now + 1);
}

static bool counts_time(const tim_t *t) {
    return (t->cr1 & CEN) && !t->frozen && !tim_is_encoder(t) && t->arr_now != 0;
}

static uint32_t count_now(const machine_t *m, int n) {
    const tim_t *t = &m->tim[n];
    if (!counts_time(t) || m->now <= t->base_time) {
        return t->base_count;
    }
    uint64_t counts = (m->now - t->base_time) / tim_ticks_per_count(m, n);
    if (t->down) {
        return counts < t->base_count ? t->base_count - (uint32_t)counts : 0;
    }
    return (uint32_t)(t->base_count + counts) & width_mask(n);
}

/* Counts from base_count to the next overflow or underflow. */
static uint64_t counts_to_event(const tim_t *t, int n) {
    if (t->cr1 & CMS) { /* centre-aligned: turns round on reaching ARR and 0 */
        uint64_t left =
            t->down ? t->base_count : (t->base_count < t->arr_now ? t->arr_now - t->base_count : 0);
        return left != 0 ? left : 1;
    }
    if (t->down) {
        return (uint64_t)t->base_count + 1;
    }
    uint32_t top = t->base_count <= t->arr_now ? t->arr_now : width_mask(n);
    return (uint64_t)top - t->base_count + 1;
}

/* Rising edge of TIM1's channel 4 reference, which can start injected conversions. */
static void schedule_trigger(machine_t *m) {
    const tim_t *t = &m->tim[1];
    uint32_t mode = t->ccmr[1] >> 12 & 7u; /* OC4M */
    bool second = mode == 7;
    tick_t at = NEVER;
    uint32_t ccr = t->ccr_now[3];
    if (counts_time(t) && (t->ccer & 1u << 12) && (mode == 6 || mode == 7)) {
        tick_t per_count = tim_ticks_per_count(m, 1);
        if (second && !t->down && ccr > t->base_count && ccr <= t->arr_now) {
            at = t->base_time + (ccr - t->base_count) * per_count;
        } else if (!second && t->down && ccr < t->base_count) {
            at = t->base_time + (t->base_count - ccr) * per_count;
        } else if (!second && !(t->cr1 & CMS) && !t->down) { /* active again at the wrap */
            at = t->base_time + ((tick_t)t->arr_now + 1 - t->base_count) * per_count;
        }
    }
    schedule(m, EVENT_TRIGGER, at > m->now ? at : NEVER);
}

static void plan(machine_t *m, int n) {
    const tim_t *t = &m->tim[n];
    tick_t at =
        counts_time(t) ? t->base_time + counts_to_event(t, n) * tim_ticks_per_count(m, n) : NEVER;
    schedule(m, EVENT_TIM + n, at);
    if (n == 1) {
        schedule_trigger(m);
    }
}

void tim_trigger_event(machine_t *m, tick_t at) {
    m->tim[1].sr |= 1u << 4; /* CC4IF */
    adc_trigger_injected(m, 0, at);
    if ((m->tim[1].cr2 >> 4 & 7u) == 7) { /* MMS: OC4REF is TRGO */
        adc_trigger_injected(m, 1, at);
    }
}

void tim_update_irq(machine_t *m, int n) {
    static const uint8_t update_irq[TIMERS] = {0, 25, 28, 29, 30, 50, 54, 55, 44};
    const tim_t *t = &m->tim[n];
    irq_level(m, update_irq[n], (t->sr & UIF) && (t->dier & UIE));
    if (is_advanced(n)) {
        irq_level(m, n == 1 ? 24 : 43, (t->sr & BIF) && (t->dier & BIE));
    }
}

static void load_preloaded(tim_t *t) {
    t->psc_now = t->psc;
    t->arr_now = t->arr;
    memcpy(t->ccr_now, t->ccr, sizeof t->ccr_now);
}

static void trigger_output(machine_t *m, int n, tick_t at) {
    static const int8_t source[TIMERS] = {-1, 1, 3, -1, 9, 11, -1, -1, -1}; /* JEXTSEL of TRGO */
    if (source[n] >= 0) {
        adc_trigger_injected(m, (unsigned)source[n], at);
    }
}

/* An update event: buffers take effect (17.3.1). */
static void update_event(machine_t *m, int n, tick_t at, bool flagged) {
    tim_t *t = &m->tim[n];
    if (n == 1) {
        bridge_advance(m, at);
    }
    load_preloaded(t);
    t->repeat = t->rcr;
    if (n == 1) {
        bridge_check_enabled(m);
    }
    if (flagged) {
        t->sr |= UIF;
        tim_update_irq(m, n);
    }
    if ((t->cr2 >> 4 & 7u) == 2) { /* MMS: update */
        trigger_output(m, n, at);
    }
}

void tim_event(machine_t *m, int n, tick_t at) {
    tim_t *t = &m->tim[n];
    bool centred = (t->cr1 & CMS) != 0;
    bool wrapped_past_arr = !centred && !t->down && t->base_count > t->arr_now;
    if (centred) {
        t->base_count = t->down ? 0 : t->arr_now;
        t->down = !t->down;
    } else {
        t->base_count = 0;
    }
    t->base_time = at;
    if (is_advanced(n) && t->repeat > 0) {
        t->repeat--;
    } else if (!(t->cr1 & UDIS) && !wrapped_past_arr) {
        update_event(m, n, at, true);
        t->cr1 &= t->cr1 & OPM ? ~(uint32_t)CEN : ~0u;
    }
    if (!centred && t->down) {
        t->base_count = t->arr_now;
    }
    plan(m, n);
}

/* Freezes the computed count into base_count, so that what it is computed from may change. */
static void settle(machine_t *m, int n) {
    m->tim[n].base_count = count_now(m, n);
    m->tim[n].base_time = m->now;
}

void tim_freeze(machine_t *m, int n, bool frozen) {
    settle(m, n);
    m->tim[n].frozen = frozen;
    plan(m, n);
}

void tim_clock_changed(machine_t *m, bool before) {
    for (int n = 1; n < TIMERS; n++) {
        if (before) {
            settle(m, n);
        } else {
            plan(m, n);
        }
    }
}

static void generate(machine_t *m, int n, uint32_t value) {
    tim_t *t = &m->tim[n];
    if (value & 1u) { /* UG: counter and prescaler start again */
        t->down = !(t->cr1 & CMS) && (t->cr1 & DIR);
        if (!(t->cr1 & UDIS)) {
            update_event(m, n, m->now, !(t->cr1 & URS));
        }
        t->base_count = t->down ? t->arr_now : 0;
        t->base_time = m->now;
    }
    if ((value & 0x80u) && is_advanced(n)) {
        pwm_software_break(m);
    }
    if (value & 0x7Eu) {
        unmodelled(m, "TIM%d: EGR %02x is not modelled", n, value & 0x7Eu);
    }
}

static void write_cr1(machine_t *m, int n, uint32_t value) {
    tim_t *t = &m->tim[n];
    uint32_t old = t->cr1;
    t->cr1 = value & 0x3FFu;
    if (t->cr1 & CMS) {
        t->cr1 = (t->cr1 & ~(uint32_t)DIR) | (old & DIR); /* read only here */
        t->down = (old & CMS) ? t->down : false;
    } else if (!tim_is_encoder(t)) {
        t->down = (t->cr1 & DIR) != 0;
    }
    if (((old ^ t->cr1) & CMS) && (old & CEN) && (t->cr1 & CEN)) {
        note(m, "TIM%d: CMS changed while the counter runs", n);
    }
}

static void write_ccr(machine_t *m, int n, int channel, uint32_t value) {
    tim_t *t = &m->tim[n];
    t->ccr[channel] = value & width_mask(n);
    bool preload = t->ccmr[channel / 2] >> (3 + 8 * (channel % 2)) & 1u; /* OCxPE */
    if (!preload) {
        t->ccr_now[channel] = t->ccr[channel];
    }
}

static void note_unmodelled(machine_t *m, int n, uint32_t offset, uint32_t value) {
    uint32_t slave = value & 7u;
    if (offset == 0x08 && (slave >= 4 || (value & 1u << 14))) {
        unmodelled(m, "TIM%d: slave mode %u is not modelled", n, slave);
    } else if (offset == 0x0C && (value & ~(UIE | BIE | 0u))) {
        unmodelled(m, "TIM%d: DIER %04x: only UIE and BIE are modelled", n, value);
    } else if (is_advanced(n) && n != 1 && offset == 0x44) {
        unmodelled(m, "TIM8: outputs are not modelled");
    }
}

uint32_t tim_read(machine_t *m, int n, uint32_t offset) {
    const tim_t *t = &m->tim[n];
    switch (offset) {
    case 0x00:
        return (t->cr1 & ~(uint32_t)DIR) | (t->down ? DIR : 0u);
    case 0x04:
        return t->cr2;
    case 0x08:
        return t->smcr;
    case 0x0C:
        return t->dier;
    case 0x10:
        return t->sr;
    case 0x18:
        return t->ccmr[0];
    case 0x1C:
        return t->ccmr[1];
    case 0x20:
        return t->ccer;
    case 0x24:
        return count_now(m, n);
    case 0x28:
        return t->psc;
    case 0x2C:
        return t->arr;
    case 0x30:
        return t->rcr;
    case 0x34:
    case 0x38:
    case 0x3C:
    case 0x40:
        return t->ccr[(offset - 0x34) / 4];
    case 0x44:
        return t->bdtr;
    default:
        return 0;
    }
}

void tim_write(machine_t *m, int n, uint32_t offset, uint32_t value) {
    tim_t *t = &m->tim[n];
    settle(m, n);
    note_unmodelled(m, n, offset, value);
    if (n == 1) {
        bridge_advance(m, m->now);
    }
    switch (offset) {
    case 0x00:
        write_cr1(m, n, value);
        break;
    case 0x04:
        t->cr2 = value;
        break;
    case 0x08:
        t->smcr = value & 0xFFFFu;
        break;
    case 0x0C:
        t->dier = value & 0x7FFFu;
        break;
    case 0x10: /* cleared by writing 0; BIF stays while the break input is active */
        t->sr &= value | (n == 1 && pwm_break_active(m) ? (uint32_t)BIF : 0u);
        break;
    case 0x14:
        generate(m, n, value);
        break;
    case 0x18:
        t->ccmr[0] = value & 0xFFFFu;
        break;
    case 0x1C:
        t->ccmr[1] = value & 0xFFFFu;
        break;
    case 0x20:
        pwm_write_ccer(m, n, value);
        break;
    case 0x24:
        t->base_count = value & width_mask(n);
        break;
    case 0x28:
        t->psc = value & 0xFFFFu;
        break;
    case 0x2C:
        t->arr = value & width_mask(n);
        t->arr_now = t->cr1 & ARPE ? t->arr_now : t->arr;
        break;
    case 0x30:
        t->rcr = value & 0xFFu;
        break;
    case 0x34:
    case 0x38:
    case 0x3C:
    case 0x40:
        write_ccr(m, n, (int)(offset - 0x34) / 4, value);
        break;
    case 0x44:
        pwm_write_bdtr(m, n, value);
        break;
    default:
        break;
    }
    if (n == 1) {
        bridge_check_enabled(m);
    }
    tim_update_irq(m, n);
    plan(m, n);
}

void tim_reset(machine_t *m, int n) {
    if (n == 1) {
        bridge_advance(m, m->now);
    }
    memset(&m->tim[n], 0, sizeof m->tim[n]);
    m->tim[n].arr = width_mask(n);
    m->tim[n].arr_now = width_mask(n);
    tim_update_irq(m, n);
    schedule(m, EVENT_TIM + n, NEVER);
    if (n == 1) {
        schedule(m, EVENT_TRIGGER, NEVER);
        bridge_check_enabled(m);
    }
}
