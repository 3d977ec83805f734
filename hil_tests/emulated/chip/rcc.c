/* rcc.c: reset and clock control (RM0090 chapter 7).
 *
 * Oscillators become ready after the datasheet's typical times. The frequencies of the buses
 * follow from the registers, so a wrong PLL factor makes the emulated program slow or fast just
 * as it would a real one. Limits that are exceeded are noted.
 */
#include "chip.h"

#include <string.h>

enum { HSI_HZ = 16000000 };
enum { APB1 = 3, APB2 = 4 }; /* index of enable[] and reset[] */
#define HSI_START (TICKS_PER_US * 3)
#define HSE_START (TICKS_PER_US * 2000)
#define PLL_LOCK (TICKS_PER_US * 200)
#define LSI_START (TICKS_PER_US * 15)

enum { CR_HSION = 1u << 0, CR_HSEON = 1u << 16, CR_CSSON = 1u << 19, CR_PLLON = 1u << 24 };
enum { CIR_CSSF = 1u << 7 };
#define PLLSRC_HSE (1u << 22)

static bool hsi_ready(const machine_t *m) {
    return (m->rcc.cr & CR_HSION) && m->now >= m->rcc.hsi_ready_at;
}

static bool hse_ready(const machine_t *m) {
    return (m->rcc.cr & CR_HSEON) && m->rcc.hse_works && m->now >= m->rcc.hse_ready_at;
}

static bool pll_source_ready(const machine_t *m) {
    return m->rcc.pllcfgr & PLLSRC_HSE ? hse_ready(m) : hsi_ready(m);
}

static bool pll_ready(const machine_t *m) {
    return (m->rcc.cr & CR_PLLON) && pll_source_ready(m) && m->now >= m->rcc.pll_ready_at;
}

static uint64_t pll_hz(machine_t *m) {
    uint32_t config = m->rcc.pllcfgr;
    uint64_t input = config & PLLSRC_HSE ? m->options.hse_hz : HSI_HZ;
    uint32_t divider = config & 0x3Fu;
    uint64_t multiplier = config >> 6 & 0x1FFu;
    if (divider < 2 || input / divider < 950000 || input / divider > 2100000) {
        note(m, "RCC: PLL input of %llu / %u Hz is outside 1..2 MHz", (unsigned long long)input,
             divider);
        divider = divider < 2 ? 2 : divider;
    }
    uint64_t vco = input * multiplier / divider;
    if (vco < 100000000 || vco > 432000000) {
        note(m, "RCC: VCO at %llu Hz is outside 100..432 MHz", (unsigned long long)vco);
    }
    return vco / (2 * ((config >> 16 & 3u) + 1));
}

static uint32_t divided(uint32_t hz, uint32_t field, uint32_t first) {
    static const uint8_t shift_ahb[8] = {1, 2, 3, 4, 6, 7, 8, 9};
    if (field < first) {
        return hz;
    }
    return first == 8 ? hz >> shift_ahb[field - 8] : hz >> (field - 3);
}

static void set_frequencies(machine_t *m, uint32_t sysclk) {
    rcc_t *r = &m->rcc;
    uint32_t ppre1 = r->cfgr >> 10 & 7u;
    uint32_t ppre2 = r->cfgr >> 13 & 7u;
    uint32_t hclk = divided(sysclk, r->cfgr >> 4 & 15u, 8);
    uint32_t pclk1 = divided(hclk, ppre1, 4);
    uint32_t pclk2 = divided(hclk, ppre2, 4);
    if (hclk == r->hclk_hz && pclk1 == r->pclk1_hz && pclk2 == r->pclk2_hz) {
        return;
    }
    if (hclk > 168000000 || pclk1 > 42000000 || pclk2 > 84000000) {
        note(m, "RCC: HCLK %u, PCLK1 %u, PCLK2 %u Hz exceed 168, 42, 84 MHz", hclk, pclk1, pclk2);
    }
    bool running = r->hclk_hz != 0;
    if (running && hclk > r->hclk_hz) {
        flash_check_read_back(m);
    }
    if (running) {
        tim_clock_changed(m, true);
        systick_clock_changed(m, true);
    }
    r->hclk_hz = hclk;
    r->pclk1_hz = pclk1;
    r->pclk2_hz = pclk2;
    r->tim1_hz = ppre2 < 4 ? pclk2 : 2 * pclk2;
    r->tim2_hz = ppre1 < 4 ? pclk1 : 2 * pclk1;
    m->cpu.ticks_per_instruction =
        TICKS_PER_SECOND / hclk * m->options.cycles_per_instruction_x1000 / 1000;
    if (running) {
        tim_clock_changed(m, false);
        systick_clock_changed(m, false);
        flash_check_latency(m);
    }
}

/* Performs the switch that SW asks for when its source is ready, and follows the factors. */
static void update(machine_t *m) {
    rcc_t *r = &m->rcc;
    uint32_t wanted = r->cfgr & 3u;
    bool ready = wanted == 0 ? hsi_ready(m) : wanted == 1 ? hse_ready(m) : pll_ready(m);
    if (wanted == 3) {
        note(m, "RCC: SW = 3 is not allowed");
    } else if (ready) {
        r->cfgr = (r->cfgr & ~0xCu) | wanted << 2;
    }
    uint32_t used = r->cfgr >> 2 & 3u;
    uint32_t sysclk = used == 0 ? HSI_HZ : used == 1 ? m->options.hse_hz : (uint32_t)pll_hz(m);
    set_frequencies(m, sysclk);
    tick_t next = NEVER;
    const tick_t ready_at[3] = {r->hsi_ready_at, r->hse_ready_at, r->pll_ready_at};
    for (int i = 0; i < 3; i++) {
        if (ready_at[i] > m->now && ready_at[i] < next) {
            next = ready_at[i];
        }
    }
    schedule(m, EVENT_RCC, next);
}

void rcc_event(machine_t *m, tick_t at) {
    (void)at;
    update(m);
}

/* The crystal stopped or came back. With CSS on a failure is caught (RM0090 7.2.7); without, a
 * core that runs on it stands still. */
void rcc_hse_changed(machine_t *m) {
    rcc_t *r = &m->rcc;
    if (r->hse_works) {
        r->hse_ready_at = m->now + HSE_START;
        update(m);
        return;
    }
    uint32_t used = r->cfgr >> 2 & 3u;
    bool depends = used == 1 || (used == 2 && (r->pllcfgr & PLLSRC_HSE));
    if ((r->cr & CR_CSSON) && (r->cr & CR_HSEON)) {
        r->cr &= ~(uint32_t)CR_HSEON;
        if (depends) {
            r->cr &= used == 2 ? ~(uint32_t)CR_PLLON : ~0u;
            r->cr |= CR_HSION;
            r->cfgr &= ~0xFu;
        }
        r->cir |= CIR_CSSF;
        m->nvic.line[0] |= 1u << NMI;
        exception_pend(m, NMI);
        update(m);
        pwm_clock_failed(m);
    } else if (depends) {
        note(m, "RCC: the crystal stopped under the core without the clock security system");
        m->nvic.locked_up = true;
    }
}

/* The clock comes two cycles after the write (ES0182, delay after an RCC peripheral clock
 * enabling): not for accesses of the same block of instructions, unless the register was read back.
 */
bool rcc_is_fresh(const machine_t *m, int bus, int bit) {
    return m->rcc.fresh_at == m->now && (m->rcc.fresh[bus] >> bit & 1u);
}

static void enable(machine_t *m, int bus, uint32_t value) {
    rcc_t *r = &m->rcc;
    if (r->fresh_at != m->now) {
        memset(r->fresh, 0, sizeof r->fresh);
        r->fresh_at = m->now;
    }
    r->fresh[bus] |= value & ~r->enable[bus];
    r->enable[bus] = value;
}

static uint32_t read_enabled(machine_t *m, int bus) {
    m->rcc.fresh[bus] = m->peeking ? m->rcc.fresh[bus] : 0;
    return m->rcc.enable[bus];
}

void rcc_start_lsi(machine_t *m) {
    if (!(m->rcc.csr & 1u)) {
        m->rcc.csr |= 1u;
        m->rcc.lsi_ready_at = m->now + LSI_START;
    }
}

uint32_t rcc_read(machine_t *m, uint32_t offset) {
    const rcc_t *r = &m->rcc;
    uint32_t ready = (hsi_ready(m) ? 1u << 1 : 0u) | (hse_ready(m) ? 1u << 17 : 0u) |
                     (pll_ready(m) ? 1u << 25 : 0u);
    switch (offset) {
    case 0x00:
        return r->cr | ready;
    case 0x04:
        return r->pllcfgr;
    case 0x08:
        return r->cfgr;
    case 0x0C:
        return r->cir;
    case 0x10:
        return r->reset[0];
    case 0x14:
        return r->reset[1];
    case 0x18:
        return r->reset[2];
    case 0x20:
        return r->reset[3];
    case 0x24:
        return r->reset[4];
    case 0x30:
        return read_enabled(m, 0);
    case 0x34:
        return read_enabled(m, 1);
    case 0x38:
        return read_enabled(m, 2);
    case 0x40:
        return read_enabled(m, 3);
    case 0x44:
        return read_enabled(m, 4);
    case 0x50:
        return r->low_power[0];
    case 0x60:
        return r->low_power[3];
    case 0x64:
        return r->low_power[4];
    case 0x70:
        return r->bdcr;
    case 0x74:
        return r->csr | ((r->csr & 1u) && m->now >= r->lsi_ready_at ? 2u : 0u);
    default:
        return 0;
    }
}

static void write_cr(machine_t *m, uint32_t value) {
    rcc_t *r = &m->rcc;
    uint32_t used = r->cfgr >> 2 & 3u;
    bool hse_used = used == 1 || (used == 2 && (r->pllcfgr & PLLSRC_HSE));
    uint32_t held = (used == 0 ? CR_HSION : 0u) | (hse_used ? CR_HSEON : 0u) |
                    (used == 2 ? CR_PLLON : 0u); /* what runs the core cannot be switched off */
    uint32_t old = r->cr;
    r->cr = (value & 0x050D00F9u) | (old & held) | (old & 0xFF00u);
    uint32_t risen = r->cr & ~old;
    r->hsi_ready_at = risen & CR_HSION ? m->now + HSI_START : r->hsi_ready_at;
    r->hse_ready_at = risen & CR_HSEON ? m->now + HSE_START : r->hse_ready_at;
    if (risen & CR_PLLON) {
        tick_t source = r->pllcfgr & PLLSRC_HSE ? r->hse_ready_at : r->hsi_ready_at;
        r->pll_ready_at = (source > m->now ? source : m->now) + PLL_LOCK;
        pll_hz(m); /* notes what is out of range */
    }
    if (value & 1u << 26) {
        unmodelled(m, "RCC: the I2S PLL is not modelled");
    }
}

static void reset_peripherals(machine_t *m, int bus, uint32_t bits) {
    static const uint8_t apb1_timers = 6; /* TIM2 .. TIM7 in bits 0 .. 5 */
    for (uint32_t i = 0; bus == APB1 && i < apb1_timers; i++) {
        if (bits >> i & 1u) {
            tim_reset(m, (int)i + 2);
        }
    }
    if (bus == APB1 && (bits & 1u << 25)) {
        can_bus_drop_node(m);
        bxcan_reset(m);
    }
    if (bus == APB2 && (bits & 1u << 0)) {
        tim_reset(m, 1);
    }
    if (bus == APB2 && (bits & 1u << 1)) {
        tim_reset(m, 8);
    }
    if (bus == APB2 && (bits & 1u << 8)) {
        adc_reset(m);
    }
}

void rcc_write(machine_t *m, uint32_t offset, uint32_t value) {
    rcc_t *r = &m->rcc;
    if (offset >= 0x10 && offset <= 0x24) {
        int bus = (int)(offset < 0x20 ? (offset - 0x10) / 4 : (offset - 0x20) / 4 + 3);
        if (bus < 5) {
            reset_peripherals(m, bus, value & ~r->reset[bus]);
            r->reset[bus] = value;
        }
        return;
    }
    switch (offset) {
    case 0x00:
        write_cr(m, value);
        break;
    case 0x04:
        if (r->cr & CR_PLLON) {
            note(m, "RCC: PLLCFGR written while the PLL is on");
        } else {
            r->pllcfgr = value & 0x0F437FFFu;
        }
        break;
    case 0x08:
        r->cfgr = (value & 0xFFFFFCF3u & ~0xCu) | (r->cfgr & 0xCu);
        break;
    case 0x0C:
        r->cir = (r->cir & 0x80u) | (value & 0x3F00u);
        if (value & 1u << 23) { /* CSSC */
            r->cir &= ~(uint32_t)CIR_CSSF;
            m->nvic.line[0] &= ~(1ull << NMI);
        }
        break;
    case 0x30:
        enable(m, 0, value);
        break;
    case 0x34:
        enable(m, 1, value);
        break;
    case 0x38:
        enable(m, 2, value);
        break;
    case 0x40:
        enable(m, 3, value);
        break;
    case 0x44:
        enable(m, 4, value);
        break;
    case 0x50:
        r->low_power[0] = value;
        break;
    case 0x60:
        r->low_power[3] = value;
        break;
    case 0x64:
        r->low_power[4] = value;
        break;
    case 0x70:
        r->bdcr = m->pwr.cr & 1u << 8 ? value : r->bdcr;
        break;
    case 0x74:
        if (value & 1u) {
            rcc_start_lsi(m);
        } else if (!m->iwdg.running) {
            r->csr &= ~1u;
        }
        r->csr &= value & 1u << 24 ? 0x00FFFFFFu : ~0u; /* RMVF */
        break;
    default:
        break;
    }
    update(m);
}

void rcc_reset(machine_t *m, uint32_t cause) {
    rcc_t *r = &m->rcc;
    bool works = r->hse_works;
    uint32_t flags = r->csr & 0xFE000000u;
    uint32_t bdcr = cause & RESET_POWER ? 0 : r->bdcr;
    memset(r, 0, sizeof *r);
    r->hse_works = works;
    r->cr = 0x00000081u; /* HSION, HSITRIM 16; HSIRDY is computed */
    r->pllcfgr = 0x24003010u;
    r->enable[0] = 0x00100000u;
    r->low_power[0] = 0x7E6791FFu;
    r->low_power[3] = 0x36FEC9FFu;
    r->low_power[4] = 0x00075F33u;
    r->bdcr = bdcr;
    /* Every internal reset also pulls NRST, so PINRSTF is set with it (RM0090 7.1.1). */
    r->csr = cause & RESET_POWER ? 0x0E000000u : flags | cause | RESET_PIN;
    update(m);
}
