/* can.c: see can.h. RM0090 chapter 32. */
#include "can.h"

#include "handlers.h"
#include "registers.h"

/* 42 MHz / 3 / (1 + 11 + 2) = 1 Mbit/s, sampled at 86 % (CiA 301 asks for 88 %); slower rates by
 * the prescaler alone. */
#define BIT_TIMING (CAN_BTR_TS1(11u) | CAN_BTR_TS2(2u) | CAN_BTR_SJW(2u))
#define PRESCALER_KBIT 3000u

/* Entering and leaving initialisation takes at most 11 recessive bits: 11 us, 1900 core cycles. On
 * a bus that is stuck dominant this never completes: then the bit in MSR comes later by itself. */
#define WAIT_TURNS 20000u

/* Between two attempts to come back from bus-off: 100 ms. */
#define RECOVERY_TICKS (100000u / BOARD_CONTROL_PERIOD_US)

/* Error-passive is reported when it lasts: 10 ms. On the way to bus-off it is over in 3 ms. */
#define PASSIVE_TICKS (10000u / BOARD_CONTROL_PERIOD_US)

enum { BANK_FIXED, BANK_RPDO, BANK_HEARTBEAT };

#define NMT_COB_ID 0x000u
#define SYNC_COB_ID 0x080u
#define SDO_COB_ID 0x600u
#define HEARTBEAT_COB_ID 0x700u
#define HEARTBEAT_MASK 0x780u
#define LSS_COB_ID 0x7E5u

#define RING 32u /* frames; a power of two. 250 us of the shortest frames are six */

static struct {
    can_frame_t frames[RING];
    volatile uint32_t written, taken; /* counted on; one writer each */
} ring;

static volatile bool rx_overrun;
static uint16_t listened[CAN_RPDOS];
static uint32_t since_recovery, passive; /* ticks */
static uint8_t own_node_id;
static uint32_t prescaler;
static bool configured;
static bool lost;
static uint32_t unsent; /* ticks since a frame waits and none has left */

/* So long may the frames in the mailboxes wait: 10 ms. Then no node acknowledges them. */
#define UNSENT_TICKS (10000u / BOARD_CONTROL_PERIOD_US)

static bool wait_for_initialisation(bool on) {
    const uint32_t wanted = on ? CAN_MSR_INAK : 0u;
    for (uint32_t turn = 0; turn < WAIT_TURNS; turn++) {
        if ((CAN1->MSR & CAN_MSR_INAK) == wanted) {
            return true;
        }
    }
    return false;
}

/* Half of a filter register in 16-bit scale: identifier, RTR, IDE, EXID (RM0090 32.7.4). RTR and
 * IDE are compared, too: remote and extended frames are refused. */
static uint32_t filter16(uint32_t identifier) {
    return identifier << 5;
}
#define FILTER16_KIND 0x18u

static void start_filters(uint8_t node_id) {
    CAN1->FMR = CAN_FMR_RESET | CAN_FMR_FINIT;
    CAN1->FM1R = 1u << BANK_FIXED | 1u << BANK_RPDO; /* lists of four; the other is a mask */
    CAN1->FS1R = 0;                                  /* 16-bit scale */
    CAN1->FFA1R = 0;                                 /* everything into FIFO 0 */
    CAN1->FILTER[BANK_FIXED][0] = filter16(NMT_COB_ID) | filter16(SYNC_COB_ID) << 16;
    CAN1->FILTER[BANK_FIXED][1] = filter16(SDO_COB_ID + node_id) | filter16(LSS_COB_ID) << 16;
    const uint32_t heartbeat =
        filter16(HEARTBEAT_COB_ID) | (filter16(HEARTBEAT_MASK) | FILTER16_KIND) << 16;
    CAN1->FILTER[BANK_HEARTBEAT][0] = heartbeat;
    CAN1->FILTER[BANK_HEARTBEAT][1] = heartbeat;
    CAN1->FA1R = 1u << BANK_FIXED | 1u << BANK_HEARTBEAT;
    CAN1->FMR = CAN_FMR_RESET;
}

/* In initialisation: from here on the controller may take part. */
static void configure(void) {
    CAN1->BTR = BIT_TIMING | CAN_BTR_BRP(prescaler);
    start_filters(own_node_id);
    CAN1->IER = CAN_IER_FMPIE0;
    configured = true;
    CAN1->MCR &= ~CAN_MCR_INRQ;
}

void can_start(uint8_t node_id, uint16_t bit_rate_kbit) {
    own_node_id = node_id;
    prescaler = PRESCALER_KBIT / bit_rate_kbit;
    RCC->APB1ENR |= RCC_APB1ENR_CAN1EN;
    core_barrier();
    CAN1->MCR = CAN_MCR_INRQ | CAN_MCR_TXFP | CAN_MCR_DBF; /* awake, first come first sent */
    if (wait_for_initialisation(true)) {
        configure();
        (void)wait_for_initialisation(false); /* can_tick() reports when it does not come */
    }
}

void can_listen(const uint16_t cob_ids[CAN_RPDOS]) {
    bool changed = false;
    for (uint32_t i = 0; i < CAN_RPDOS; i++) {
        changed |= cob_ids[i] != listened[i];
        listened[i] = cob_ids[i];
    }
    if (!changed) {
        return;
    }
    CAN1->FA1R &= ~(1u << BANK_RPDO); /* may only be changed while inactive */
    for (uint32_t i = 0; i < 2; i++) {
        CAN1->FILTER[BANK_RPDO][i] = filter16(listened[2 * i]) | filter16(listened[2 * i + 1])
                                                                     << 16;
    }
    CAN1->FA1R |= 1u << BANK_RPDO;
}

/* The word with its first `count` bytes, the rest 0. */
static uint32_t first_bytes(uint32_t word, uint32_t count) {
    return count < 4u ? word & ((1u << 8u * count) - 1u) : word;
}

void can_rx0_handler(void) {
    if ((CAN1->RF0R & CAN_RF0R_FOVR0) != 0) {
        CAN1->RF0R = CAN_RF0R_FOVR0;
        rx_overrun = true;
    }
    if ((CAN1->RF0R & CAN_RF0R_FMP0) == 0) {
        return;
    }
    const uint32_t written = ring.written;
    if (written - ring.taken == RING) {
        rx_overrun = true;
    } else {
        can_frame_t *frame = &ring.frames[written % RING];
        const uint32_t length = CAN1->FIFO[0].RDTR & CAN_DTR_DLC;
        const uint32_t words[2] = {first_bytes(CAN1->FIFO[0].RDLR, length),
                                   first_bytes(CAN1->FIFO[0].RDHR, length < 4u ? 0 : length - 4u)};
        frame->cob_id = (uint16_t)CAN_RIR_STID(CAN1->FIFO[0].RIR);
        frame->length = (uint8_t)(length <= 8u ? length : 8u);
        __builtin_memcpy(frame->data, words, sizeof words); /* two stores; little-endian */
        ring.written = written + 1u;
    }
    CAN1->RF0R = CAN_RF0R_RFOM0;
}

bool can_take(can_frame_t *frame) {
    const uint32_t taken = ring.taken;
    if (taken == ring.written) {
        return false;
    }
    *frame = ring.frames[taken % RING];
    ring.taken = taken + 1u;
    return true;
}

bool can_ready(void) {
    return (CAN1->TSR & CAN_TSR_TME) != 0;
}

bool can_is_idle(void) {
    return (CAN1->TSR & CAN_TSR_TME) == CAN_TSR_TME;
}

/* Takes what the controller still holds, too. */
void can_forget_overrun(void) {
    CAN1->RF0R = CAN_RF0R_FOVR0;
    rx_overrun = false;
}

void can_send(const can_frame_t *frame) {
    volatile can_mailbox_registers_t *box = &CAN1->MAILBOX[CAN_TSR_CODE(CAN1->TSR)];
    uint32_t words[2] = {0, 0};
    for (uint32_t i = 0; i < frame->length; i++) {
        words[i / 4u] |= (uint32_t)frame->data[i] << (8u * (i % 4u));
    }
    box->TDTR = frame->length;
    box->TDLR = words[0];
    box->TDHR = words[1];
    box->TIR = CAN_IR_STID(frame->cob_id) | CAN_TIR_TXRQ;
}

/* Bus-off ends 128 times 11 recessive bits after initialisation was entered and left (32.7.6). */
static void recover(void) {
    if ((CAN1->MSR & CAN_MSR_INAK) != 0 && !configured) {
        configure();
    } else if ((CAN1->MSR & CAN_MSR_INAK) != 0) {
        CAN1->MCR &= ~CAN_MCR_INRQ;
    } else if (since_recovery >= RECOVERY_TICKS) {
        since_recovery = 0;
        CAN1->MCR |= CAN_MCR_INRQ;
    }
}

board_bus_t can_bus(bool off) {
    const uint32_t status = CAN1->TSR;
    const bool waiting = (status & CAN_TSR_TME) != CAN_TSR_TME;
    const bool sent = (status & CAN_TSR_TXOK) != 0;
    CAN1->TSR = status & CAN_TSR_RQCP;
    unsent = waiting && !sent ? unsent + 1u : 0u;
    const bool falls_silent = off && !lost;
    lost = off || (lost && !sent);
    if (falls_silent || unsent >= UNSENT_TICKS) {
        lost = true;
        unsent = 0;
        CAN1->TSR = CAN_TSR_ABRQ;
        return BOARD_BUS_DROPPED;
    }
    return lost ? BOARD_BUS_LOST : BOARD_BUS_FINE;
}

uint32_t can_tick(void) {
    const uint32_t esr = CAN1->ESR;
    uint32_t faults = 0;
    if (since_recovery < RECOVERY_TICKS) {
        since_recovery++;
    }
    if ((esr & CAN_ESR_BOFF) != 0 || (CAN1->MSR & CAN_MSR_INAK) != 0) {
        faults |= BOARD_FAULT_CAN_BUS_OFF;
        recover();
        passive = 0;
    } else if ((esr & CAN_ESR_EPVF) == 0) {
        passive = 0;
    } else if (passive < PASSIVE_TICKS) {
        passive++;
    } else {
        faults |= BOARD_FAULT_CAN_PASSIVE;
    }
    if (rx_overrun) {
        rx_overrun = false;
        faults |= BOARD_FAULT_RX_OVERRUN;
    }
    return faults;
}
