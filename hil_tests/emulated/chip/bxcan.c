/* bxcan.c: CAN1's controller (RM0090 chapter 32): modes, three mailboxes, filters, two FIFOs,
 * error counters and bus-off, interrupts. What happens on the wire is in can_bus.c.
 *
 * Not modelled, and noted when used: loop-back and silent mode, time-triggered mode.
 */
#include "chip.h"

#include <string.h>

enum { INRQ = 1, SLEEP = 2, TXFP = 4, RFLM = 8, NART = 16, AWUM = 32, ABOM = 64, TTCM = 128 };
enum { INAK = 1, SLAK = 2, ERRI = 4, WKUI = 8, SLAKI = 16 };
enum { TXRQ = 1, RQCP = 1, TXOK = 2, ALST = 4, TERR = 8, ABRQ = 0x80 };
enum { FULL = 8, FOVR = 16, RFOM = 32 };
enum { EWGF = 1, EPVF = 2, BOFF = 4 };
enum { IRQ_TX = 19, IRQ_RX0 = 20, IRQ_RX1 = 21, IRQ_SCE = 22 };

static bool is_pending(const bxcan_t *c, int box) {
    return !(c->tsr >> (26 + box) & 1u); /* TME */
}

uint32_t bxcan_bitrate(const machine_t *m) {
    uint32_t btr = m->can.btr;
    uint32_t quanta = 3 + (btr >> 16 & 15u) + (btr >> 20 & 7u);
    return m->rcc.pclk1_hz / ((btr & 0x3FFu) + 1) / quanta;
}

/* Takes part in the traffic: out of initialisation, sleep and bus-off. */
bool bxcan_on_bus(machine_t *m) {
    return !(m->can.msr & (INAK | SLAK)) && !(m->can.esr & BOFF) && (m->rcc.enable[3] >> 25 & 1u);
}

wire_frame_t mailbox_frame(const mailbox_t *box) {
    bool extended = box->tir >> 2 & 1u;
    wire_frame_t frame = {.id = extended ? box->tir >> 3 : box->tir >> 21,
                          .extended = extended,
                          .remote = box->tir >> 1 & 1u,
                          .length = (uint8_t)(box->tdtr & 15u)};
    frame.length = frame.length > 8 ? 8 : frame.length;
    if (!frame.remote) {
        uint32_t words[2] = {box->tdlr, box->tdhr};
        memcpy(frame.data, words, frame.length);
    }
    return frame;
}

/* Lower is stronger, in the order of the bits on the wire. */
static uint32_t arbitration_key(const mailbox_t *box) {
    wire_frame_t f = mailbox_frame(box);
    return f.extended ? (f.id >> 18) << 21 | 3u << 19 | (f.id & 0x3FFFFu) << 1 | f.remote
                      : f.id << 21 | (uint32_t)f.remote << 20;
}

static bool goes_first(const bxcan_t *c, int box, int other) {
    if (c->mcr & TXFP) {
        return c->order[box] < c->order[other];
    }
    return arbitration_key(&c->tx[box]) < arbitration_key(&c->tx[other]);
}

int bxcan_best_mailbox(const machine_t *m) {
    int best = -1;
    for (int box = 0; box < 3; box++) {
        if (is_pending(&m->can, box) && (best < 0 || goes_first(&m->can, box, best))) {
            best = box;
        }
    }
    return best;
}

static void update_irqs(machine_t *m) {
    const bxcan_t *c = &m->can;
    uint32_t ier = c->ier;
    irq_level(m, IRQ_TX, (ier & 1u) && (c->tsr & (RQCP | RQCP << 8 | RQCP << 16)));
    for (int n = 0; n < 2; n++) {
        uint32_t enables = ier >> (n == 0 ? 1 : 4) & 7u; /* FMPIE, FFIE, FOVIE */
        uint32_t rfr = c->rfr[n];
        irq_level(m, IRQ_RX0 + n,
                  ((enables & 1u) && (rfr & 3u)) || ((enables & 2u) && (rfr & FULL)) ||
                      ((enables & 4u) && (rfr & FOVR)));
    }
    irq_level(m, IRQ_SCE,
              ((ier & 1u << 15) && (c->msr & ERRI)) || ((ier & 1u << 16) && (c->msr & WKUI)) ||
                  ((ier & 1u << 17) && (c->msr & SLAKI)));
}

/* CODE and LOW of TSR follow from the mailboxes (32.9.2). */
static void update_status(bxcan_t *c) {
    int empty = -1;
    int lowest = -1;
    int pending = 0;
    for (int box = 2; box >= 0; box--) {
        if (!is_pending(c, box)) {
            empty = box;
        } else {
            pending++;
            lowest = lowest < 0 || goes_first(c, lowest, box) ? box : lowest;
        }
    }
    uint32_t code = (uint32_t)(empty >= 0 ? empty : lowest);
    c->tsr = (c->tsr & ~(0xE3000000u)) | code << 24 | (pending > 1 ? 1u << (29 + lowest) : 0u);
}

static void update_errors(machine_t *m, int code) {
    bxcan_t *c = &m->can;
    uint32_t old = c->esr;
    uint32_t flags = (c->tec >= 96 || c->rec >= 96 ? (uint32_t)EWGF : 0u) |
                     (c->tec > 127 || c->rec > 127 ? (uint32_t)EPVF : 0u);
    if (c->tec > 255 && !(old & BOFF)) {
        flags |= BOFF;
        if (c->mcr & ABOM) {
            c->recovered_at = m->now + 128 * 11 * can_bit_ticks(m);
        }
    }
    flags |= old & BOFF;
    uint32_t lec = code >= 0 ? (uint32_t)code << 4 : old & 0x70u;
    uint32_t tec = (uint32_t)(c->tec > 255 ? 255 : c->tec);
    uint32_t rec = (uint32_t)(c->rec > 255 ? 255 : c->rec);
    c->esr = flags | lec | tec << 16 | rec << 24;
    uint32_t risen = flags & ~old & 7u;
    if ((risen & c->ier >> 8 & 7u) || (code > 0 && (c->ier & 1u << 11))) {
        c->msr |= ERRI;
    }
}

/* Brings every derived bit and the request lines up to date. */
void bxcan_update(machine_t *m) {
    update_status(&m->can);
    update_irqs(m);
}

static void complete(bxcan_t *c, int box, uint32_t flags) {
    c->tx[box].tir &= ~(uint32_t)TXRQ;
    c->tsr &= ~(uint32_t)((TXOK | ALST | TERR | ABRQ) << (8 * box));
    c->tsr |= 1u << (26 + box) | (RQCP | flags) << (8 * box);
}

static bool abort_pending(const machine_t *m, int mailbox) {
    return m->can.tsr >> (8 * mailbox) & ABRQ;
}

static void enter_requested_mode(machine_t *m);

/* A transmission has ended; one that failed stays in its mailbox unless NART or an abort. */
void bxcan_sent(machine_t *m, int mailbox, bool ok, bool arbitration_lost) {
    bxcan_t *c = &m->can;
    if (ok) {
        c->tec -= c->tec > 0 ? 1 : 0;
        complete(c, mailbox, TXOK);
        update_errors(m, 0);
    } else if ((c->mcr & NART) || abort_pending(m, mailbox)) {
        complete(c, mailbox, arbitration_lost ? ALST : TERR);
    }
    enter_requested_mode(m);
    bxcan_update(m);
}

/* counts: false for a missing acknowledge of an error-passive node (CAN 2.0 rule 3, exception 1).
 */
void bxcan_tx_error(machine_t *m, int mailbox, int code, bool counts) {
    m->can.tec += counts ? 8 : 0;
    update_errors(m, code);
    if (mailbox >= 0) {
        bxcan_sent(m, mailbox, false, false);
    }
    bxcan_update(m);
}

void bxcan_rx_error(machine_t *m, int code) {
    m->can.rec += m->can.rec < 255 ? (code == 1 || code == 2 ? 8 : 1) : 0;
    update_errors(m, code);
    bxcan_update(m);
}

void bxcan_received(machine_t *m, const wire_frame_t *f) {
    bxcan_t *c = &m->can;
    int n = 0;
    c->rec -= c->rec > 127 ? c->rec - 120 : c->rec > 0 ? 1 : 0;
    update_errors(m, 0);
    int filter = can_filter_find(c, f, &n);
    if (filter >= 0) {
        uint32_t held = c->rfr[n] & 3u;
        uint32_t words[2];
        memcpy(words, f->data, 8);
        mailbox_t box = {can_filter_word(f), f->length | (uint32_t)filter << 8, words[0], words[1]};
        if (held < 3) {
            c->fifo[n][held] = box;
            c->rfr[n] = (c->rfr[n] & ~3u) | (held + 1) | (held == 2 ? (uint32_t)FULL : 0u);
        } else {
            c->rfr[n] |= FOVR;
            if (!(c->mcr & RFLM)) {
                c->fifo[n][2] = box; /* the newest replaces the last one */
            }
        }
    }
    bxcan_update(m);
}

/* ---- modes (32.4) ---- */
static void enter_requested_mode(machine_t *m) {
    bxcan_t *c = &m->can;
    bool transmitting = m->can_bus.busy && m->can_bus.sender < 3;
    if (c->mcr & SLEEP) {
        if (!transmitting && !(c->msr & SLAK)) {
            c->msr = (c->msr & ~(uint32_t)INAK) | SLAK | SLAKI;
        }
    } else if (c->mcr & INRQ) {
        if (!transmitting) {
            c->msr = (c->msr & ~(uint32_t)SLAK) | INAK;
            c->synchronised_at = NEVER;
        }
    } else if ((c->msr & (INAK | SLAK)) && c->synchronised_at == NEVER) {
        c->synchronised_at = m->now + 11 * can_bit_ticks(m); /* 11 recessive bits */
        if ((c->esr & BOFF) && !(c->mcr & ABOM)) {
            c->recovered_at = m->now + 128 * 11 * can_bit_ticks(m);
        }
    }
}

static void write_mcr(machine_t *m, uint32_t value) {
    bxcan_t *c = &m->can;
    if (value & 1u << 15) { /* RESET: back to sleep */
        can_bus_drop_node(m);
        bxcan_reset(m);
        return;
    }
    if (value & TTCM) {
        unmodelled(m, "CAN1: time-triggered mode is not modelled");
    }
    if (value & AWUM) {
        unmodelled(m, "CAN1: automatic wake-up is not modelled");
    }
    c->mcr = value & 0x100FFu;
    enter_requested_mode(m);
}

static void write_tsr(machine_t *m, uint32_t value) {
    bxcan_t *c = &m->can;
    for (int box = 0; box < 3; box++) {
        uint32_t bits = value >> (8 * box);
        if (bits & RQCP) {
            c->tsr &= ~(uint32_t)((RQCP | TXOK | ALST | TERR) << (8 * box));
        }
        if ((bits & ABRQ) && is_pending(c, box)) {
            c->tsr |= (uint32_t)ABRQ << (8 * box);
            if (!(m->can_bus.busy && m->can_bus.sender == box)) {
                complete(c, box, 0);
            }
        }
    }
}

static void write_mailbox(machine_t *m, int box, uint32_t offset, uint32_t value) {
    bxcan_t *c = &m->can;
    if (is_pending(c, box)) {
        note(m, "CAN1: mailbox %d written while it is pending", box);
        return;
    }
    switch (offset) {
    case 0x0:
        c->tx[box].tir = value;
        break;
    case 0x4:
        c->tx[box].tdtr = value & 0xFFFF010Fu;
        break;
    case 0x8:
        c->tx[box].tdlr = value;
        break;
    default:
        c->tx[box].tdhr = value;
        break;
    }
    if (offset == 0 && (value & TXRQ)) {
        c->tsr &= ~(0xFu << (8 * box) | 1u << (26 + box));
        c->order[box] = c->orders++;
    }
}

static void release(bxcan_t *c, int n) {
    uint32_t held = c->rfr[n] & 3u;
    if (held > 0) {
        memmove(&c->fifo[n][0], &c->fifo[n][1], 2 * sizeof(mailbox_t));
        c->rfr[n] = (c->rfr[n] & ~3u) | (held - 1);
    }
}

void bxcan_write(machine_t *m, uint32_t offset, uint32_t value) {
    bxcan_t *c = &m->can;
    if (offset >= 0x200) {
        can_filter_write(m, offset, value);
    } else if (offset >= 0x180 && offset < 0x1B0) {
        write_mailbox(m, (int)(offset - 0x180) / 16, offset & 15u, value);
    } else if (offset == 0x00) {
        write_mcr(m, value);
    } else if (offset == 0x04) {
        c->msr &= ~(value & (ERRI | WKUI | SLAKI));
    } else if (offset == 0x08) {
        write_tsr(m, value);
    } else if (offset == 0x0C || offset == 0x10) {
        int n = offset == 0x10;
        c->rfr[n] &= ~(value & (FULL | FOVR));
        if (value & RFOM) {
            release(c, n);
        }
    } else if (offset == 0x14) {
        c->ier = value & 0x38F7Fu;
    } else if (offset == 0x18) {
        c->esr = (c->esr & ~0x70u) | (value & 0x70u);
    } else if (offset == 0x1C) {
        if (!(c->msr & INAK)) {
            note(m, "CAN1: BTR written outside initialisation mode");
        } else {
            c->btr = value & 0xC37F03FFu;
        }
        if (value >> 30) {
            unmodelled(m, "CAN1: loop-back and silent mode are not modelled");
        }
    }
    bxcan_update(m);
    can_bus_arbitrate(m, m->now);
}

uint32_t bxcan_read(machine_t *m, uint32_t offset) {
    const bxcan_t *c = &m->can;
    if (offset >= 0x180 && offset < 0x1D0) {
        uint32_t index = (offset - 0x180) / 16;
        const mailbox_t *box = index < 3 ? &c->tx[index] : &c->fifo[index - 3][0];
        const uint32_t words[4] = {box->tir, box->tdtr, box->tdlr, box->tdhr};
        return words[offset >> 2 & 3u];
    }
    switch (offset) {
    case 0x00:
        return c->mcr;
    case 0x04:
        return c->msr | 0xC00u; /* RX recessive */
    case 0x08:
        return c->tsr;
    case 0x0C:
    case 0x10:
        return c->rfr[offset == 0x10];
    case 0x14:
        return c->ier;
    case 0x18:
        return c->esr;
    case 0x1C:
        return c->btr;
    default:
        return can_filter_read(c, offset);
    }
}

void bxcan_reset(machine_t *m) {
    memset(&m->can, 0, sizeof m->can);
    m->can.mcr = 0x00010002u;
    m->can.msr = SLAK;
    m->can.tsr = 0x1C000000u;
    m->can.btr = 0x01230000u;
    m->can.fmr = 0x2A1C0E01u;
    m->can.synchronised_at = NEVER;
    m->can.recovered_at = NEVER;
    bxcan_update(m);
}
