/* emcy.c: see emcy.h. */
#include "emcy.h"

#include <stddef.h>

#define ERROR_REGISTER 0x1001
#define ERROR_HISTORY 0x1003
#define INHIBIT_TIME 0x1015
#define INHIBIT_STEP_US UINT32_C(100)
#define AGE_STEP_US UINT32_C(10000)

static void store(const od_t *od, uint16_t index, uint8_t sub, uint32_t value) {
    const od_entry_t *entry = NULL;
    if (od_find(od, index, sub, &entry) == OD_DONE) {
        od_set(od, entry, sub, value);
    }
}

static uint8_t present_bits(const emcy_t *emcy) {
    uint8_t bits = 0;
    for (uint32_t i = 0; i < emcy->present_count; i++) {
        bits |= emcy->present[i].register_bits;
    }
    return bits;
}

/* Publishes the register and queues a frame. When the queue is full the newest frame is replaced:
 * the last one, which tells the state that remains, always arrives. */
static void announce(emcy_t *emcy, const od_t *od, uint16_t code, uint32_t detail) {
    const uint8_t bits = present_bits(emcy);
    store(od, ERROR_REGISTER, 0, bits);
    if (emcy->waiting_count < EMCY_WAITING_MAX) {
        emcy->waiting_count++;
    }
    emcy->waiting[emcy->waiting_count - 1] = (emcy_error_t){
        .code = code, .register_bits = bits, .detail = detail, .time_us = emcy->now_us};
}

static void remember(const od_t *od, const emcy_error_t *error) {
    const od_entry_t *rows = NULL;
    if (od_find(od, ERROR_HISTORY, 1, &rows) != OD_DONE) {
        return;
    }
    for (uint8_t sub = rows->count; sub > 1; sub--) {
        od_set(od, rows, sub, od_get(od, rows, (uint8_t)(sub - 1)));
    }
    od_set(od, rows, 1, (error->detail & 0xFFFF) << 16 | error->code);
    const uint32_t count = od_value(od, ERROR_HISTORY, 0);
    store(od, ERROR_HISTORY, 0, count < rows->count ? count + 1 : count);
}

void emcy_configure(emcy_t *emcy, const od_t *od) {
    emcy->inhibit_us = od_value(od, INHIBIT_TIME, 0) * INHIBIT_STEP_US;
}

void emcy_set(emcy_t *emcy, const od_t *od, emcy_error_t error) {
    for (uint32_t i = 0; i < emcy->present_count; i++) {
        if (emcy->present[i].code == error.code) {
            return;
        }
    }
    if (emcy->present_count < EMCY_PRESENT_MAX) {
        error.time_us = emcy->now_us;
        emcy->present[emcy->present_count] = error;
        emcy->present_count++;
    }
    remember(od, &error);
    announce(emcy, od, error.code, error.detail);
}

void emcy_clear(emcy_t *emcy, const od_t *od, uint16_t code) {
    for (uint32_t i = 0; i < emcy->present_count; i++) {
        if (emcy->present[i].code == code) {
            emcy->present_count--;
            emcy->present[i] = emcy->present[emcy->present_count];
            announce(emcy, od, 0, 0);
            return;
        }
    }
}

void emcy_clear_all(emcy_t *emcy, const od_t *od) {
    if (emcy->present_count != 0) {
        emcy->present_count = 0;
        announce(emcy, od, 0, 0);
    }
}

static bool is_waiting(const emcy_t *emcy, uint16_t code) {
    bool found = false;
    for (uint32_t i = 0; i < emcy->waiting_count; i++) {
        found = found || emcy->waiting[i].code == code;
    }
    return found;
}

void emcy_repeat(emcy_t *emcy, const od_t *od) {
    for (uint32_t i = 0; i < emcy->present_count; i++) {
        const emcy_error_t *error = &emcy->present[i];
        if (!is_waiting(emcy, error->code)) {
            announce(emcy, od, error->code, error->detail);
            emcy->waiting[emcy->waiting_count - 1].time_us = error->time_us;
        }
    }
}

/* Ages stop at the most that a frame can tell: the clock wraps. */
static uint8_t age(emcy_error_t *error, uint32_t now_us) {
    const uint32_t most_us = UINT8_MAX * AGE_STEP_US;
    if (now_us - error->time_us > most_us) {
        error->time_us = now_us - most_us;
    }
    return (uint8_t)((now_us - error->time_us) / AGE_STEP_US);
}

void emcy_tick(emcy_t *emcy, uint8_t node_id, bool allowed, uint32_t now_us, frame_queue_t *tx) {
    emcy->now_us = now_us;
    for (uint32_t i = 0; i < emcy->waiting_count; i++) {
        (void)age(&emcy->waiting[i], now_us);
    }
    for (uint32_t i = 0; i < emcy->present_count; i++) {
        (void)age(&emcy->present[i], now_us);
    }
    if (emcy->inhibited && now_us - emcy->sent_us >= emcy->inhibit_us) {
        emcy->inhibited = false;
    }
    if (!allowed || emcy->inhibited || emcy->waiting_count == 0 || frame_queue_is_full(tx)) {
        return;
    }
    emcy_error_t *error = &emcy->waiting[0];
    can_frame_t frame = {.cob_id = (uint16_t)(EMCY_COB_ID + node_id), .length = 8};
    od_encode(error->code, &frame.data[0], 2);
    frame.data[2] = error->register_bits;
    od_encode(error->detail, &frame.data[3], 4);
    frame.data[7] = age(error, now_us);
    frame_queue_push(tx, &frame);
    emcy->waiting_count--;
    for (uint32_t i = 0; i < emcy->waiting_count; i++) {
        emcy->waiting[i] = emcy->waiting[i + 1];
    }
    emcy->sent_us = now_us;
    emcy->inhibited = true;
}
