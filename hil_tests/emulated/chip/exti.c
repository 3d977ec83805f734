/* exti.c: external interrupts (RM0090 chapter 12) and the pin multiplexer of SYSCFG (chapter 9). */
#include "chip.h"

#include <string.h>

static void update_irqs(machine_t *m) {
    uint32_t active = m->exti.pr & m->exti.imr;
    for (int line = 0; line < 5; line++) {
        irq_level(m, 6 + line, active >> line & 1u);
    }
    irq_level(m, 23, (active & 0x03E0u) != 0); /* lines 5 .. 9 */
    irq_level(m, 40, (active & 0xFC00u) != 0); /* lines 10 .. 15 */
    irq_level(m, 1, active >> 16 & 1u);        /* PVD */
}

void exti_edge(machine_t *m, int line, bool rising) {
    uint32_t selected = rising ? m->exti.rtsr : m->exti.ftsr;
    if (selected >> line & 1u) {
        m->exti.pr |= 1u << line;
        update_irqs(m);
    }
}

void exti_pin_edge(machine_t *m, int port, int pin, bool rising) {
    if ((m->exti.exticr[pin / 4] >> (4 * (pin % 4)) & 15u) == (uint32_t)port) {
        exti_edge(m, pin, rising);
    }
}

uint32_t exti_read(machine_t *m, uint32_t offset) {
    switch (offset) {
    case 0x00:
        return m->exti.imr;
    case 0x04:
        return m->exti.emr;
    case 0x08:
        return m->exti.rtsr;
    case 0x0C:
        return m->exti.ftsr;
    case 0x14:
        return m->exti.pr;
    default:
        return 0;
    }
}

void exti_write(machine_t *m, uint32_t offset, uint32_t value) {
    value &= 0x7FFFFFu;
    switch (offset) {
    case 0x00:
        m->exti.imr = value;
        break;
    case 0x04:
        m->exti.emr = value;
        break;
    case 0x08:
        m->exti.rtsr = value;
        break;
    case 0x0C:
        m->exti.ftsr = value;
        break;
    case 0x10:
        m->exti.pr |= value;
        break; /* SWIER */
    case 0x14:
        m->exti.pr &= ~value;
        break;
    default:
        break;
    }
    update_irqs(m);
}

uint32_t syscfg_read(machine_t *m, uint32_t offset) {
    return offset >= 0x08 && offset <= 0x14 ? m->exti.exticr[(offset - 8) / 4] : 0;
}

void syscfg_write(machine_t *m, uint32_t offset, uint32_t value) {
    if (offset >= 0x08 && offset <= 0x14) {
        m->exti.exticr[(offset - 8) / 4] = value & 0xFFFFu;
    } else if (offset == 0 && (value & 3u) != 0) {
        unmodelled(m, "SYSCFG: remapping memory at 0 is not modelled");
    }
}

void exti_reset(machine_t *m) {
    memset(&m->exti, 0, sizeof m->exti);
}
