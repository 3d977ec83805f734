/* account.c: how many instructions each exception handler and the main loop take.
 *
 * Inclusive counts everything from entry to return; exclusive leaves out what preempted it. The
 * counts are of whole blocks (exact), in instructions, not in cycles.
 */
#include "core.h"

static void add_to_running(machine_t *m, int depth) {
    accounts_t *a = &m->accounts;
    a->exclusive[depth] += m->cpu.instructions - a->last_switch;
    a->last_switch = m->cpu.instructions;
}

static void close_activation(machine_t *m, int depth, int exception) {
    accounts_t *a = &m->accounts;
    account_t *entry = &a->exception[exception];
    uint64_t exclusive = a->exclusive[depth];
    uint64_t inclusive = m->cpu.instructions - a->start[depth];
    entry->activations++;
    entry->total_exclusive += exclusive;
    entry->total_inclusive += inclusive;
    entry->last_exclusive = (uint32_t)exclusive;
    entry->last_inclusive = (uint32_t)inclusive;
    if (exclusive > entry->worst_exclusive) {
        entry->worst_exclusive = exclusive;
    }
    if (inclusive > entry->worst_inclusive) {
        entry->worst_inclusive = inclusive;
    }
}

static void open_activation(machine_t *m, int depth) {
    accounts_t *a = &m->accounts;
    a->start[depth] = m->cpu.instructions;
    a->exclusive[depth] = 0;
    a->last_switch = m->cpu.instructions;
}

void account_enter(machine_t *m) {
    add_to_running(m, m->nvic.depth - 1);
    open_activation(m, m->nvic.depth);
}

void account_leave(machine_t *m, int exception) {
    add_to_running(m, m->nvic.depth);
    close_activation(m, m->nvic.depth, exception);
}

void account_sleep(machine_t *m) {
    if (m->nvic.depth == 0) {
        add_to_running(m, 0);
        close_activation(m, 0, 0);
        open_activation(m, 0);
    }
}

void account_wake(machine_t *m) {
    if (m->nvic.depth == 0) {
        open_activation(m, 0);
    }
}

account_t machine_account(const machine_t *m, uint32_t exception) {
    static const account_t none;
    return exception < EXCEPTIONS ? m->accounts.exception[exception] : none;
}

/* Activations that are open now count from here on. */
void machine_account_reset(machine_t *m) {
    for (int i = 0; i < EXCEPTIONS; i++) {
        m->accounts.exception[i] = (account_t){0};
    }
    for (int depth = 0; depth <= m->nvic.depth; depth++) {
        open_activation(m, depth);
    }
}
