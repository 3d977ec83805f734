/* nmt.c: see nmt.h. */
#include "nmt.h"

/* Command specifiers. */
enum {
    START = 0x01,
    STOP = 0x02,
    ENTER_PRE_OPERATIONAL = 0x80,
    RESET_NODE = 0x81,
    RESET_COMMUNICATION = 0x82,
};

static nmt_request_t enter(nmt_t *nmt, uint8_t state) {
    const bool changed = nmt->state != state;
    nmt->state = state;
    return changed ? NMT_CHANGED : NMT_NOTHING;
}

nmt_request_t nmt_receive(nmt_t *nmt, const can_frame_t *frame, uint8_t node_id) {
    if (frame->length != 2 || (frame->data[1] != 0 && frame->data[1] != node_id)) {
        return NMT_NOTHING;
    }
    switch (frame->data[0]) {
    case START:
        return enter(nmt, NMT_OPERATIONAL);
    case STOP:
        return enter(nmt, NMT_STOPPED);
    case ENTER_PRE_OPERATIONAL:
        return enter(nmt, NMT_PRE_OPERATIONAL);
    case RESET_NODE:
        nmt->state = NMT_INITIALISING;
        return NMT_RESET_NODE;
    case RESET_COMMUNICATION:
        nmt->state = NMT_PRE_OPERATIONAL;
        return NMT_RESET_COMMUNICATION;
    default:
        return NMT_NOTHING;
    }
}
