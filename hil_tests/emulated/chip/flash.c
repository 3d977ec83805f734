/* flash.c: the embedded flash (RM0090 chapter 3): keys, sector erase, programming, error flags.
 *
 * Programming only clears bits. While an operation runs, code that is fetched from the flash
 * waits for its end (cpu.c). A store to the flash that is not a permitted programming does
 * nothing but set an error flag, as on the chip: only the MPU can turn it into a fault. An
 * interrupted erase leaves the first half of its sector erased.
 */
#include "chip.h"

#include <string.h>

enum {
    SR_EOP = 1u << 0,
    SR_OPERR = 1u << 1,
    SR_WRPERR = 1u << 4,
    SR_PGAERR = 1u << 5,
    SR_PGPERR = 1u << 6,
    SR_PGSERR = 1u << 7,
    SR_BSY = 1u << 16
};
enum {
    CR_PG = 1u << 0,
    CR_SER = 1u << 1,
    CR_MER = 1u << 2,
    CR_STRT = 1u << 16,
    CR_EOPIE = 1u << 24,
    CR_ERRIE = 1u << 25
};
#define CR_LOCK (1u << 31)
enum { IRQ_FLASH = 4, SECTORS = 12 };

static const uint32_t SECTOR_KIB[SECTORS] = {16, 16, 16, 16, 64, 128, 128, 128, 128, 128, 128, 128};

static uint32_t sector_start(int sector) {
    uint32_t start = 0;
    for (int i = 0; i < sector; i++) {
        start += SECTOR_KIB[i] * 1024;
    }
    return start;
}

static int sector_of(uint32_t offset) {
    int sector = 0;
    while (sector < SECTORS - 1 && offset >= sector_start(sector + 1)) {
        sector++;
    }
    return sector;
}

static bool write_protected(const machine_t *m, int sector) {
    return !(m->flash.optcr >> (16 + sector) & 1u); /* nWRP */
}

static void update_irq(machine_t *m) {
    bool done = (m->flash.sr & SR_EOP) && (m->flash.cr & CR_EOPIE);
    bool failed = (m->flash.sr & SR_OPERR) && (m->flash.cr & CR_ERRIE);
    irq_level(m, IRQ_FLASH, done || failed);
}

static void fail(machine_t *m, uint32_t flag) {
    m->flash.sr |= flag | (m->flash.cr & CR_ERRIE ? SR_OPERR : 0u);
    update_irq(m);
}

static void start_operation(machine_t *m, tick_t duration) {
    m->flash.busy_until = m->now + duration;
    m->flash.sr |= SR_BSY;
    m->attention |= ATTENTION_STALL;
    schedule(m, EVENT_FLASH, m->flash.busy_until);
}

/* Typical times of the datasheet (table 40) in milliseconds for 16, 64 and 128 KiB, by PSIZE. */
static tick_t erase_time(const machine_t *m, int sector) {
    static const uint16_t ms[3][3] = {{400, 1200, 2000}, {300, 700, 1300}, {250, 550, 1000}};
    uint32_t psize = m->flash.cr >> 8 & 3u;
    int column = SECTOR_KIB[sector] == 16 ? 0 : SECTOR_KIB[sector] == 64 ? 1 : 2;
    return TICKS_PER_US * 1000 * ms[psize > 2 ? 2 : psize][column];
}

static void start_erase(machine_t *m) {
    flash_t *f = &m->flash;
    int first = 0;
    int count = SECTORS;
    if (!(f->cr & CR_MER)) {
        first = (int)(f->cr >> 3 & 15u);
        count = 1;
    }
    if (!(f->cr & (CR_SER | CR_MER)) || (f->cr & CR_PG) || first >= SECTORS) {
        fail(m, SR_PGSERR);
        return;
    }
    tick_t duration = 0;
    for (int sector = first; sector < first + count; sector++) {
        if (write_protected(m, sector)) {
            fail(m, SR_WRPERR);
            return;
        }
        duration += erase_time(m, sector);
    }
    f->erase_first = first;
    f->erase_count = count;
    start_operation(m, duration);
}

/* A store of the program to a flash address (either alias); unicorn itself drops it. */
void flash_program(machine_t *m, uint32_t address, unsigned size, uint64_t value) {
    flash_t *f = &m->flash;
    uint32_t offset = address & (FLASH_SIZE - 1);
    uint64_t wanted = 0;
    uint64_t old = 0;
    memcpy(&old, m->flash_memory + offset, size);
    wanted = old;
    if (f->busy_until > m->now) {
        m->now = f->busy_until; /* the store waits for the operation in progress */
        events_run(m);
    }
    if (!(f->cr & CR_PG)) {
        fail(m, SR_PGSERR);
    } else if (write_protected(m, sector_of(offset))) {
        fail(m, SR_WRPERR);
    } else if (offset % size != 0) {
        fail(m, SR_PGAERR);
    } else if (size != 1u << (f->cr >> 8 & 3u)) {
        fail(m, SR_PGPERR);
    } else {
        wanted = old & value;
        start_operation(m, TICKS_PER_US * 16);
    }
    memcpy(m->flash_memory + offset, &wanted, size);
    m->attention |= ATTENTION_FLASH; /* translated code may be stale */
}

void flash_event(machine_t *m, tick_t at) {
    flash_t *f = &m->flash;
    (void)at;
    for (int i = 0; i < f->erase_count; i++) {
        int sector = f->erase_first + i;
        memset(m->flash_memory + sector_start(sector), 0xFF, SECTOR_KIB[sector] * 1024);
        m->attention |= ATTENTION_FLASH;
    }
    f->erase_count = 0;
    f->sr = (f->sr & ~(uint32_t)SR_BSY) | (f->cr & CR_EOPIE ? SR_EOP : 0u);
    f->cr &= ~(uint32_t)CR_STRT;
    update_irq(m);
}

void flash_check_latency(machine_t *m) {
    uint32_t wait_states = m->flash.acr & 7u;
    if (m->rcc.hclk_hz > 30000000u * (wait_states + 1)) { /* table 10, 2.7 .. 3.6 V */
        note(m, "FLASH: %u wait states are too few for HCLK %u Hz", wait_states, m->rcc.hclk_hz);
    }
}

/* 3.5.1: new wait states are read back before the clock is raised. */
void flash_check_read_back(machine_t *m) {
    if (m->flash.latency_unread) {
        note(m, "FLASH: the clock is raised before the wait states were read back");
    }
}

uint32_t flash_read(machine_t *m, uint32_t offset) {
    switch (offset) {
    case 0x00:
        m->flash.latency_unread = m->flash.latency_unread && m->peeking;
        return m->flash.acr;
    case 0x0C:
        return m->flash.sr;
    case 0x10:
        return m->flash.cr;
    case 0x14:
        return m->flash.optcr;
    default:
        return 0;
    }
}

static void write_key(machine_t *m, uint32_t value) {
    flash_t *f = &m->flash;
    if (f->key_step == 0 && value == 0x45670123u && !f->refused) {
        f->key_step = 1;
    } else if (f->key_step == 1 && value == 0xCDEF89ABu) {
        f->key_step = 0;
        f->cr &= ~CR_LOCK;
    } else { /* any other sequence: bus error, and locked until the next reset (3.6.1) */
        f->refused = true;
        f->key_step = 0;
        f->cr |= CR_LOCK;
        bus_fault(m, 0x40023C04u);
    }
}

static void write_cr(machine_t *m, uint32_t value) {
    flash_t *f = &m->flash;
    if (f->cr & CR_LOCK) {
        note(m, "FLASH: CR written while locked");
        return;
    }
    if (f->busy_until > m->now) {
        m->now = f->busy_until; /* the bus waits */
        events_run(m);
    }
    f->cr = value & (0x0301037Fu | 0x80u | CR_LOCK);
    update_irq(m);
    if (value & CR_STRT) {
        start_erase(m);
    }
}

void flash_write(machine_t *m, uint32_t offset, uint32_t value) {
    flash_t *f = &m->flash;
    switch (offset) {
    case 0x00:
        f->latency_unread = f->latency_unread || (value & 7u) > (f->acr & 7u);
        f->acr = value & 0x1F07u;
        flash_check_latency(m);
        break;
    case 0x04:
        write_key(m, value);
        break;
    case 0x0C:
        f->sr &= ~(value & 0xF3u); /* write 1 to clear */
        update_irq(m);
        break;
    case 0x10:
        write_cr(m, value);
        break;
    case 0x08:
    case 0x14:
        unmodelled(m, "FLASH: changing the option bytes is not modelled");
        break;
    default:
        break;
    }
}

void flash_reset(machine_t *m) {
    flash_t *f = &m->flash;
    if (f->erase_count > 0) {
        uint32_t bytes = SECTOR_KIB[f->erase_first] * 1024;
        memset(m->flash_memory + sector_start(f->erase_first), 0xFF, bytes / 2);
        cpu_forget_code(m);
    }
    uint32_t optcr = f->optcr;
    memset(f, 0, sizeof *f);
    f->cr = CR_LOCK;
    f->optcr = optcr;
    schedule(m, EVENT_FLASH, NEVER);
}
