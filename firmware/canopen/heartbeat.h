/* heartbeat.h: sends the node's heartbeat (0x1017) and watches the host's (0x1016).
 *
 * The host is watched from the configuration on, not only from its first heartbeat (CiA 301,
 * 7.2.8.3.2.2): a host that never sends any must not count as present. Its boot-up message
 * is no heartbeat. Times in microseconds; they may wrap.
 */
#ifndef BOWDEN_CANOPEN_HEARTBEAT_H
#define BOWDEN_CANOPEN_HEARTBEAT_H

#include "frame_queue.h"
#include "od.h"

#define HEARTBEAT_COB_ID 0x700

typedef struct {
    uint32_t period_us; /* 0: none is sent */
    uint32_t sent_us;
    uint32_t timeout_us; /* 0: none is watched */
    uint32_t heard_us;
    uint8_t watched_node_id;
    bool lost;
    bool restarted; /* its boot-up message has come since the last heartbeat_tick() */
} heartbeat_t;

/* Takes the parameters from the dictionary and starts both timers anew. */
void heartbeat_configure(heartbeat_t *heartbeat, const od_t *od, uint32_t now_us);

/* Notes the watched node's heartbeat; true for one. Other frames do nothing. */
bool heartbeat_receive(heartbeat_t *heartbeat, const can_frame_t *frame, uint32_t now_us);

/* Sends a heartbeat with `state` when it is due and checks the host's. */
void heartbeat_tick(heartbeat_t *heartbeat, uint8_t node_id, uint8_t state, uint32_t now_us,
                    frame_queue_t *tx);

/* One heartbeat as a frame. */
can_frame_t heartbeat_frame(uint8_t node_id, uint8_t state);

/* Queues one heartbeat; with state NMT_INITIALISING it is the boot-up message. */
void heartbeat_send(uint8_t node_id, uint8_t state, frame_queue_t *tx);

#endif
