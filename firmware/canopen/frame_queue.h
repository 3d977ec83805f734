/* frame_queue.h: the bounded queue between the node and the board's CAN controller.
 *
 * First in, first out. A frame that finds the queue full is lost and counted, never waited for.
 * Constant time.
 */
#ifndef BOWDEN_CANOPEN_FRAME_QUEUE_H
#define BOWDEN_CANOPEN_FRAME_QUEUE_H

#include "../board/board.h"

/* Enough for every TPDO, an answer, a heartbeat and an EMCY of several ticks. */
#define FRAME_QUEUE_CAPACITY 32

typedef struct {
    can_frame_t frames[FRAME_QUEUE_CAPACITY];
    uint8_t first; /* oldest frame */
    uint8_t count;
    uint32_t overflow_count; /* frames lost since the start */
} frame_queue_t;

/* Makes an empty queue. The frames stay as they are: none is read before it was pushed. */
void frame_queue_start(frame_queue_t *queue);

void frame_queue_push(frame_queue_t *queue, const can_frame_t *frame);

/* Drops every frame that waits. */
void frame_queue_clear(frame_queue_t *queue);

/* Would the next frame be lost? For what can wait. */
bool frame_queue_is_full(const frame_queue_t *queue);

/* Returns false when the queue is empty. */
bool frame_queue_pop(frame_queue_t *queue, can_frame_t *frame);

#endif
