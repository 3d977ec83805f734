/* pwm.c: output stage of TIM1: duty of the channels, dead time, main output enable, break.
 *
 * RM0090 17.3.9 to 17.3.12 and 17.4.18. Legs of the H-bridge: channel 1 (PA8 and PB13 or PA7),
 * channel 2 (PA9 and PB14 or PB0), gate drivers active high. Break input: PB12 or PA6.
 */
#include "chip.h"

enum { MOE = 1u << 15, AOE = 1u << 14, BKP = 1u << 13, BKE = 1u << 12, BIF = 1u << 7 };
enum { PORT_A, PORT_B, AF_TIM1 = 1 };

bool pwm_break_active(const machine_t *m) {
    uint32_t bdtr = m->tim[1].bdtr;
    int level = 0; /* an input that no pin feeds is low */
    if (!(bdtr & BKE)) {
        return false;
    }
    if (gpio_is_alternate(m, PORT_B, 12, AF_TIM1)) {
        level = gpio_level(m, PORT_B, 12);
    } else if (gpio_is_alternate(m, PORT_A, 6, AF_TIM1)) {
        level = gpio_level(m, PORT_A, 6);
    }
    return (level != 0) == ((bdtr & BKP) != 0);
}

static void open_outputs(machine_t *m) {
    bridge_advance(m, m->now);
    m->tim[1].bdtr &= ~(uint32_t)MOE;
    m->tim[1].sr |= BIF;
    bridge_check_enabled(m);
    tim_update_irq(m, 1);
}

/* Asynchronous: needs no clock, so it acts at once, whatever the core does. */
void pwm_break_changed(machine_t *m) {
    if (pwm_break_active(m)) {
        open_outputs(m);
    }
}

void pwm_clock_failed(machine_t *m) {
    if (m->tim[1].bdtr & BKE) {
        open_outputs(m);
    }
}

void pwm_software_break(machine_t *m) {
    open_outputs(m);
}

void pwm_write_bdtr(machine_t *m, int n, uint32_t value) {
    tim_t *t = &m->tim[n];
    uint32_t frozen = 0;
    frozen |= t->locked >= 1 ? 0x70FFu : 0u; /* AOE, BKP, BKE, DTG */
    frozen |= t->locked >= 2 ? 0x0C00u : 0u; /* OSSR, OSSI */
    frozen |= t->locked >= 1 ? 0x0300u : 0u; /* LOCK itself: once after reset */
    t->bdtr = (t->bdtr & frozen) | (value & 0xFFFFu & ~frozen);
    t->locked = t->bdtr >> 8 & 3u;
    if (n == 1 && pwm_break_active(m)) { /* MOE cannot be set while the input is active */
        open_outputs(m);
    }
}

void pwm_write_ccer(machine_t *m, int n, uint32_t value) {
    tim_t *t = &m->tim[n];
    uint32_t frozen = t->locked >= 2 ? 0xAAAAu & 0x3FFFu : 0u; /* CCxP, CCxNP */
    t->ccer = (t->ccer & frozen) | (value & 0xFFFFu & ~frozen);
}

/* Fraction of the period for which OCxREF, after polarity, is high. Channels 1 to 4. */
double pwm_duty(const machine_t *m, int channel) {
    const tim_t *t = &m->tim[1];
    int index = channel - 1;
    uint32_t mode = t->ccmr[index / 2] >> (4 + 8 * (index % 2)) & 7u;
    bool centred = (t->cr1 & 0x60u) != 0;
    double period = centred ? (double)t->arr_now : (double)t->arr_now + 1;
    double high = (double)t->ccr_now[index];
    double duty = 0;
    if (mode == 6 || mode == 7) {
        duty = period <= 0 ? 0 : high >= period ? 1 : high / period;
        duty = mode == 6 ? duty : 1 - duty;
    } else if (mode == 5) {
        duty = 1; /* forced active */
    }
    bool inverted = t->ccer >> (1 + 4 * index) & 1u;
    return inverted ? 1 - duty : duty;
}

static bool pins_connected(const machine_t *m, int channel) {
    if (channel == 1) {
        return gpio_is_alternate(m, PORT_A, 8, AF_TIM1) &&
               (gpio_is_alternate(m, PORT_B, 13, AF_TIM1) ||
                gpio_is_alternate(m, PORT_A, 7, AF_TIM1));
    }
    return gpio_is_alternate(m, PORT_A, 9, AF_TIM1) &&
           (gpio_is_alternate(m, PORT_B, 14, AF_TIM1) || gpio_is_alternate(m, PORT_B, 0, AF_TIM1));
}

/* Both switches of the leg are worked by the timer; otherwise both are open (gate pull-downs). */
bool pwm_leg_switched(const machine_t *m, int channel) {
    const tim_t *t = &m->tim[1];
    uint32_t enables = t->ccer >> (4 * (channel - 1)) & 0x5u; /* CCxE and CCxNE */
    if (t->frozen && !m->options.frozen_timer_drives) {
        return false;
    }
    return (t->bdtr & MOE) && (t->cr1 & 1u) && enables == 0x5u && pins_connected(m, channel);
}

double pwm_dead_time_s(const machine_t *m) {
    uint32_t dtg = m->tim[1].bdtr & 0xFFu;
    uint32_t steps = dtg < 0x80   ? dtg
                     : dtg < 0xC0 ? (64 + (dtg & 0x3Fu)) * 2
                     : dtg < 0xE0 ? (32 + (dtg & 0x1Fu)) * 8
                                  : (32 + (dtg & 0x1Fu)) * 16;
    uint32_t ckd = m->tim[1].cr1 >> 8 & 3u;
    return (double)(steps << ckd) / (double)tim_clock_hz(m, 1);
}

double pwm_frequency_hz(const machine_t *m) {
    const tim_t *t = &m->tim[1];
    double counts = (t->cr1 & 0x60u) ? 2.0 * t->arr_now : (double)t->arr_now + 1;
    return (t->cr1 & 1u) && counts > 0
               ? (double)TICKS_PER_SECOND / (double)tim_ticks_per_count(m, 1) / counts
               : 0;
}
