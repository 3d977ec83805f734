/* lss.c: see lss.h. */
#include "lss.h"

#define IDENTITY_INDEX 0x1018u
#define NUMBERS 4u /* of an identity: vendor, product, revision, serial number */

/* Command specifiers. Those of several numbers are consecutive. */
enum {
    SWITCH_GLOBAL = 0x04,
    CONFIGURE_NODE_ID = 0x11,
    CONFIGURE_BIT_TIMING = 0x13,
    STORE = 0x17,
    SWITCH_SELECTIVE = 0x40, /* .. 0x43 */
    SELECTED = 0x44,
    IDENTIFIED = 0x4F,
    FASTSCAN = 0x51,
    INQUIRE = 0x5A, /* .. 0x5D */
    INQUIRE_NODE_ID = 0x5E,
};

#define FASTSCAN_BEGINS 0x80u
#define STANDARD_TABLE 0u

/* CiA 305 table 1, kbit/s. Which of them the node has the dictionary says. */
static const uint16_t BIT_RATES[] = {1000, 800, 500, 250, 125, 0, 50, 20, 10};

static uint32_t identity(const od_t *od, uint8_t number) {
    return od_value(od, IDENTITY_INDEX, (uint8_t)(number + 1u));
}

static uint32_t number_in(const can_frame_t *frame) {
    return (uint32_t)frame->data[1] | (uint32_t)frame->data[2] << 8 |
           (uint32_t)frame->data[3] << 16 | (uint32_t)frame->data[4] << 24;
}

/* Every frame of the services has eight bytes. */
static can_frame_t reply(uint8_t command, uint32_t number) {
    can_frame_t frame = {.cob_id = LSS_TX_COB_ID, .length = 8, .data = {command}};
    od_encode(number, &frame.data[1], 4);
    return frame;
}

static uint8_t write(od_t *od, uint16_t index, uint32_t value, uint32_t size) {
    uint8_t bytes[4];
    od_encode(value, bytes, size);
    switch (od_write(od, index, 0, bytes, size)) {
    case OD_DONE:
        return LSS_FINE;
    case OD_ABORT_STATE:
        return LSS_REFUSED;
    default:
        return LSS_NOT_SUPPORTED;
    }
}

static uint8_t configure_bit_timing(od_t *od, uint8_t table, uint8_t place) {
    const bool known = table == STANDARD_TABLE && place < sizeof BIT_RATES / sizeof BIT_RATES[0];
    return known ? write(od, LSS_BIT_RATE_INDEX, BIT_RATES[place], 2) : (uint8_t)LSS_NOT_SUPPORTED;
}

/* The numbers come in order, one a frame; a wrong one begins anew. */
static bool select(lss_t *lss, const od_t *od, const can_frame_t *frame) {
    const uint8_t number = (uint8_t)(frame->data[0] - SWITCH_SELECTIVE);
    const bool in_order = number == 0 || number == lss->selected;
    const bool matches = in_order && number_in(frame) == identity(od, number);
    lss->selected = matches ? (uint8_t)(number + 1u) : 0u;
    if (lss->selected == NUMBERS) {
        lss->selected = 0;
        lss->configuring = true;
        return true;
    }
    return false;
}

/* Does what the host knows so far fit? After the last bit of the last number the node is found. */
static bool fastscan(lss_t *lss, const od_t *od, const can_frame_t *frame) {
    const uint8_t bit = frame->data[5], number = frame->data[6], next = frame->data[7];
    if (!lss->disputed) {
        return false;
    }
    if (bit == FASTSCAN_BEGINS) {
        lss->scanned = 0;
        return true;
    }
    if (bit > 31 || number >= NUMBERS || next >= NUMBERS || number != lss->scanned ||
        (identity(od, number) ^ number_in(frame)) >> bit != 0) {
        return false;
    }
    if (bit == 0) {
        lss->scanned = next;
        lss->configuring = next < number;
    }
    return true;
}

static lss_event_t receive_waiting(lss_t *lss, const od_t *od, const can_frame_t *frame,
                                   can_frame_t *answer) {
    const uint8_t command = frame->data[0];
    if (command >= SWITCH_SELECTIVE && command < SWITCH_SELECTIVE + NUMBERS) {
        *answer = reply(SELECTED, 0);
        return select(lss, od, frame) ? LSS_ANSWER : LSS_NOTHING;
    }
    *answer = reply(IDENTIFIED, 0);
    return command == FASTSCAN && fastscan(lss, od, frame) ? LSS_ANSWER : LSS_NOTHING;
}

static lss_event_t receive_configuring(lss_t *lss, od_t *od, const can_frame_t *frame,
                                       can_frame_t *answer) {
    const uint8_t command = frame->data[0];
    switch (command) {
    case CONFIGURE_NODE_ID:
        *answer = reply(command, write(od, LSS_NODE_ID_INDEX, frame->data[1], 1));
        return LSS_ANSWER;
    case CONFIGURE_BIT_TIMING:
        *answer = reply(command, configure_bit_timing(od, frame->data[1], frame->data[2]));
        return LSS_ANSWER;
    case STORE:
        if (od->config_locked || lss->storing) {
            *answer = reply(command, LSS_REFUSED);
            return LSS_ANSWER;
        }
        lss->storing = true;
        return LSS_STORE;
    case INQUIRE_NODE_ID:
        *answer = reply(command, od->node_id);
        return LSS_ANSWER;
    default:
        if (command < INQUIRE || command >= INQUIRE + NUMBERS) {
            return LSS_NOTHING;
        }
        *answer = reply(command, identity(od, (uint8_t)(command - INQUIRE)));
        return LSS_ANSWER;
    }
}

lss_event_t lss_receive(lss_t *lss, od_t *od, const can_frame_t *frame, can_frame_t *answer) {
    if (frame->length != 8) {
        return LSS_NOTHING;
    }
    if (frame->data[0] == SWITCH_GLOBAL) {
        lss->configuring = frame->data[1] == 1;
        lss->selected = 0;
        return LSS_NOTHING;
    }
    return lss->configuring ? receive_configuring(lss, od, frame, answer)
                            : receive_waiting(lss, od, frame, answer);
}

can_frame_t lss_stored(lss_t *lss, uint8_t error) {
    lss->storing = false;
    return reply(STORE, error);
}
