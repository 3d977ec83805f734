/* exceptions.c: the NVIC and what the core does at exception entry and return (PM0214 2.3, 2.4).
 *
 * Modelled: 16 priorities with grouping, preemption, PRIMASK, BASEPRI, FAULTMASK, level-sensitive
 * requests, escalation, faults while stacking, lock-up. Not modelled: the process stack and
 * floating-point frames (noted when used); tail-chaining and late arrival save cycles only.
 */
#include "core.h"

#include <string.h>

enum { ENTRY_CYCLES = 12, RETURN_CYCLES = 10 };

static uint64_t bit(int exception) {
    return 1ull << (exception & 63);
}

static int group_priority(const machine_t *m, int exception) {
    if (exception <= HARD_FAULT) {
        return exception - 4; /* NMI -2, HardFault -1 */
    }
    return m->nvic.priority[exception] & m->nvic.group_mask;
}

static int active_priority(const machine_t *m) {
    int lowest = 256;
    for (int i = 0; i < m->nvic.depth; i++) {
        int priority = group_priority(m, m->nvic.active[i]);
        lowest = priority < lowest ? priority : lowest;
    }
    return lowest;
}

/* What PRIMASK, BASEPRI and FAULTMASK let through: priorities below the result. */
static int mask_priority(const machine_t *m) {
    machine_t *writable = (machine_t *)m; /* reading a register changes nothing */
    int basepri = (int)(cpu_get(writable, UC_ARM_REG_BASEPRI) & m->nvic.group_mask);
    int limit = basepri != 0 ? basepri : 256;
    if (cpu_get(writable, UC_ARM_REG_PRIMASK) & 1u) {
        limit = 0;
    }
    return cpu_get(writable, UC_ARM_REG_FAULTMASK) & 1u ? -1 : limit;
}

int execution_priority(const machine_t *m) {
    int active = active_priority(m);
    int mask = mask_priority(m);
    return active < mask ? active : mask;
}

void exception_pend(machine_t *m, int exception) {
    m->nvic.pending[exception >> 6] |= bit(exception);
    m->attention |= ATTENTION_EXCEPTION;
}

/* A peripheral's request line. It pends on its rising edge, and again at return while it is high.
 */
void irq_level(machine_t *m, int irq, bool asserted) {
    int exception = 16 + irq;
    uint64_t *line = &m->nvic.line[exception >> 6];
    if (asserted && !(*line & bit(exception))) {
        exception_pend(m, exception);
    }
    *line = asserted ? *line | bit(exception) : *line & ~bit(exception);
}

static int best_pending(const machine_t *m) {
    int best = 0;
    int best_priority = 512;
    for (int word = 0; word < 2; word++) {
        uint64_t left = m->nvic.pending[word] & m->nvic.enabled[word];
        for (; left != 0; left &= left - 1) {
            int exception = word * 64 + __builtin_ctzll(left);
            int priority = exception <= HARD_FAULT ? exception - 4 : m->nvic.priority[exception];
            if (priority < best_priority) { /* equal priorities: the lowest number first */
                best = exception;
                best_priority = priority;
            }
        }
    }
    return best;
}

int exception_takeable(machine_t *m) {
    int best = best_pending(m);
    if (best == 0 || group_priority(m, best) >= active_priority(m)) {
        m->attention &= ~(uint32_t)ATTENTION_EXCEPTION; /* until something is pended or returns */
        return 0;
    }
    m->attention |= ATTENTION_EXCEPTION; /* masks change without our knowing: keep looking */
    return group_priority(m, best) < mask_priority(m) ? best : 0;
}

/* WFI ends for what would preempt if PRIMASK were 0 (PM0214 2.5.3). */
bool exception_wakes(machine_t *m) {
    int best = best_pending(m);
    if (best == 0 || group_priority(m, best) >= active_priority(m)) {
        return false;
    }
    int basepri = (int)(cpu_get(m, UC_ARM_REG_BASEPRI) & m->nvic.group_mask);
    return basepri == 0 || group_priority(m, best) < basepri;
}

static const int FRAME[8] = {UC_ARM_REG_R0,  UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3,
                             UC_ARM_REG_R12, UC_ARM_REG_LR, UC_ARM_REG_PC, UC_ARM_REG_XPSR};

/* The memory of an eight-word frame, or NULL with the fault that the access makes. */
static uint8_t *frame_memory(machine_t *m, uint32_t sp, int access, fault_t *fault) {
    bool write = access == ACCESS_WRITE;
    if (!mpu_permits(m, sp, access) || !mpu_permits(m, sp + 28, access)) {
        *fault = (fault_t){true, MEM_MANAGE, write ? 1u << 4 : 1u << 3, 0, false}; /* MSTKERR */
        return NULL;
    }
    uint8_t *memory = sp >= CCM_BASE ? memory_at(m, sp, 32) : NULL;
    if (memory == NULL || (sp >= SYSTEM_BASE && sp < SRAM_BASE)) {
        *fault = (fault_t){true, BUS_FAULT, write ? 1u << 12 : 1u << 11, 0, false}; /* STKERR */
        return NULL;
    }
    return memory;
}

static bool fault_enabled(const machine_t *m, int exception) {
    return exception == HARD_FAULT || (m->nvic.shcsr & 1u << (exception + 12)) != 0;
}

static void record_crash(machine_t *m, int exception) {
    if (exception >= HARD_FAULT && exception <= USAGE_FAULT && !m->crash.happened) {
        m->crash = (crash_t){.happened = true,
                             .exception = (uint32_t)exception,
                             .pc = m->cpu.pc,
                             .address = m->fault.address_valid ? m->fault.address : 0,
                             .cfsr = m->nvic.cfsr,
                             .hfsr = m->nvic.hfsr,
                             .time_us = m->now / TICKS_PER_US};
    }
}

/* Pushes the frame. When that fails the derived fault goes first if its priority allows, else the
 * entry becomes a HardFault; the entry of HardFault or NMI itself goes on without a frame. */
static int push_frame(machine_t *m, int exception) {
    uint32_t frame[8];
    void *into[8];
    for (int i = 0; i < 8; i++) {
        into[i] = &frame[i];
    }
    uc_reg_read_batch(m->cpu.uc, (int *)FRAME, into, 8);
    uint32_t sp = cpu_get(m, UC_ARM_REG_SP);
    bool padded = (sp & 4u) != 0;
    frame[6] = m->cpu.pc;
    frame[7] = (frame[7] & ~0x200u) | (padded ? 0x200u : 0u);
    sp = (sp - 32u) & ~7u;
    fault_t fault;
    uint8_t *memory = frame_memory(m, sp, ACCESS_WRITE, &fault);
    cpu_set(m, UC_ARM_REG_SP, sp);
    if (memory != NULL) {
        memcpy(memory, frame, sizeof frame);
        return exception;
    }
    m->nvic.cfsr |= fault.cfsr;
    if (exception <= HARD_FAULT) {
        return exception;
    }
    if (fault_enabled(m, fault.exception) &&
        group_priority(m, fault.exception) < group_priority(m, exception)) {
        return fault.exception;
    }
    m->nvic.hfsr |= 1u << 30;
    return HARD_FAULT;
}

void exception_enter(machine_t *m, int exception) {
    record_crash(m, exception);
    int taken = push_frame(m, exception);
    record_crash(m, taken);
    m->cpu.sleeping = false;
    m->nvic.pending[taken >> 6] &= ~bit(taken);
    uint32_t lr = m->nvic.depth == 0 ? 0xFFFFFFF9u : 0xFFFFFFF1u;
    if (cpu_get(m, UC_ARM_REG_CONTROL) & 2u) {
        unmodelled(m, "CONTROL.SPSEL: the process stack is not modelled");
    }
    m->nvic.active[m->nvic.depth++] = (uint8_t)taken;
    account_enter(m);
    if (taken <= HARD_FAULT) {
        mpu_changed(m);
    }
    const uint8_t *entry = memory_at(m, m->nvic.vtor + 4u * (uint32_t)taken, 4);
    uint32_t vector = 0;
    if (entry != NULL) {
        memcpy(&vector, entry, 4);
    }
    cpu_set(m, UC_ARM_REG_LR, lr);
    cpu_set(m, UC_ARM_REG_XPSR, 0x01000000u | (uint32_t)taken);
    m->cpu.pc = vector & ~1u;
    m->now += ENTRY_CYCLES * (TICKS_PER_SECOND / m->rcc.hclk_hz);
    if (!(vector & 1u)) {
        m->nvic.hfsr |= entry == NULL ? 1u << 1 : 0u; /* VECTTBL */
        exception_fault(m, &(fault_t){true, USAGE_FAULT, 1u << 17, 0, false});
    }
    m->attention |= ATTENTION_EXCEPTION;
}

/* A fault of the instruction at the program counter. */
void exception_fault(machine_t *m, const fault_t *fault) {
    nvic_t *n = &m->nvic;
    n->cfsr |= fault->cfsr;
    if (fault->address_valid && fault->exception == MEM_MANAGE) {
        n->mmfar = fault->address;
        n->cfsr |= 1u << 7;
    } else if (fault->address_valid && fault->exception == BUS_FAULT) {
        n->bfar = fault->address;
        n->cfsr |= 1u << 15;
    }
    m->fault = *fault;
    int priority = execution_priority(m);
    if (priority < 0) {
        n->locked_up = true;
        record_crash(m, HARD_FAULT);
        m->crash.lockup = true;
        return;
    }
    int target = fault->exception;
    if (!fault_enabled(m, target) || group_priority(m, target) >= priority) {
        n->hfsr |= target != HARD_FAULT ? 1u << 30 : 0u; /* FORCED */
        target = HARD_FAULT;
    }
    exception_enter(m, target);
}

/* EXC_RETURN: 0xFFFFFFF1 to a handler, 0xFFFFFFF9 to thread mode, both on the main stack. */
void exception_return(machine_t *m, uint32_t exc_return) {
    nvic_t *n = &m->nvic;
    uint32_t frame[8];
    uint32_t sp = cpu_get(m, UC_ARM_REG_SP);
    int leaving = n->active[n->depth - 1];
    bool to_thread = exc_return == 0xFFFFFFF9u;
    account_leave(m, leaving);
    n->depth--;
    if (leaving != NMI) {
        cpu_set(m, UC_ARM_REG_FAULTMASK, 0);
    }
    if (leaving <= HARD_FAULT) {
        mpu_changed(m);
    }
    if (n->line[leaving >> 6] & bit(leaving)) {
        exception_pend(m, leaving);
    }
    m->attention |= ATTENTION_EXCEPTION;
    fault_t fault = {true, USAGE_FAULT, 1u << 18, 0, false}; /* INVPC */
    bool legal = to_thread ? n->depth == 0 : exc_return == 0xFFFFFFF1u && n->depth > 0;
    if (!legal) {
        note(m, "return with EXC_RETURN %08x at depth %d", exc_return, n->depth);
        exception_fault(m, &fault);
        return;
    }
    const uint8_t *memory = frame_memory(m, sp, ACCESS_READ, &fault);
    if (memory == NULL) {
        exception_fault(m, &fault);
        return;
    }
    memcpy(frame, memory, sizeof frame);
    void *from[8];
    for (int i = 0; i < 8; i++) {
        from[i] = &frame[i];
    }
    m->cpu.pc = frame[6] & ~1u;
    uint32_t psr = frame[7];
    frame[7] &= ~0x200u;
    cpu_set(m, UC_ARM_REG_SP, sp + 32u + (psr & 0x200u ? 4u : 0u));
    uc_reg_write_batch(m->cpu.uc, (int *)FRAME, from, 6);
    cpu_set(m, UC_ARM_REG_XPSR, frame[7]);
    m->now += RETURN_CYCLES * (TICKS_PER_SECOND / m->rcc.hclk_hz);
    if (n->depth == 0 && (n->scr & 2u)) { /* SLEEPONEXIT */
        m->cpu.sleeping = true;
    }
}
