/* gpio.c: ports A to I (RM0090 chapter 8) and the wires on their pins.
 *
 * A pin shows what drives it: its output register, else the outside, else its pull resistor. The
 * peripherals ask gpio_is_alternate(): a signal passes only a pin that is configured for it.
 */
#include "chip.h"

#include <string.h>

enum { INPUT, OUTPUT, ALTERNATE, ANALOG };

static unsigned mode(const machine_t *m, int port, int pin) {
    return m->gpio[port].moder >> (2 * pin) & 3u;
}

bool gpio_is_alternate(const machine_t *m, int port, int pin, unsigned function) {
    unsigned selected = m->gpio[port].afr[pin / 8] >> (4 * (pin % 8)) & 15u;
    return mode(m, port, pin) == ALTERNATE && selected == function;
}

bool gpio_is_analog(const machine_t *m, int port, int pin) {
    return mode(m, port, pin) == ANALOG;
}

int gpio_level(const machine_t *m, int port, int pin) {
    const gpio_t *g = &m->gpio[port];
    unsigned pull = g->pupdr >> (2 * pin) & 3u;
    bool high = g->odr >> pin & 1u;
    bool open_drain = g->otyper >> pin & 1u;
    if (mode(m, port, pin) == ANALOG) {
        return 0; /* the input buffer is off */
    }
    if (mode(m, port, pin) == OUTPUT && !(open_drain && high)) {
        return high;
    }
    if (g->driven[pin] >= 0) {
        return g->driven[pin];
    }
    return pull == 1;
}

static uint32_t levels(const machine_t *m, int port) {
    uint32_t value = 0;
    for (int pin = 0; pin < 16; pin++) {
        value |= gpio_level(m, port, pin) ? 1u << pin : 0u;
    }
    return value;
}

/* What hangs on the levels: external interrupts and the break input of TIM1. */
static void levels_changed(machine_t *m, int port, uint32_t before) {
    uint32_t changed = before ^ levels(m, port);
    for (int pin = 0; changed != 0; pin++, changed >>= 1) {
        if (changed & 1u) {
            exti_pin_edge(m, port, pin, !(before >> pin & 1u));
        }
    }
    pwm_break_changed(m);
}

void gpio_drive(machine_t *m, int port, int pin, int level) {
    if (m->gpio[port].driven[pin] != level) {
        uint32_t before = levels(m, port);
        m->gpio[port].driven[pin] = (int8_t)level;
        levels_changed(m, port, before);
    }
}

uint32_t gpio_read(machine_t *m, int port, uint32_t offset) {
    const gpio_t *g = &m->gpio[port];
    switch (offset) {
    case 0x00:
        return g->moder;
    case 0x04:
        return g->otyper;
    case 0x08:
        return g->ospeedr;
    case 0x0C:
        return g->pupdr;
    case 0x10:
        return levels(m, port);
    case 0x14:
        return g->odr;
    case 0x1C:
        return g->lckr;
    case 0x20:
        return g->afr[0];
    case 0x24:
        return g->afr[1];
    default:
        return 0;
    }
}

void gpio_write(machine_t *m, int port, uint32_t offset, uint32_t value) {
    gpio_t *g = &m->gpio[port];
    uint32_t before = levels(m, port);
    bridge_advance(m, m->now); /* a pin may cut the bridge off */
    switch (offset) {
    case 0x00:
        g->moder = value;
        break;
    case 0x04:
        g->otyper = value & 0xFFFFu;
        break;
    case 0x08:
        g->ospeedr = value;
        break;
    case 0x0C:
        g->pupdr = value;
        break;
    case 0x14:
        g->odr = value & 0xFFFFu;
        break;
    case 0x18:
        g->odr = (g->odr & ~(value >> 16)) | (value & 0xFFFFu);
        break; /* set wins */
    case 0x1C:
        unmodelled(m, "GPIO: the configuration lock is not modelled");
        break;
    case 0x20:
        g->afr[0] = value;
        break;
    case 0x24:
        g->afr[1] = value;
        break;
    default:
        break;
    }
    bridge_check_enabled(m);
    levels_changed(m, port, before);
}

void gpio_reset(machine_t *m) {
    for (int port = 0; port < PORTS; port++) {
        gpio_t *g = &m->gpio[port];
        int8_t driven[16];
        memcpy(driven, g->driven, sizeof driven);
        memset(g, 0, sizeof *g);
        memcpy(g->driven, driven, sizeof driven);
    }
    m->gpio[0].moder = 0xA8000000u; /* the debug port's pins */
    m->gpio[0].pupdr = 0x64000000u;
    m->gpio[1].moder = 0x00000280u;
    m->gpio[1].ospeedr = 0x000000C0u;
    m->gpio[1].pupdr = 0x00000100u;
}

void machine_set_pin(machine_t *m, int port, int pin, int level) {
    gpio_drive(m, port, pin, level);
}

int machine_pin(const machine_t *m, int port, int pin) {
    return gpio_level(m, port, pin);
}
