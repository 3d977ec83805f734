/* adc.c: ADC1 to ADC3 (RM0090 chapter 13): regular and injected sequences, one conversion at a
 * time, with sampling and conversion time, offsets, end-of-conversion flags, overrun, watchdog.
 *
 * Inputs are codes of the 12-bit scale with fractions; noise is added before rounding. Not
 * modelled, and noted when used: DMA, discontinuous and dual mode, automatic injection.
 */
#include "chip.h"

#include <math.h>
#include <string.h>

enum { SR_AWD = 1, SR_EOC = 2, SR_JEOC = 4, SR_JSTRT = 8, SR_STRT = 16, SR_OVR = 32 };
enum { CR2_ADON = 1, CR2_CONT = 2, CR2_EOCS = 1 << 10, CR2_ALIGN = 1 << 11 };
enum { CR1_SCAN = 1 << 8, IRQ_ADC = 18 };

static uint32_t clock_hz(const machine_t *m) {
    return m->rcc.pclk2_hz / (2 * ((m->adcs.ccr >> 16 & 3u) + 1));
}

static uint32_t adc_cycles(const adc_t *a, unsigned channel) {
    static const uint16_t sampling[8] = {3, 15, 28, 56, 84, 112, 144, 480};
    static const uint8_t converting[4] = {12, 10, 8, 6};
    uint32_t field =
        channel >= 10 ? a->smpr[0] >> (3 * (channel - 10)) : a->smpr[1] >> (3 * channel);
    return sampling[field & 7u] + converting[a->cr1 >> 24 & 3u];
}

static unsigned regular_channel(const adc_t *a) {
    unsigned rank = (unsigned)a->regular_rank;
    return a->sqr[2 - rank / 6] >> (5 * (rank % 6)) & 31u;
}

static int regular_length(const adc_t *a) {
    return a->cr1 & CR1_SCAN ? (int)(a->sqr[0] >> 20 & 15u) + 1 : 1;
}

/* A sequence of JL + 1 conversions ends with JSQ4 (13.13.12). */
static unsigned injected_channel(const adc_t *a) {
    unsigned first = 3 - (a->jsqr >> 20 & 3u);
    return a->jsqr >> (5 * (first + (unsigned)a->injected_rank)) & 31u;
}

static int injected_length(const adc_t *a) {
    return a->cr1 & CR1_SCAN ? (int)(a->jsqr >> 20 & 3u) + 1 : 1;
}

static void update_irq(machine_t *m) {
    bool asserted = false;
    for (int n = 0; n < 3; n++) {
        uint32_t sr = m->adcs.adc[n].sr;
        uint32_t cr1 = m->adcs.adc[n].cr1;
        asserted |= ((sr & SR_EOC) && (cr1 & 1u << 5)) || ((sr & SR_AWD) && (cr1 & 1u << 6)) ||
                    ((sr & SR_JEOC) && (cr1 & 1u << 7)) || ((sr & SR_OVR) && (cr1 & 1u << 26));
    }
    irq_level(m, IRQ_ADC, asserted);
}

static double uniform(adcs_t *s) { /* xorshift64*, -0.5 .. 0.5 */
    s->random ^= s->random >> 12;
    s->random ^= s->random << 25;
    s->random ^= s->random >> 27;
    return (double)(s->random * 2685821657736338717ull >> 11) / 9007199254740992.0 - 0.5;
}

static void check_pin(machine_t *m, unsigned channel) {
    static const int8_t port[16] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 2, 2, 2, 2, 2, 2};
    static const int8_t pin[16] = {0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 0, 1, 2, 3, 4, 5};
    if (channel < 16 && !gpio_is_analog(m, port[channel], pin[channel])) {
        note(m, "ADC: input %u is converted but its pin is not analog", channel);
    }
}

static int sample(machine_t *m, const adc_t *a, unsigned channel, tick_t at) {
    adcs_t *s = &m->adcs;
    if (a->stuck_code >= 0) {
        return a->stuck_code;
    }
    if (channel >= 19) {
        note(m, "ADC: there is no input %u", channel);
        return 0;
    }
    check_pin(m, channel);
    double code = s->code[channel];
    if (m->bridge.connected && m->bridge.adc_channel == (int)channel) {
        bridge_advance(m, at);
        code = m->bridge.parameters.zero_code +
               bridge_sensed_a(m) / m->bridge.parameters.ampere_per_code;
    }
    if (s->noise[channel] > 0) { /* four uniforms have a variance of 1/3 */
        double sum = uniform(s) + uniform(s) + uniform(s) + uniform(s);
        code += s->noise[channel] * sum * 1.7320508075688772;
    }
    double rounded = floor(code + 0.5);
    int value = rounded < 0 ? 0 : rounded > 4095 ? 4095 : (int)rounded;
    return value >> (2 * (a->cr1 >> 24 & 3u));
}

static void begin(machine_t *m, int n, unsigned channel, tick_t at) {
    adc_t *a = &m->adcs.adc[n];
    uint32_t hz = clock_hz(m);
    if (hz > 36000000) {
        note(m, "ADC: clock of %u Hz exceeds 36 MHz", hz);
    }
    tick_t end = at + TICKS_PER_SECOND / hz * adc_cycles(a, channel);
    schedule(m, EVENT_ADC + n, a->hung ? NEVER : end);
}

static bool ready(machine_t *m, int n, tick_t at) {
    adc_t *a = &m->adcs.adc[n];
    if (!(a->cr2 & CR2_ADON)) {
        return false;
    }
    if (at < a->powered_at + 3 * TICKS_PER_US) {
        note(m, "ADC%d: started within 3 us of ADON", n + 1);
    }
    return true;
}

static void start_injected(machine_t *m, int n, tick_t at) {
    adc_t *a = &m->adcs.adc[n];
    if (a->injected_runs || !ready(m, n, at)) {
        return;
    }
    a->regular_waits = a->regular_runs; /* its conversion starts again afterwards */
    a->regular_runs = false;
    a->injected_runs = true;
    a->injected_rank = 0;
    a->sr |= SR_JSTRT;
    begin(m, n, injected_channel(a), at);
}

static void start_regular(machine_t *m, int n, tick_t at) {
    adc_t *a = &m->adcs.adc[n];
    if (a->regular_runs || a->regular_waits || !ready(m, n, at)) {
        return;
    }
    a->regular_rank = 0;
    a->sr |= SR_STRT;
    if (a->injected_runs) {
        a->regular_waits = true;
    } else {
        a->regular_runs = true;
        begin(m, n, regular_channel(a), at);
    }
}

void adc_trigger_injected(machine_t *m, unsigned source, tick_t at) {
    for (int n = 0; n < 3; n++) {
        uint32_t cr2 = m->adcs.adc[n].cr2;
        bool clocked = m->rcc.enable[4] >> (8 + n) & 1u;
        if (clocked && (cr2 & 1u << 20) && (cr2 >> 16 & 15u) == source) { /* JEXTEN: rising edge */
            start_injected(m, n, at);
        }
    }
}

static void watch(adc_t *a, int code, bool injected) {
    bool watched = a->cr1 & (injected ? 1u << 22 : 1u << 23);
    if (watched && ((uint32_t)code > a->htr || (uint32_t)code < a->ltr)) {
        a->sr |= SR_AWD;
    }
}

static void end_injected(machine_t *m, int n, tick_t at) {
    adc_t *a = &m->adcs.adc[n];
    int code = sample(m, a, injected_channel(a), at);
    watch(a, code, true);
    int32_t result = code - (int32_t)a->jofr[a->injected_rank];
    a->jdr[a->injected_rank] = a->cr2 & CR2_ALIGN ? result * 8 : result;
    if (++a->injected_rank < injected_length(a)) {
        begin(m, n, injected_channel(a), at);
        return;
    }
    a->injected_runs = false;
    a->sr |= SR_JEOC;
    if (a->regular_waits) {
        a->regular_waits = false;
        a->regular_runs = true;
        begin(m, n, regular_channel(a), at);
    }
}

static void end_regular(machine_t *m, int n, tick_t at) {
    adc_t *a = &m->adcs.adc[n];
    int code = sample(m, a, regular_channel(a), at);
    watch(a, code, false);
    if ((a->cr2 & CR2_EOCS) && (a->sr & SR_EOC)) {
        a->sr |= SR_OVR;
    }
    a->dr = (uint32_t)(a->cr2 & CR2_ALIGN ? code * 16 : code);
    bool last = ++a->regular_rank >= regular_length(a);
    if (last || (a->cr2 & CR2_EOCS)) {
        a->sr |= SR_EOC;
    }
    if (last) {
        a->regular_rank = 0;
    }
    a->regular_runs = !last || (a->cr2 & CR2_CONT);
    if (a->regular_runs) {
        begin(m, n, regular_channel(a), at);
    }
}

void adc_event(machine_t *m, int n, tick_t at) {
    if (m->adcs.adc[n].injected_runs) {
        end_injected(m, n, at);
    } else if (m->adcs.adc[n].regular_runs) {
        end_regular(m, n, at);
    }
    update_irq(m);
}

uint32_t adc_read(machine_t *m, uint32_t offset) {
    if (offset >= 0x300) {
        return offset == 0x304 ? m->adcs.ccr : 0;
    }
    int n = (int)(offset >> 8);
    adc_t *a = &m->adcs.adc[n];
    if (!(m->rcc.enable[4] >> (8 + n) & 1u)) {
        return 0;
    }
    switch (offset & 0xFFu) {
    case 0x00:
        return a->sr;
    case 0x04:
        return a->cr1;
    case 0x08:
        return a->cr2;
    case 0x0C:
    case 0x10:
        return a->smpr[((offset & 0xFFu) - 0x0C) / 4];
    case 0x14:
    case 0x18:
    case 0x1C:
    case 0x20:
        return a->jofr[((offset & 0xFFu) - 0x14) / 4];
    case 0x24:
        return a->htr;
    case 0x28:
        return a->ltr;
    case 0x2C:
    case 0x30:
    case 0x34:
        return a->sqr[((offset & 0xFFu) - 0x2C) / 4];
    case 0x38:
        return a->jsqr;
    case 0x3C:
    case 0x40:
    case 0x44:
    case 0x48:
        return (uint32_t)a->jdr[((offset & 0xFFu) - 0x3C) / 4];
    case 0x4C:
        if (!m->peeking) {
            a->sr &= ~(uint32_t)SR_EOC;
            update_irq(m);
        }
        return a->dr;
    default:
        return 0;
    }
}

static void write_cr2(machine_t *m, int n, uint32_t value) {
    adc_t *a = &m->adcs.adc[n];
    bool powered_up = !(a->cr2 & CR2_ADON) && (value & CR2_ADON);
    a->cr2 = value & 0x3F3F0F03u;
    if (powered_up) {
        a->powered_at = m->now;
    }
    if (!(a->cr2 & CR2_ADON)) {
        a->injected_runs = a->regular_runs = a->regular_waits = false;
        schedule(m, EVENT_ADC + n, NEVER);
    }
    if (value & (1u << 8 | 3u << 28)) {
        unmodelled(m, "ADC%d: DMA and external regular triggers are not modelled", n + 1);
    }
    if (value & 1u << 22) { /* JSWSTART */
        start_injected(m, n, m->now);
    }
    if (value & 1u << 30) { /* SWSTART */
        start_regular(m, n, m->now);
    }
}

void adc_write(machine_t *m, uint32_t offset, uint32_t value) {
    if (offset >= 0x300) {
        m->adcs.ccr = offset == 0x304 ? value : m->adcs.ccr;
        if (offset == 0x304 && (value & 0x1Fu)) {
            unmodelled(m, "ADC: dual and triple mode are not modelled");
        }
        return;
    }
    int n = (int)(offset >> 8);
    adc_t *a = &m->adcs.adc[n];
    if (!(m->rcc.enable[4] >> (8 + n) & 1u)) {
        note(m, "ADC%d written while its clock is off", n + 1);
        return;
    }
    uint32_t reg = offset & 0xFFu;
    switch (reg) {
    case 0x00:
        a->sr &= value;
        break; /* cleared by writing 0 */
    case 0x04:
        a->cr1 = value & 0x07C0FFFFu;
        if (value & 7u << 10) {
            unmodelled(m, "ADC%d: JAUTO and discontinuous mode are not modelled", n + 1);
        }
        break;
    case 0x08:
        write_cr2(m, n, value);
        break;
    case 0x0C:
    case 0x10:
        a->smpr[(reg - 0x0C) / 4] = value;
        break;
    case 0x14:
    case 0x18:
    case 0x1C:
    case 0x20:
        a->jofr[(reg - 0x14) / 4] = value & 0xFFFu;
        break;
    case 0x24:
        a->htr = value & 0xFFFu;
        break;
    case 0x28:
        a->ltr = value & 0xFFFu;
        break;
    case 0x2C:
    case 0x30:
    case 0x34:
        a->sqr[(reg - 0x2C) / 4] = value;
        break;
    case 0x38:
        a->jsqr = value & 0x3FFFFFu;
        break;
    default:
        break;
    }
    update_irq(m);
}

void adc_reset(machine_t *m) {
    for (int n = 0; n < 3; n++) {
        adc_t *a = &m->adcs.adc[n];
        int stuck_code = a->stuck_code;
        bool hung = a->hung;
        memset(a, 0, sizeof *a);
        a->htr = 0xFFF;
        a->stuck_code = stuck_code;
        a->hung = hung;
        schedule(m, EVENT_ADC + n, NEVER);
    }
    m->adcs.ccr = 0;
    update_irq(m);
}

void machine_set_analog(machine_t *m, int channel, double code, double noise_codes) {
    m->adcs.code[channel] = code;
    m->adcs.noise[channel] = noise_codes;
}

void machine_stick_adc(machine_t *m, int adc, int code) {
    m->adcs.adc[adc - 1].stuck_code = code;
}

void machine_hang_adc(machine_t *m, int adc, bool hung) {
    m->adcs.adc[adc - 1].hung = hung;
    if (hung) {
        schedule(m, EVENT_ADC + adc - 1, NEVER);
    } else if (m->adcs.adc[adc - 1].injected_runs || m->adcs.adc[adc - 1].regular_runs) {
        schedule(m, EVENT_ADC + adc - 1, m->now + TICKS_PER_US);
    }
}
