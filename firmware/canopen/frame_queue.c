/* frame_queue.c: see frame_queue.h. */
#include "frame_queue.h"

void frame_queue_push(frame_queue_t *queue, const can_frame_t *frame) {
    if (queue->count == FRAME_QUEUE_CAPACITY) {
        queue->overflow_count++;
        return;
    }
    queue->frames[(queue->first + queue->count) % FRAME_QUEUE_CAPACITY] = *frame;
    queue->count++;
}

bool frame_queue_pop(frame_queue_t *queue, can_frame_t *frame) {
    if (queue->count == 0) {
        return false;
    }
    *frame = queue->frames[queue->first];
    queue->first = (uint8_t)((queue->first + 1) % FRAME_QUEUE_CAPACITY);
    queue->count--;
    return true;
}
