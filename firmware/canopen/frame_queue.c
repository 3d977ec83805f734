/* frame_queue.c: see frame_queue.h. */
#include "frame_queue.h"

bool frame_queue_is_full(const frame_queue_t *queue) {
    return queue->count == FRAME_QUEUE_CAPACITY;
}

void frame_queue_start(frame_queue_t *queue) {
    queue->first = 0;
    queue->count = 0;
    queue->overflow_count = 0;
}

void frame_queue_clear(frame_queue_t *queue) {
    queue->count = 0;
}

void frame_queue_push(frame_queue_t *queue, const can_frame_t *frame) {
    if (frame_queue_is_full(queue)) {
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
