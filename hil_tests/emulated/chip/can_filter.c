/* can_filter.c: CAN1's 28 filter banks (RM0090 32.7.4): 16- and 32-bit scale, mask and list. */
#include "chip.h"

enum { FINIT = 1 };

uint32_t can_filter_word(const wire_frame_t *f) { /* 32-bit scale: STID EXID IDE RTR 0 */
    uint32_t id = f->extended ? f->id << 3 : f->id << 21;
    return id | (uint32_t)f->extended << 2 | (uint32_t)f->remote << 1;
}

static uint32_t filter_half(const wire_frame_t *f) { /* 16-bit scale: STID RTR IDE EXID[17:15] */
    uint32_t standard = f->extended ? f->id >> 18 : f->id;
    uint32_t rest = f->extended ? f->id >> 15 & 7u : 0;
    return standard << 5 | (uint32_t)f->remote << 4 | (uint32_t)f->extended << 3 | rest;
}

/* Index of the matching filter within the bank, -1: none; count: how many the bank holds. */
static int match_bank(const bxcan_t *c, int bank, const wire_frame_t *f, int *count) {
    bool list = c->fm1r >> bank & 1u;
    bool wide = c->fs1r >> bank & 1u;
    const uint32_t *r = c->filter[bank];
    if (wide) {
        uint32_t word = can_filter_word(f);
        *count = list ? 2 : 1;
        if (list) {
            return word == r[0] ? 0 : word == r[1] ? 1 : -1;
        }
        return (word & r[1]) == (r[0] & r[1]) ? 0 : -1;
    }
    uint32_t half = filter_half(f);
    *count = list ? 4 : 2;
    for (int i = 0; i < 2; i++) {
        uint32_t low = r[i] & 0xFFFFu;
        uint32_t high = r[i] >> 16;
        if (list && (half == low || half == high)) {
            return 2 * i + (half == low ? 0 : 1);
        }
        if (!list && (half & high) == (low & high)) {
            return i;
        }
    }
    return -1;
}

/* The strongest matching filter: 32-bit before 16-bit, list before mask, then the lowest number. */
int can_filter_find(const bxcan_t *c, const wire_frame_t *f, int *fifo) {
    if (c->fmr & FINIT) {
        return -1; /* reception is off while filters change */
    }
    int banks = (int)(c->fmr >> 8 & 0x3Fu); /* CAN2SB: the rest belong to CAN2 */
    int number[2] = {0, 0};
    int best = -1;
    int best_rank = 4;
    for (int bank = 0; bank < banks && bank < 28; bank++) {
        int assigned = c->ffa1r >> bank & 1u;
        int count = 0;
        int index = match_bank(c, bank, f, &count);
        int rank = (c->fs1r >> bank & 1u ? 0 : 2) + (c->fm1r >> bank & 1u ? 0 : 1);
        if (index >= 0 && (c->fa1r >> bank & 1u) && rank < best_rank) {
            best_rank = rank;
            best = number[assigned] + index;
            *fifo = assigned;
        }
        number[assigned] += count;
    }
    return best;
}

void can_filter_write(machine_t *m, uint32_t offset, uint32_t value) {
    bxcan_t *c = &m->can;
    bool init = c->fmr & FINIT;
    if (offset == 0x200) {
        c->fmr = 0x2A1C0000u | (value & 0x3F01u);
        return;
    }
    if (!init && offset != 0x21C && offset < 0x240) {
        note(m, "CAN1: filter registers written without FINIT");
        return;
    }
    switch (offset) {
    case 0x204:
        c->fm1r = value & 0x0FFFFFFFu;
        return;
    case 0x20C:
        c->fs1r = value & 0x0FFFFFFFu;
        return;
    case 0x214:
        c->ffa1r = value & 0x0FFFFFFFu;
        return;
    case 0x21C:
        c->fa1r = value & 0x0FFFFFFFu;
        return;
    default:
        break;
    }
    if (offset >= 0x240 && offset < 0x320) {
        uint32_t bank = (offset - 0x240) / 8;
        if (!init && (c->fa1r >> bank & 1u)) {
            note(m, "CAN1: filter bank %u written while active", bank);
            return;
        }
        c->filter[bank][offset >> 2 & 1u] = value;
    }
}

uint32_t can_filter_read(const bxcan_t *c, uint32_t offset) {
    if (offset >= 0x240 && offset < 0x320) {
        return c->filter[(offset - 0x240) / 8][offset >> 2 & 1u];
    }
    switch (offset) {
    case 0x200:
        return c->fmr;
    case 0x204:
        return c->fm1r;
    case 0x20C:
        return c->fs1r;
    case 0x214:
        return c->ffa1r;
    case 0x21C:
        return c->fa1r;
    default:
        return 0;
    }
}
