/* heartbeat.c: see heartbeat.h. */
#include "heartbeat.h"

#define US_PER_MS UINT32_C(1000)
#define BOOT_UP 0

void heartbeat_configure(heartbeat_t *heartbeat, const od_t *od, uint32_t now_us) {
    const uint32_t consumer = od_value(od, 0x1016, 1); /* node id << 16 | milliseconds */
    const uint8_t watched = (uint8_t)(consumer >> 16 & 0x7F);
    *heartbeat = (heartbeat_t){
        .period_us = od_value(od, 0x1017, 0) * US_PER_MS,
        .sent_us = now_us,
        .timeout_us = watched != 0 ? (consumer & 0xFFFF) * US_PER_MS : 0,
        .heard_us = now_us,
        .watched_node_id = watched,
    };
}

bool heartbeat_receive(heartbeat_t *heartbeat, const can_frame_t *frame, uint32_t now_us) {
    if (heartbeat->timeout_us == 0 || frame->length != 1 ||
        frame->cob_id != HEARTBEAT_COB_ID + heartbeat->watched_node_id) {
        return false;
    }
    if (frame->data[0] == BOOT_UP) {
        heartbeat->restarted = true;
        return false;
    }
    heartbeat->heard_us = now_us;
    heartbeat->lost = false;
    return true;
}

void heartbeat_tick(heartbeat_t *heartbeat, uint8_t node_id, uint8_t state, uint32_t now_us,
                    frame_queue_t *tx) {
    /* Only hearing it again takes `lost` back: the wrap of the clock must not. */
    if (heartbeat->timeout_us != 0 && now_us - heartbeat->heard_us > heartbeat->timeout_us) {
        heartbeat->lost = true;
    }
    heartbeat->restarted = false;
    if (heartbeat->period_us != 0 && now_us - heartbeat->sent_us >= heartbeat->period_us) {
        heartbeat->sent_us = now_us;
        heartbeat_send(node_id, state, tx);
    }
}

can_frame_t heartbeat_frame(uint8_t node_id, uint8_t state) {
    return (can_frame_t){
        .cob_id = (uint16_t)(HEARTBEAT_COB_ID + node_id), .length = 1, .data = {state}};
}

void heartbeat_send(uint8_t node_id, uint8_t state, frame_queue_t *tx) {
    const can_frame_t frame = heartbeat_frame(node_id, state);
    frame_queue_push(tx, &frame);
}
