/* cpu.c: the Cortex-M4 core: memory map, blocks of instructions, time, and why the core stopped.
 *
 * unicorn executes; this file counts and decides. Limits of unicorn, found by experiment: stop from
 * a register access unless that access is to be abandoned (it then runs again; this is how bus
 * faults are made precise here), or keep its default translation buffer.
 */
#include "system.h"

#include <stdlib.h>
#include <string.h>

uint32_t cpu_get(machine_t *m, int reg) {
    uint32_t value = 0;
    uc_reg_read(m->cpu.uc, reg, &value);
    return value;
}

void cpu_set(machine_t *m, int reg, uint32_t value) {
    uc_reg_write(m->cpu.uc, reg, &value);
}

uint8_t *memory_at(machine_t *m, uint32_t address, uint32_t length) {
    static const uint32_t base[] = {0, FLASH_BASE, SRAM_BASE, CCM_BASE, SYSTEM_BASE};
    static const uint32_t size[] = {FLASH_SIZE, FLASH_SIZE, SRAM_SIZE, CCM_SIZE, SYSTEM_SIZE};
    uint8_t *const memory[] = {m->flash_memory, m->flash_memory, m->sram, m->ccm, m->system};
    for (int i = 0; i < 5; i++) {
        if (address >= base[i] && length <= size[i] && address - base[i] <= size[i] - length) {
            return memory[i] + (address - base[i]);
        }
    }
    return NULL;
}

/* Thumb-2: a first halfword of 0b11101, 0b11110 or 0b11111 begins a 32-bit instruction. */
static uint16_t count_instructions(machine_t *m, uint32_t address, uint32_t size) {
    const uint8_t *code = memory_at(m, address, size);
    uint16_t count = 0;
    for (uint32_t i = 0; code != NULL && i < size; count++) {
        i += (code[i + 1] >> 3) >= 0x1D ? 4 : 2;
    }
    return count;
}

/* Everything that is not plain progress. True: do not run this block now. */
static bool interrupts_block(machine_t *m, uint32_t address) {
    if (m->attention & ATTENTION_STALL) {
        bool in_flash = address < FLASH_BASE + FLASH_SIZE;
        m->cpu.stalled = in_flash && m->flash.busy_until > m->now;
        if (m->cpu.stalled) {
            return true; /* the fetch waits until the flash can be read again */
        }
        if (m->flash.busy_until <= m->now) {
            m->attention &= ~(uint32_t)ATTENTION_STALL;
        }
    }
    if (m->now >= m->next_event) {
        events_run(m);
    }
    if (m->now >= m->until || (m->attention & (ATTENTION_STOP | ATTENTION_FLASH))) {
        return true;
    }
    return (m->attention & ATTENTION_EXCEPTION) && exception_takeable(m) != 0;
}

static void on_block(uc_engine *uc, uint64_t address64, uint32_t size, void *user) {
    machine_t *m = user;
    uint32_t address = (uint32_t)address64;
    if ((m->now >= m->wake_at || m->attention != 0) && interrupts_block(m, address)) {
        m->cpu.stopped = true;
        uc_emu_stop(uc);
        return;
    }
    uint32_t slot = ((address >> 1) * 2654435761u ^ size) & (BLOCK_CACHE - 1);
    if (m->cpu.block[slot].address != address || m->cpu.block[slot].size != size) {
        m->cpu.block[slot].address = address;
        m->cpu.block[slot].size = (uint16_t)size;
        m->cpu.block[slot].count = count_instructions(m, address, size);
    }
    uint32_t count = m->cpu.block[slot].count;
    m->cpu.instructions += count;
    m->now += count * m->cpu.ticks_per_instruction;
}

static void on_interrupt(uc_engine *uc, uint32_t number, void *user) {
    machine_t *m = user;
    m->cpu.interrupt = (int)number;
    uc_emu_stop(uc);
}

static void set_fault(machine_t *m, int exception, uint32_t cfsr, uint32_t address, bool valid) {
    m->fault = (fault_t){true, exception, cfsr, address, valid};
}

/* An access that the memory map forbids. True: let it happen after all. */
static bool on_forbidden(uc_engine *uc, uc_mem_type type, uint64_t address64, int size,
                         int64_t value, void *user) {
    machine_t *m = user;
    uint32_t address = (uint32_t)address64;
    bool fetch = type == UC_MEM_FETCH_UNMAPPED || type == UC_MEM_FETCH_PROT;
    bool write = type == UC_MEM_WRITE_UNMAPPED || type == UC_MEM_WRITE_PROT;
    int access = fetch ? ACCESS_FETCH : write ? ACCESS_WRITE : ACCESS_READ;
    (void)uc;
    if (!mpu_permits(m, address, access)) {
        set_fault(m, MEM_MANAGE, fetch ? 1u << 0 : 1u << 1, address,
                  !fetch); /* IACCVIOL DACCVIOL */
        return false;
    }
    uint8_t *memory = memory_at(m, address, (uint32_t)size);
    if (memory == NULL || fetch) {
        set_fault(m, BUS_FAULT, fetch ? 1u << 8 : 1u << 9, address, !fetch); /* IBUSERR PRECISERR */
        return false;
    }
    if (write && address < FLASH_BASE + FLASH_SIZE) {
        flash_program(m, address, (unsigned)size, (uint64_t)value);
    } else if (write && address >= SRAM_BASE) {
        memcpy(memory, &value, (size_t)size);
    } else if (write && address >= CCM_BASE && address < CCM_BASE + CCM_SIZE) {
        memcpy(memory, &value, (size_t)size);
    } else if (write) {
        set_fault(m, BUS_FAULT, 1u << 9, address, true);
        return false;
    }
    return true;
}

/* Rights are given in a second step: only that makes unicorn drop the stores it must not do. */
static void map(machine_t *m, uint32_t base, uint32_t size, uint32_t rights, uint8_t *memory) {
    uc_mem_map_ptr(m->cpu.uc, base, size, UC_PROT_ALL, memory);
    uc_mem_protect(m->cpu.uc, base, size, rights);
}

bool cpu_open(machine_t *m) {
    uc_engine *uc = NULL;
    if (uc_open(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS, &uc) != UC_ERR_OK) {
        return false;
    }
    m->cpu.uc = uc;
    uc_ctl_set_cpu_model(uc, UC_CPU_ARM_CORTEX_M4);
    uc_ctl_set_tcg_buffer_size(uc, 16u << 20);
    map(m, FLASH_BASE, FLASH_SIZE, UC_PROT_READ | UC_PROT_EXEC, m->flash_memory);
    map(m, 0, FLASH_SIZE, UC_PROT_READ | UC_PROT_EXEC, m->flash_memory); /* BOOT0 low */
    map(m, SRAM_BASE, SRAM_SIZE, UC_PROT_ALL, m->sram);
    map(m, CCM_BASE, CCM_SIZE, UC_PROT_READ | UC_PROT_WRITE, m->ccm);
    map(m, SYSTEM_BASE, SYSTEM_SIZE, UC_PROT_READ, m->system);
    bus_map(m);
    uc_hook hook;
    uc_hook_add(uc, &hook, UC_HOOK_BLOCK, (void *)on_block, m, 1, 0);
    uc_hook_add(uc, &hook, UC_HOOK_INTR, (void *)on_interrupt, m, 1, 0);
    uc_hook_add(uc, &hook, UC_HOOK_MEM_INVALID, (void *)on_forbidden, m, 1, 0);
    return true;
}

void cpu_reset(machine_t *m) {
    static const int cleared[] = {UC_ARM_REG_CONTROL, UC_ARM_REG_PRIMASK, UC_ARM_REG_BASEPRI,
                                  UC_ARM_REG_FAULTMASK};
    for (size_t i = 0; i < sizeof cleared / sizeof cleared[0]; i++) {
        cpu_set(m, cleared[i], 0);
    }
    uint32_t vector[2];
    memcpy(vector, m->flash_memory, sizeof vector);
    cpu_set(m, UC_ARM_REG_XPSR, 0x01000000u);
    cpu_set(m, UC_ARM_REG_SP, vector[0] & ~3u);
    cpu_set(m, UC_ARM_REG_LR, 0xFFFFFFFFu);
    m->cpu.pc = vector[1] & ~1u;
    m->cpu.sleeping = false;
    m->cpu.stalled = false;
    m->attention = ATTENTION_EXCEPTION;
}

void cpu_forget_code(machine_t *m) {
    memset(m->cpu.block, 0, sizeof m->cpu.block);
    if (m->cpu.instructions > 0) { /* unicorn makes its buffer on the first run */
        uc_ctl_flush_tb(m->cpu.uc);
    }
}

static uint16_t halfword_at(machine_t *m, uint32_t address) {
    const uint8_t *code = memory_at(m, address, 2);
    return code != NULL ? (uint16_t)(code[0] | code[1] << 8) : 0;
}

/* An instruction that does not exist, or state that Thumb-only cores do not have. */
static void undefined_instruction(machine_t *m) {
    uint16_t before = halfword_at(m, m->cpu.pc - 2);
    if (before == 0xBF20 || before == 0xBF10) {
        return; /* WFE and YIELD may end at once */
    }
    bool thumb = (cpu_get(m, UC_ARM_REG_XPSR) & 1u << 24) != 0;
    fault_t fault = {true, USAGE_FAULT, thumb ? 1u << 16 : 1u << 17, 0, false};
    exception_fault(m, &fault);
}

static int why_stopped(machine_t *m, uc_err error) {
    if (m->fault.present) {
        fault_t fault = m->fault;
        exception_fault(m, &fault);
    } else if (m->cpu.interrupt == 8) { /* QEMU: exception exit */
        exception_return(m, m->cpu.pc | 1u);
    } else if (m->cpu.interrupt == 2) {
        if ((m->nvic.priority[SVCALL] & m->nvic.group_mask) < execution_priority(m)) {
            exception_pend(m, SVCALL);
        } else { /* a supervisor call that cannot be taken escalates */
            exception_fault(m, &(fault_t){true, HARD_FAULT, 0, 0, false});
        }
    } else if (m->cpu.interrupt == 7) { /* BKPT without a debugger */
        m->nvic.hfsr |= 1u << 31;
        exception_fault(m, &(fault_t){true, HARD_FAULT, 0, 0, false});
    } else if (m->cpu.interrupt == 3) { /* fetch from a peripheral's region: always no-execute */
        exception_fault(m, &(fault_t){true, MEM_MANAGE, 1u << 0, 0, false});
    } else if (error == UC_ERR_INSN_INVALID) {
        undefined_instruction(m);
    } else if (error != UC_ERR_OK || m->cpu.interrupt != 0) {
        note(m, "emulator: %s, interrupt %d, pc %08x", uc_strerror(error), m->cpu.interrupt,
             m->cpu.pc);
        return -1;
    } else if (!m->cpu.stopped) {
        if (halfword_at(m, m->cpu.pc - 2) != 0xBF30) {
            note(m, "emulator: stopped for no known reason at pc %08x", m->cpu.pc);
            return -1;
        }
        if (m->nvic.scr & 1u << 2) {
            unmodelled(m, "SCR.SLEEPDEEP: stop and standby are not modelled, taken as sleep");
        }
        m->cpu.sleeping = true;
        account_sleep(m);
    }
    return 0;
}

static int execute(machine_t *m) {
    m->cpu.stopped = false;
    m->cpu.interrupt = 0;
    m->fault.present = false;
    uc_err error = uc_emu_start(m->cpu.uc, m->cpu.pc | 1u, 0xFFFFFFFEu, 0, 0);
    m->cpu.pc = cpu_get(m, UC_ARM_REG_PC);
    if (m->attention & ATTENTION_FLASH) {
        m->attention &= ~(uint32_t)ATTENTION_FLASH;
        cpu_forget_code(m);
    }
    return why_stopped(m, error);
}

static bool stands_still(const machine_t *m) {
    return m->nvic.locked_up || m->pwr.held || m->debug.halted;
}

/* The core does nothing until something happens. */
static void wait(machine_t *m) {
    if (m->cpu.sleeping && !stands_still(m) && exception_wakes(m)) {
        m->cpu.sleeping = false;
        account_wake(m);
    } else if (m->wake_at > m->now) {
        m->cpu.slept += m->wake_at - m->now;
        m->now = m->wake_at;
    }
}

int cpu_run(machine_t *m) {
    int status = 0;
    events_run(m);
    while (status == 0) {
        if (m->reset_cause != 0) {
            perform_reset(m);
        }
        if (m->attention & ATTENTION_STOP) {
            mpu_apply(m);
        }
        if (m->now >= m->next_event) {
            events_run(m);
            continue;
        }
        bool halted = stands_still(m);
        m->cpu.stalled = m->cpu.stalled && m->now < m->flash.busy_until;
        int exception = halted || m->cpu.stalled ? 0 : exception_takeable(m);
        if (exception != 0) {
            exception_enter(m, exception);
        } else if (m->now >= m->until) {
            return 0;
        } else if (m->cpu.stalled) {
            tick_t end = m->flash.busy_until;
            m->now = end < m->wake_at ? end : m->wake_at;
        } else if (m->cpu.sleeping || halted) {
            wait(m);
        } else {
            status = execute(m);
        }
    }
    return status;
}
