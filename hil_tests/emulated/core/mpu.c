/* mpu.c: the memory protection unit (PM0214 4.2), for privileged code.
 *
 * unicorn protects pages of 1 KiB, regions may be as small as 32 bytes. So each page gets the
 * rights that all its bytes share; an access that those refuse comes to cpu.c, which asks
 * mpu_permits() for the exact answer. That does not do for reads, because unicorn remembers a
 * page once it has been read: a page of SRAM of which only a part may be read is mapped like a
 * register block, and every access to it is asked for here. Peripherals are asked for in bus.c.
 */
#include "core.h"

#include <string.h>

enum { CTRL_ENABLE = 1, CTRL_HFNMIENA = 2, CTRL_PRIVDEFENA = 4 };

/* Regions 0x40000000..0x5FFFFFFF (peripherals) and 0xA0000000 upwards are no-execute by default. */
static bool default_map_permits(uint32_t address, int access) {
    bool no_execute = (address >> 29) == 2 || address >= 0xA0000000u;
    return access != ACCESS_FETCH || !no_execute;
}

static bool region_covers(uint32_t rbar, uint32_t rasr, uint32_t address) {
    uint32_t size_bits = (rasr >> 1 & 0x1Fu) + 1;
    if (!(rasr & 1u) || size_bits < 5) {
        return false;
    }
    uint32_t offset = address - (rbar & ~0x1Fu);
    if (size_bits < 32 && (offset >> size_bits) != 0) {
        return false;
    }
    if (size_bits < 8) {
        return true; /* sub-regions exist from 256 bytes on */
    }
    uint32_t sub_region = offset >> (size_bits - 3);
    return !(rasr >> (8 + sub_region) & 1u);
}

bool mpu_permits(const machine_t *m, uint32_t address, int access) {
    const mpu_t *mpu = &m->mpu;
    if (!mpu->active || (address >> 20) == 0xE00) { /* the core's own registers: always */
        return default_map_permits(address, access);
    }
    for (int i = MPU_REGIONS - 1; i >= 0; i--) { /* the highest number wins */
        if (region_covers(mpu->rbar[i], mpu->rasr[i], address)) {
            uint32_t ap = mpu->rasr[i] >> 24 & 7u;
            bool read = ap != 0 && ap != 4;
            bool write = ap >= 1 && ap <= 3;
            bool fetch = read && !(mpu->rasr[i] & 1u << 28) && default_map_permits(address, access);
            return access == ACCESS_READ ? read : access == ACCESS_WRITE ? write : fetch;
        }
    }
    return (mpu->ctrl & CTRL_PRIVDEFENA) && default_map_permits(address, access);
}

/* Rights that every byte of a page has; rights change at multiples of 32 bytes only. */
static uint32_t page_rights(const machine_t *m, uint32_t page, uint32_t rights) {
    for (uint32_t address = page; address < page + MPU_PAGE; address += 32) {
        rights &= mpu_permits(m, address, ACCESS_READ) ? ~0u : ~(uint32_t)UC_PROT_READ;
        rights &= mpu_permits(m, address, ACCESS_WRITE) ? ~0u : ~(uint32_t)UC_PROT_WRITE;
        rights &= mpu_permits(m, address, ACCESS_FETCH) ? ~0u : ~(uint32_t)UC_PROT_EXEC;
    }
    return rights;
}

static void protect(machine_t *m, uint32_t base, uint32_t size, uint32_t most) {
    uint32_t start = base;
    uint32_t rights = page_rights(m, base, most);
    for (uint32_t page = base + MPU_PAGE; page < base + size; page += MPU_PAGE) {
        uint32_t next = page_rights(m, page, most);
        if (next != rights) {
            uc_mem_protect(m->cpu.uc, start, page - start, rights);
            start = page;
            rights = next;
        }
    }
    uc_mem_protect(m->cpu.uc, start, base + size - start, rights);
}

static bool refuse(machine_t *m, uint32_t address, int access) {
    if (mpu_permits(m, address, access)) {
        return false;
    }
    m->fault = (fault_t){true, MEM_MANAGE, 1u << 1, address, true}; /* DACCVIOL */
    uc_emu_stop(m->cpu.uc);
    return true;
}

static uint64_t read_trapped(uc_engine *uc, uint64_t offset, unsigned size, void *user) {
    const mpu_page_t *page = user;
    uint64_t value = 0;
    (void)uc;
    if (!refuse(page->m, page->base + (uint32_t)offset, ACCESS_READ)) {
        memcpy(&value, page->m->sram + (page->base - SRAM_BASE) + offset, size);
    }
    return value;
}

static void write_trapped(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value,
                          void *user) {
    const mpu_page_t *page = user;
    (void)uc;
    if (!refuse(page->m, page->base + (uint32_t)offset, ACCESS_WRITE)) {
        memcpy(page->m->sram + (page->base - SRAM_BASE) + offset, &value, size);
    }
}

static bool partly_readable(const machine_t *m, uint32_t page) {
    bool first = mpu_permits(m, page, ACCESS_READ);
    for (uint32_t address = page; address < page + MPU_PAGE; address += 32) {
        if (mpu_permits(m, address, ACCESS_READ) != first) {
            return true;
        }
    }
    return false;
}

/* Exchanges plain memory for trapped pages and back. */
static void trap_pages(machine_t *m) {
    for (uint32_t i = 0; i < SRAM_SIZE / MPU_PAGE; i++) {
        mpu_page_t *page = &m->mpu.page[i];
        *page = (mpu_page_t){m, SRAM_BASE + i * MPU_PAGE, page->trapped};
        bool trap = m->mpu.active && partly_readable(m, page->base);
        if (trap == page->trapped) {
            continue;
        }
        page->trapped = trap;
        uc_mem_unmap(m->cpu.uc, page->base, MPU_PAGE);
        if (trap) {
            uc_mmio_map(m->cpu.uc, page->base, MPU_PAGE, read_trapped, page, write_trapped, page);
        } else {
            uc_mem_map_ptr(m->cpu.uc, page->base, MPU_PAGE, UC_PROT_ALL, m->sram + i * MPU_PAGE);
        }
    }
}

/* SRAM between trapped pages. */
static void protect_sram(machine_t *m) {
    uint32_t start = SRAM_BASE;
    for (uint32_t i = 0; i <= SRAM_SIZE / MPU_PAGE; i++) {
        uint32_t at = SRAM_BASE + i * MPU_PAGE;
        if (i == SRAM_SIZE / MPU_PAGE || m->mpu.page[i].trapped) {
            if (at > start) {
                protect(m, start, at - start, UC_PROT_ALL);
            }
            start = at + MPU_PAGE;
        }
    }
}

/* A register access runs inside unicorn, where pages must not change: wait for the next stop. */
void mpu_changed(machine_t *m) {
    if ((m->mpu.ctrl & CTRL_ENABLE) || m->mpu.active) {
        m->attention |= ATTENTION_STOP;
    }
}

void mpu_apply(machine_t *m) {
    m->attention &= ~(uint32_t)ATTENTION_STOP;
    bool exempt = execution_priority(m) < 0 && !(m->mpu.ctrl & CTRL_HFNMIENA);
    bool active = (m->mpu.ctrl & CTRL_ENABLE) && !exempt;
    if (!active && !m->mpu.active) {
        return;
    }
    m->mpu.active = active;
    uint32_t read_run = UC_PROT_READ | UC_PROT_EXEC;
    protect(m, 0, FLASH_SIZE, read_run);
    protect(m, FLASH_BASE, FLASH_SIZE, read_run);
    trap_pages(m);
    protect_sram(m);
    protect(m, CCM_BASE, CCM_SIZE, UC_PROT_READ | UC_PROT_WRITE);
    uc_ctl_flush_tlb(m->cpu.uc); /* pages in use keep their old rights otherwise */
    cpu_forget_code(m);
}

uint32_t mpu_read(machine_t *m, uint32_t offset) {
    const mpu_t *mpu = &m->mpu;
    uint32_t alias = offset >= 0xDA4 ? (offset - 0xD9C) / 8 : 0;
    uint32_t region = alias != 0 ? (mpu->rnr & ~3u) + alias : mpu->rnr;
    switch (offset) {
    case 0xD90:
        return MPU_REGIONS << 8;
    case 0xD94:
        return mpu->ctrl;
    case 0xD98:
        return mpu->rnr;
    default:
        break;
    }
    bool is_base = ((offset - 0xD9C) & 7u) == 0;
    region &= MPU_REGIONS - 1;
    return is_base ? mpu->rbar[region] | region : mpu->rasr[region];
}

static void check_region(machine_t *m, uint32_t region) {
    uint32_t size_bits = (m->mpu.rasr[region] >> 1 & 0x1Fu) + 1;
    uint32_t base = m->mpu.rbar[region] & ~0x1Fu;
    bool on = m->mpu.rasr[region] & 1u;
    if (on && (size_bits < 5 || (size_bits < 32 && (base & ((1u << size_bits) - 1)) != 0))) {
        note(m, "MPU region %u: base %08x is not aligned to its size 2^%u", region, base,
             size_bits);
    }
}

void mpu_write(machine_t *m, uint32_t offset, uint32_t value) {
    mpu_t *mpu = &m->mpu;
    uint32_t alias = offset >= 0xDA4 ? (offset - 0xD9C) / 8 : 0;
    uint32_t region = alias != 0 ? (mpu->rnr & ~3u) + alias : mpu->rnr;
    region &= MPU_REGIONS - 1;
    if (offset == 0xD94) {
        mpu->ctrl = value & 7u;
    } else if (offset == 0xD98) {
        mpu->rnr = value & (MPU_REGIONS - 1);
        return;
    } else if (offset >= 0xD9C && ((offset - 0xD9C) & 7u) == 0) {
        if (value & 1u << 4) { /* VALID: the region is in the value */
            region = value & (MPU_REGIONS - 1);
            mpu->rnr = region;
        }
        mpu->rbar[region] = value & ~0x1Fu;
    } else if (offset >= 0xDA0) {
        mpu->rasr[region] = value;
        check_region(m, region);
    }
    mpu_changed(m);
}

void mpu_reset(machine_t *m) {
    memset(m->mpu.rbar, 0, sizeof m->mpu.rbar);
    memset(m->mpu.rasr, 0, sizeof m->mpu.rasr);
    m->mpu.ctrl = 0;
    m->mpu.rnr = 0;
    mpu_apply(m);
}
