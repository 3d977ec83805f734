/* scs.c: the registers of the system control space, 0xE000E000: NVIC and SCB (PM0214 4.3, 4.4). */
#include "core.h"

#include <string.h>

void nvic_reset(machine_t *m) {
    memset(&m->nvic, 0, sizeof m->nvic);
    m->nvic.enabled[0] = 0xFFFF; /* exceptions of the core are always enabled here */
    m->nvic.group_mask = 0xF0;
    m->nvic.ccr = 0x200;
}

/* A 32-bit window of interrupts onto the exception bitmaps, which begin 16 lower. */
static uint32_t window(const uint64_t bits[2], uint32_t word) {
    uint32_t result = 0;
    for (uint32_t i = 0; i < 32; i++) {
        uint32_t exception = 16 + 32 * word + i;
        if (exception < EXCEPTIONS && (bits[exception >> 6] >> (exception & 63) & 1u)) {
            result |= 1u << i;
        }
    }
    return result;
}

static void change_window(uint64_t bits[2], uint32_t word, uint32_t value, bool set) {
    for (uint32_t i = 0; i < 32; i++) {
        uint32_t exception = 16 + 32 * word + i;
        if (exception < EXCEPTIONS && (value >> i & 1u)) {
            uint64_t bit = 1ull << (exception & 63);
            uint64_t *into = &bits[exception >> 6];
            *into = set ? *into | bit : *into & ~bit;
        }
    }
}

static uint32_t active_window(const machine_t *m, uint32_t word) {
    uint64_t bits[2] = {0, 0};
    for (int i = 0; i < m->nvic.depth; i++) {
        bits[m->nvic.active[i] >> 6] |= 1ull << (m->nvic.active[i] & 63);
    }
    return window(bits, word);
}

static bool is_active(const machine_t *m, int exception) {
    return memchr(m->nvic.active, exception, (size_t)m->nvic.depth) != NULL;
}

static uint32_t priorities(const machine_t *m, uint32_t first) {
    uint32_t value = 0;
    for (uint32_t i = 0; i < 4 && first + i < EXCEPTIONS; i++) {
        value |= (uint32_t)m->nvic.priority[first + i] << (8 * i);
    }
    return value;
}

static void set_priorities(machine_t *m, uint32_t first, uint32_t value, unsigned size) {
    for (uint32_t i = 0; i < size; i++) {
        if (first + i < EXCEPTIONS && first + i > HARD_FAULT) {
            m->nvic.priority[first + i] = (uint8_t)(value >> (8 * i)) & 0xF0u; /* four bits */
        }
    }
}

static uint32_t read_icsr(const machine_t *m) {
    const nvic_t *n = &m->nvic;
    uint32_t active = n->depth > 0 ? n->active[n->depth - 1] : 0;
    uint64_t low = n->pending[0] & n->enabled[0];
    uint64_t high = n->pending[1] & n->enabled[1];
    uint32_t pending = low != 0    ? (uint32_t)__builtin_ctzll(low)
                       : high != 0 ? 64u + (uint32_t)__builtin_ctzll(high)
                                   : 0;
    bool irq = (low >> 16) != 0 || high != 0;
    return active | (n->depth <= 1 ? 1u << 11 : 0u) | pending << 12 | (irq ? 1u << 22 : 0u) |
           (uint32_t)(n->pending[0] >> SYSTICK & 1u) << 26 |
           (uint32_t)(n->pending[0] >> PENDSV & 1u) << 28 |
           (uint32_t)(n->pending[0] >> NMI & 1u) << 31;
}

static uint32_t read_shcsr(const machine_t *m) {
    return m->nvic.shcsr | (is_active(m, MEM_MANAGE) ? 1u << 0 : 0u) |
           (is_active(m, BUS_FAULT) ? 1u << 1 : 0u) | (is_active(m, USAGE_FAULT) ? 1u << 3 : 0u) |
           (is_active(m, SVCALL) ? 1u << 7 : 0u) | (is_active(m, PENDSV) ? 1u << 10 : 0u) |
           (is_active(m, SYSTICK) ? 1u << 11 : 0u);
}

static uint32_t read_scb(machine_t *m, uint32_t offset) {
    const nvic_t *n = &m->nvic;
    switch (offset) {
    case 0xD00:
        return 0x410FC241u; /* CPUID: Cortex-M4 r0p1 */
    case 0xD04:
        return read_icsr(m);
    case 0xD08:
        return n->vtor;
    case 0xD0C:
        return 0xFA050000u | n->aircr_prigroup << 8;
    case 0xD10:
        return n->scr;
    case 0xD14:
        return n->ccr;
    case 0xD18:
    case 0xD1C:
    case 0xD20:
        return priorities(m, offset - 0xD18 + 4);
    case 0xD24:
        return read_shcsr(m);
    case 0xD28:
        return n->cfsr;
    case 0xD2C:
        return n->hfsr;
    case 0xD34:
        return n->mmfar;
    case 0xD38:
        return n->bfar;
    case 0xD88:
        return n->cpacr;
    case 0xDFC:
        return n->demcr;
    default:
        return 0;
    }
}

uint32_t scs_read(machine_t *m, uint32_t offset) {
    if (offset >= 0x10 && offset < 0x20) {
        return systick_read(m, offset);
    }
    if (offset >= 0xD90 && offset < 0xDC0) {
        return mpu_read(m, offset);
    }
    if (offset >= 0x100 && offset < 0x400) {
        uint32_t word = (offset & 0x7Fu) / 4;
        switch (offset >> 7) {
        case 2:
        case 3:
            return window(m->nvic.enabled, word);
        case 4:
        case 5:
            return window(m->nvic.pending, word);
        case 6:
            return active_window(m, word);
        default:
            return 0;
        }
    }
    if (offset >= 0x400 && offset < 0x4F0) {
        return priorities(m, offset - 0x400 + 16);
    }
    return read_scb(m, offset);
}

static void write_icsr(machine_t *m, uint32_t value) {
    uint64_t *pending = &m->nvic.pending[0];
    *pending &= value & 1u << 25 ? ~(1ull << SYSTICK) : ~0ull;
    *pending &= value & 1u << 27 ? ~(1ull << PENDSV) : ~0ull;
    *pending |= value & 1u << 26 ? 1ull << SYSTICK : 0;
    *pending |= value & 1u << 28 ? 1ull << PENDSV : 0;
    *pending |= value & 1u << 31 ? 1ull << NMI : 0;
}

static void write_aircr(machine_t *m, uint32_t value) {
    if (value >> 16 != 0x05FA) {
        note(m, "AIRCR: write without the key is ignored");
        return;
    }
    m->nvic.aircr_prigroup = value >> 8 & 7u;
    m->nvic.group_mask = (uint8_t)(0xFFu << (m->nvic.aircr_prigroup + 1));
    if (value & 1u << 2) { /* SYSRESETREQ */
        request_reset(m, RESET_SOFTWARE);
    }
}

static void write_scb(machine_t *m, uint32_t offset, uint32_t value) {
    nvic_t *n = &m->nvic;
    switch (offset) {
    case 0xD04:
        write_icsr(m, value);
        break;
    case 0xD08:
        n->vtor = value & 0x3FFFFE00u;
        break; /* 98 vectors: aligned to 512 bytes */
    case 0xD0C:
        write_aircr(m, value);
        break;
    case 0xD10:
        n->scr = value & 0x16u;
        break;
    case 0xD14:
        n->ccr = value & 0x31Bu;
        if (value & 0x18u) {
            unmodelled(m, "CCR: traps on division by zero and unaligned access are not modelled");
        }
        break;
    case 0xD24:
        n->shcsr = value & 0x70000u;
        break;
    case 0xD28:
        n->cfsr &= ~value;
        break;
    case 0xD2C:
        n->hfsr &= ~value;
        break;
    case 0xD34:
        n->mmfar = value;
        break;
    case 0xD38:
        n->bfar = value;
        break;
    case 0xD88:
        n->cpacr = value & 0x00F00000u;
        break;
    case 0xDFC:
        n->demcr = value;
        break;
    default:
        break;
    }
}

static void write_nvic(machine_t *m, uint32_t offset, uint32_t value) {
    uint32_t word = (offset & 0x7Fu) / 4;
    switch (offset >> 7) {
    case 2:
        change_window(m->nvic.enabled, word, value, true);
        break;
    case 3:
        change_window(m->nvic.enabled, word, value, false);
        break;
    case 4:
        change_window(m->nvic.pending, word, value, true);
        break;
    case 5: /* a request that is still high stays pending */
        change_window(m->nvic.pending, word, value & ~window(m->nvic.line, word), false);
        break;
    default:
        break;
    }
}

void scs_write(machine_t *m, uint32_t offset, uint32_t value, unsigned size) {
    m->attention |= ATTENTION_EXCEPTION;
    if (offset >= 0x10 && offset < 0x20) {
        systick_write(m, offset, value);
    } else if (offset >= 0xD90 && offset < 0xDC0) {
        mpu_write(m, offset, value);
    } else if (offset >= 0x100 && offset < 0x300) {
        write_nvic(m, offset, value);
    } else if (offset >= 0x400 && offset < 0x4F0) {
        set_priorities(m, offset - 0x400 + 16, value, size);
    } else if (offset >= 0xD18 && offset < 0xD24) {
        set_priorities(m, offset - 0xD18 + 4, value, size);
    } else if (offset == 0xF00 && (value & 0x1FFu) + 16 < EXCEPTIONS) { /* STIR */
        exception_pend(m, (int)(16 + (value & 0x1FFu)));
    } else {
        write_scb(m, offset, value);
    }
}
