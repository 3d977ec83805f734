/* can_bus.c: the wire: one frame at a time, arbitration, frame time, acknowledge, faults.
 *
 * On the bus are the emulated node, a host (the bench's frames, in their order) and, when asked
 * for, a babbling node. A frame occupies the bus for its exact length including stuff bits; at
 * idle the lowest identifier starts. Unless a fault says otherwise every frame is acknowledged.
 */
#include "board.h"

enum { LEC_STUFF = 1, LEC_FORM, LEC_ACK, LEC_BIT_RECESSIVE, LEC_BIT_DOMINANT, LEC_CRC };
enum { ERROR_FRAME_BITS = 14, INTERFRAME_BITS = 3, SUSPEND_BITS = 8 };

tick_t can_bit_ticks(const machine_t *m) {
    return TICKS_PER_SECOND / m->options.can_bitrate;
}

typedef struct {
    uint32_t crc, bits, run, last;
} stream_t;

static void put(stream_t *s, uint32_t bit, bool in_crc) {
    if (in_crc) {
        uint32_t feedback = (s->crc >> 14 & 1u) ^ bit;
        s->crc = (s->crc << 1 & 0x7FFFu) ^ (feedback ? 0x4599u : 0u);
    }
    s->run = bit == s->last ? s->run + 1 : 1;
    s->last = bit;
    s->bits++;
    if (s->run == 5) { /* a stuff bit of the other level follows */
        s->bits++;
        s->last = bit ^ 1u;
        s->run = 1;
    }
}

static void put_field(stream_t *s, uint32_t value, int width, bool in_crc) {
    for (int i = width - 1; i >= 0; i--) {
        put(s, value >> i & 1u, in_crc);
    }
}

/* From start of frame to end of frame, without the interframe space (CAN 2.0 part B, 3.1). */
static uint32_t frame_bits(const wire_frame_t *f) {
    stream_t s = {.last = 1};
    put(&s, 0, true);
    if (f->extended) {
        put_field(&s, f->id >> 18, 11, true);
        put_field(&s, 3, 2, true); /* SRR, IDE */
        put_field(&s, f->id & 0x3FFFFu, 18, true);
        put_field(&s, (uint32_t)f->remote << 2, 3, true); /* RTR, r1, r0 */
    } else {
        put_field(&s, f->id, 11, true);
        put_field(&s, (uint32_t)f->remote << 2, 3, true); /* RTR, IDE, r0 */
    }
    put_field(&s, f->length, 4, true);
    for (int i = 0; i < f->length && !f->remote; i++) {
        put_field(&s, f->data[i], 8, true);
    }
    put_field(&s, s.crc, 15, false);
    return s.bits + 1 + 2 + 7; /* CRC delimiter, acknowledge, end of frame */
}

/* The node's bit rate must be within half a percent of the bus's to be understood. */
static bool node_in_time(const machine_t *m) {
    double ratio = (double)bxcan_bitrate(m) / (double)m->options.can_bitrate;
    return ratio > 0.995 && ratio < 1.005;
}

static uint32_t key(const wire_frame_t *f) {
    return f->extended ? (f->id >> 18) << 21 | 3u << 19 | (f->id & 0x3FFFFu) << 1 | f->remote
                       : f->id << 21 | (uint32_t)f->remote << 20;
}

static bool pick(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    bool found = false;
    if (b->to_head != b->to_tail) {
        b->frame = b->to_node[b->to_tail % WIRE_QUEUE];
        b->sender = SENDER_HOST;
        found = true;
    }
    if (b->babbling && at >= b->babble_ready && (!found || key(&b->babble) < key(&b->frame))) {
        b->frame = b->babble;
        b->sender = SENDER_BABBLER;
        found = true;
    }
    int box = bxcan_on_bus(m) ? bxcan_best_mailbox(m) : -1;
    if (box >= 0) {
        wire_frame_t frame = mailbox_frame(&m->can.tx[box]);
        if (!found || key(&frame) < key(&b->frame)) {
            b->frame = frame;
            b->sender = box;
            found = true;
        } else if (m->can.mcr & 1u << 4) { /* NART: losing arbitration ends the request */
            bxcan_sent(m, box, false, true);
        }
    }
    return found;
}

/* Next moment at which anything here changes by itself. */
static void plan(machine_t *m) {
    const can_bus_t *b = &m->can_bus;
    tick_t at = NEVER;
    if (b->busy) {
        at = b->frame_end;
    } else if (b->idle_since > m->now) {
        at = b->idle_since;
    } else if (b->babbling) {
        at = b->babble_ready;
    }
    at = m->can.synchronised_at < at ? m->can.synchronised_at : at;
    at = m->can.recovered_at < at ? m->can.recovered_at : at;
    schedule(m, EVENT_CAN, at);
}

static void start_frame(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    bool from_node = b->sender < SENDER_HOST;
    uint32_t bits = frame_bits(&b->frame);
    b->fails = false;
    if (from_node) {
        bool destroyed = b->fault == FAULT_CAN_CORRUPT_TX || !node_in_time(m);
        b->fails = destroyed || b->fault == FAULT_CAN_NO_ACK;
        bits = destroyed ? 20 + ERROR_FRAME_BITS : b->fails ? bits - 8 + ERROR_FRAME_BITS : bits;
    }
    b->busy = true;
    b->frame_end = at + bits * can_bit_ticks(m);
}

void can_bus_arbitrate(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    if (b->fault == FAULT_CAN_DOMINANT) {
        return;
    }
    if (!b->busy && at >= b->idle_since && pick(m, at)) {
        start_frame(m, at);
    }
    plan(m);
}

static void to_bench(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    if (b->from_head - b->from_tail == 1024) {
        b->from_tail++;
        note(m, "bench: more than 1024 frames of the node were not fetched, the oldest are lost");
    }
    b->frame.time_ns = ticks_to_ns(at);
    b->from_node[b->from_head++ % 1024] = b->frame;
}

static void end_of_node_frame(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    uint32_t gap = INTERFRAME_BITS;
    bool passive = m->can.esr & 2u;
    if (!b->fails) {
        to_bench(m, at);
        bxcan_sent(m, b->sender, true, false);
    } else if (b->fault == FAULT_CAN_NO_ACK && node_in_time(m)) {
        bxcan_tx_error(m, b->sender, LEC_ACK, !passive);
    } else {
        bxcan_tx_error(m, b->sender, LEC_BIT_DOMINANT, true);
    }
    gap += m->can.esr & 2u ? SUSPEND_BITS : 0u; /* error passive */
    b->idle_since = at + gap * can_bit_ticks(m);
}

static void end_of_other_frame(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    b->idle_since = at + INTERFRAME_BITS * can_bit_ticks(m);
    if (b->sender == SENDER_HOST) {
        b->to_tail++;
    } else {
        b->babble_ready = b->idle_since + b->babble_idle_bits * can_bit_ticks(m);
    }
    if (!bxcan_on_bus(m)) {
        return;
    }
    if (!node_in_time(m)) {
        bxcan_rx_error(m, LEC_FORM);
    } else if (b->fault == FAULT_CAN_CORRUPT_RX) {
        bxcan_rx_error(m, LEC_CRC);
        b->idle_since += ERROR_FRAME_BITS * can_bit_ticks(m);
    } else {
        bxcan_received(m, &b->frame);
    }
}

/* A bus held dominant: each 8 bits count as an error, for a sender until it is off the bus. */
static void dominant_bits(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    if (bxcan_on_bus(m)) {
        if (b->sender < SENDER_HOST || bxcan_best_mailbox(m) >= 0) {
            bxcan_tx_error(m, -1, LEC_BIT_RECESSIVE, true);
        } else {
            bxcan_rx_error(m, LEC_FORM);
        }
    }
    b->idle_since = at + 8 * can_bit_ticks(m);
    m->can.recovered_at = m->can.recovered_at != NEVER ? at + 1408 * can_bit_ticks(m) : NEVER;
    schedule(m, EVENT_CAN, b->idle_since);
}

static void node_timers(machine_t *m, tick_t at) {
    if (m->can.synchronised_at <= at) {
        m->can.synchronised_at = NEVER;
        m->can.msr &= ~3u; /* INAK, SLAK */
    }
    if (m->can.recovered_at <= at) {
        m->can.recovered_at = NEVER;
        m->can.tec = 0;
        m->can.rec = 0;
        m->can.esr &= 0x70u; /* on the bus again, counters 0 */
    }
    bxcan_update(m);
}

void can_bus_event(machine_t *m, tick_t at) {
    can_bus_t *b = &m->can_bus;
    if (b->fault == FAULT_CAN_DOMINANT) {
        if (m->can.synchronised_at <= at) {
            m->can.synchronised_at = at + 11 * can_bit_ticks(m); /* no recessive bit to count */
        }
        dominant_bits(m, at);
        return;
    }
    node_timers(m, at);
    if (b->busy && at >= b->frame_end) {
        b->busy = false;
        if (b->sender < SENDER_HOST) {
            end_of_node_frame(m, at);
        } else {
            end_of_other_frame(m, at);
        }
    }
    can_bus_arbitrate(m, at);
}

/* The node vanishes in mid-frame; the others see an error frame. */
void can_bus_drop_node(machine_t *m) {
    can_bus_t *b = &m->can_bus;
    if (b->busy && b->sender < SENDER_HOST) {
        b->busy = false;
        b->idle_since = m->now + (ERROR_FRAME_BITS + INTERFRAME_BITS) * can_bit_ticks(m);
        schedule(m, EVENT_CAN, b->idle_since);
    }
}

bool machine_can_send(machine_t *m, const wire_frame_t *frame) {
    can_bus_t *b = &m->can_bus;
    if (b->to_head - b->to_tail == WIRE_QUEUE) {
        return false;
    }
    b->to_node[b->to_head++ % WIRE_QUEUE] = *frame;
    can_bus_arbitrate(m, m->now);
    return true;
}

bool machine_can_receive(machine_t *m, wire_frame_t *frame) {
    can_bus_t *b = &m->can_bus;
    if (b->from_head == b->from_tail) {
        return false;
    }
    *frame = b->from_node[b->from_tail++ % 1024];
    return true;
}

void machine_can_fault(machine_t *m, int fault) {
    can_bus_t *b = &m->can_bus;
    b->fault = fault;
    if (fault == FAULT_CAN_DOMINANT) {
        b->sender = b->busy ? b->sender : SENDER_HOST;
        b->busy = false;
        schedule(m, EVENT_CAN, m->now + 8 * can_bit_ticks(m));
    } else {
        can_bus_arbitrate(m, m->now);
    }
}

void machine_can_babble(machine_t *m, const wire_frame_t *frame, uint32_t idle_bits) {
    can_bus_t *b = &m->can_bus;
    b->babbling = frame != NULL;
    if (frame != NULL) {
        b->babble = *frame;
        b->babble_idle_bits = idle_bits;
        b->babble_ready = m->now;
    }
    can_bus_arbitrate(m, m->now);
}
