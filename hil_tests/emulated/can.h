/* can.h: state and functions of the CAN controller (bxcan.c, can_filter.c) and the wire. */
#ifndef EMULATED_CAN_H
#define EMULATED_CAN_H

#include "api.h"
#include "ticks.h"

typedef struct {
    uint32_t tir, tdtr, tdlr, tdhr;
} mailbox_t;
typedef struct {
    uint32_t mcr, msr, tsr, rfr[2], ier, esr, btr, fmr, fm1r, fs1r, ffa1r, fa1r, filter[28][2];
    mailbox_t tx[3], fifo[2][3];
    uint32_t order[3]; /* request order of the mailboxes, for TXFP */
    uint32_t orders;
    int tec, rec;
    tick_t synchronised_at; /* leaves initialisation then */
    tick_t recovered_at;    /* leaves bus-off then */
} bxcan_t;
uint32_t bxcan_read(machine_t *m, uint32_t offset);
void bxcan_write(machine_t *m, uint32_t offset, uint32_t value);
void bxcan_reset(machine_t *m);
int can_filter_find(const bxcan_t *c, const wire_frame_t *f, int *fifo); /* -1: refused */
uint32_t can_filter_word(const wire_frame_t *f);                         /* as RIxR holds it */
void can_filter_write(machine_t *m, uint32_t offset, uint32_t value);
uint32_t can_filter_read(const bxcan_t *c, uint32_t offset);
void bxcan_update(machine_t *m);
bool bxcan_on_bus(machine_t *m);
int bxcan_best_mailbox(const machine_t *m); /* -1: none */
uint32_t bxcan_bitrate(const machine_t *m);
void bxcan_sent(machine_t *m, int mailbox, bool ok, bool arbitration_lost);
void bxcan_received(machine_t *m, const wire_frame_t *frame);
void bxcan_tx_error(machine_t *m, int mailbox, int code, bool counts);
void bxcan_rx_error(machine_t *m, int code);
wire_frame_t mailbox_frame(const mailbox_t *box);

#define WIRE_QUEUE 256 /* a power of two */
typedef struct {
    wire_frame_t to_node[WIRE_QUEUE], from_node[1024];
    uint32_t to_head, to_tail, from_head, from_tail;
    int fault;
    bool babbling;
    wire_frame_t babble;
    uint32_t babble_idle_bits;
    tick_t babble_ready;
    bool busy; /* a frame is on the wire until EVENT_CAN */
    tick_t frame_end;
    tick_t idle_since; /* the bus may be claimed from here on */
    int sender;        /* mailbox 0..2, or below */
    wire_frame_t frame;
    bool fails;
} can_bus_t;
enum { SENDER_HOST = 3, SENDER_BABBLER };
void can_bus_event(machine_t *m, tick_t at);
void can_bus_arbitrate(machine_t *m, tick_t at);
void can_bus_drop_node(machine_t *m); /* the node left the bus in mid-frame (reset) */
tick_t can_bit_ticks(const machine_t *m);

#endif
