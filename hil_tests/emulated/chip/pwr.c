/* pwr.c: supply supervision (RM0090 chapter 5): voltage detector, brown-out reset, backup SRAM.
 *
 * Thresholds are the datasheet's typical falling ones, without hysteresis.
 */
#include "chip.h"

enum { CR_PVDE = 1u << 4, CSR_PVDO = 1u << 2, PVD_EXTI_LINE = 16 };

static uint32_t pvd_threshold_mv(const machine_t *m) {
    static const uint16_t mv[8] = {2000, 2100, 2300, 2500, 2600, 2700, 2800, 2900};
    return mv[m->pwr.cr >> 5 & 7u];
}

/* BOR_LEV in the option bytes: 0 is level 3, 3 is off (power-down reset only). */
static uint32_t brown_out_mv(const machine_t *m) {
    static const uint16_t mv[4] = {2830, 2500, 2190, 1680};
    return mv[m->flash.optcr >> 2 & 3u];
}

static void update_detector(machine_t *m) {
    bool low = (m->pwr.cr & CR_PVDE) && m->pwr.supply_mv < pvd_threshold_mv(m);
    bool was_low = (m->pwr.csr & CSR_PVDO) != 0;
    m->pwr.csr = low ? m->pwr.csr | CSR_PVDO : m->pwr.csr & ~(uint32_t)CSR_PVDO;
    if (low != was_low) {
        exti_edge(m, PVD_EXTI_LINE, low); /* its rising edge: the supply fell below */
    }
}

void pwr_supply_changed(machine_t *m) {
    bool too_low = m->pwr.supply_mv < brown_out_mv(m);
    if (too_low && !m->pwr.held) {
        request_reset(m, RESET_BROWN_OUT);
    }
    m->pwr.held = too_low;
    update_detector(m);
}

uint32_t pwr_read(machine_t *m, uint32_t offset) {
    switch (offset) {
    case 0x00:
        return m->pwr.cr;
    case 0x04:
        return m->pwr.csr | (m->pwr.csr & 1u << 9 ? 1u << 3 : 0u) | 1u << 14; /* ready */
    default:
        return 0;
    }
}

void pwr_write(machine_t *m, uint32_t offset, uint32_t value) {
    if (offset == 0x00) {
        m->pwr.cr = value & 0x43F3u; /* CWUF and CSBF read 0 */
        update_detector(m);
    } else if (offset == 0x04) {
        m->pwr.csr = (m->pwr.csr & CSR_PVDO) | (value & 0x300u);
    }
}

void pwr_reset(machine_t *m) {
    m->pwr.cr = 0x4000u; /* VOS: scale 1, which 168 MHz needs */
    m->pwr.csr = 0;
}
