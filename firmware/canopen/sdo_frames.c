/* sdo_frames.c: see sdo_frames.h. */
#include "sdo_frames.h"

#define ABORTED 0x80

void sdo_send(uint8_t node_id, const uint8_t data[8], frame_queue_t *tx) {
    can_frame_t frame = {.cob_id = (uint16_t)(SDO_TX_COB_ID + node_id), .length = 8};
    for (uint32_t i = 0; i < 8; i++) {
        frame.data[i] = data[i];
    }
    frame_queue_push(tx, &frame);
}

void sdo_send_addressed(const sdo_t *sdo, uint8_t command, uint32_t value, uint8_t node_id,
                        frame_queue_t *tx) {
    uint8_t data[8] = {command, (uint8_t)sdo->index, (uint8_t)(sdo->index >> 8), sdo->sub};
    od_encode(value, &data[4], 4);
    sdo_send(node_id, data, tx);
}

void sdo_abort(sdo_t *sdo, od_abort_t code, uint8_t node_id, frame_queue_t *tx) {
    sdo->transfer = SDO_IDLE;
    sdo_send_addressed(sdo, ABORTED, code, node_id, tx);
}

void sdo_begin(sdo_t *sdo, const can_frame_t *frame) {
    sdo->transfer = SDO_IDLE;
    sdo->index = (uint16_t)(frame->data[1] | frame->data[2] << 8);
    sdo->sub = frame->data[3];
    sdo->toggle = false;
    sdo->size_given = false;
    sdo->size = 0;
    sdo->done = 0;
}

uint32_t sdo_announced_size(const can_frame_t *frame) {
    uint32_t size = 0;
    for (uint32_t i = 0; i < 4; i++) {
        size |= (uint32_t)frame->data[4 + i] << (8 * i);
    }
    return size;
}
