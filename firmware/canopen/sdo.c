/* sdo.c: see sdo.h. Command bytes are those of CiA 301, 7.2.4.3. */
#include "sdo.h"

#include "sdo_block.h"
#include "sdo_frames.h"

/* Client command specifiers, bits 5 .. 7 of the first byte. */
enum {
    DOWNLOAD_SEGMENT = 0,
    DOWNLOAD_INITIATE = 1,
    UPLOAD_INITIATE = 2,
    UPLOAD_SEGMENT = 3,
    ABORT = 4,
};

/* First bytes of the server's answers, before flags. */
enum {
    DOWNLOAD_SEGMENT_OK = 0x20,
    UPLOAD_OK = 0x40,
    DOWNLOAD_OK = 0x60,
};

/* Flags. */
enum {
    SIZE_GIVEN = 0x01,
    EXPEDITED = 0x02,
    LAST_SEGMENT = 0x01,
    TOGGLE = 0x10,
};

static uint32_t smaller(uint32_t a, uint32_t b) {
    return a < b ? a : b;
}

static sdo_request_t begin_write(sdo_t *sdo, const can_frame_t *frame) {
    const uint8_t command = frame->data[0];
    sdo_begin(sdo, frame);
    sdo->size_given = (command & SIZE_GIVEN) != 0;
    sdo->answer = DOWNLOAD_OK;
    if ((command & EXPEDITED) != 0) {
        sdo->size = sdo->size_given ? 4u - (command >> 2 & 3u) : 0u;
        for (uint32_t i = 0; i < 4; i++) {
            sdo->buffer[i] = frame->data[4 + i];
        }
        return SDO_WRITE;
    }
    sdo->size = sdo->size_given ? sdo_announced_size(frame) : 0;
    sdo->transfer = SDO_DOWNLOADING;
    return SDO_BEGIN_WRITE;
}

static sdo_request_t write_segment(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id,
                                   frame_queue_t *tx) {
    const uint8_t command = frame->data[0];
    const uint32_t count = SDO_SEGMENT_BYTES - (command >> 1 & 7u);
    if (sdo->done + count > SDO_BUFFER_SIZE) {
        sdo_abort(sdo, OD_ABORT_TOO_LONG, node_id, tx);
        return SDO_NOTHING;
    }
    for (uint32_t i = 0; i < count; i++) {
        sdo->buffer[sdo->done + i] = frame->data[1 + i];
    }
    sdo->done += count;
    sdo->answer = (uint8_t)(DOWNLOAD_SEGMENT_OK | (sdo->toggle ? TOGGLE : 0));
    sdo->toggle = !sdo->toggle;
    if ((command & LAST_SEGMENT) == 0) {
        const uint8_t data[8] = {sdo->answer};
        sdo_send(node_id, data, tx);
        return SDO_NOTHING;
    }
    sdo->transfer = SDO_IDLE;
    if (sdo->size_given && sdo->size != sdo->done) {
        sdo_abort(sdo, OD_ABORT_LENGTH, node_id, tx);
        return SDO_NOTHING;
    }
    sdo->size = sdo->done;
    sdo->size_given = true;
    return SDO_WRITE;
}

static void read_segment(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx) {
    const uint32_t count = smaller(SDO_SEGMENT_BYTES, sdo->size - sdo->done);
    uint8_t data[8] = {(uint8_t)((sdo->toggle ? TOGGLE : 0) | (SDO_SEGMENT_BYTES - count) << 1)};
    for (uint32_t i = 0; i < count; i++) {
        data[1 + i] = sdo->buffer[sdo->done + i];
    }
    sdo->done += count;
    sdo->toggle = !sdo->toggle;
    if (sdo->done == sdo->size) {
        data[0] |= LAST_SEGMENT;
        sdo->transfer = SDO_IDLE;
    }
    sdo_send(node_id, data, tx);
}

/* A segment must belong to a transfer of its kind and carry the expected toggle bit. */
static bool segment_fits(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id, frame_queue_t *tx) {
    const bool reading = frame->data[0] >> 5 == UPLOAD_SEGMENT;
    if (sdo->transfer != (reading ? SDO_UPLOADING : SDO_DOWNLOADING)) {
        sdo_abort(sdo, OD_ABORT_COMMAND, node_id, tx);
        return false;
    }
    if (((frame->data[0] & TOGGLE) != 0) != sdo->toggle) {
        sdo_abort(sdo, OD_ABORT_TOGGLE, node_id, tx);
        return false;
    }
    return true;
}

/* The write under way is answered in its time; whatever else comes meanwhile is aborted. */
static void refuse_while_waiting(const can_frame_t *frame, uint8_t node_id, frame_queue_t *tx) {
    if (frame->data[0] >> 5 != ABORT) {
        sdo_t other = {.index = (uint16_t)(frame->data[1] | frame->data[2] << 8),
                       .sub = frame->data[3]};
        sdo_abort(&other, OD_ABORT_BUSY, node_id, tx);
    }
}

sdo_request_t sdo_receive(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id, uint32_t now_us,
                          frame_queue_t *tx) {
    if (frame->length != 8) {
        return SDO_NOTHING;
    }
    sdo->active_us = now_us;
    if (sdo->transfer == SDO_WAITING) {
        refuse_while_waiting(frame, node_id, tx);
        return SDO_NOTHING;
    }
    if (sdo_block_concerns(sdo, frame)) {
        return sdo_block_receive(sdo, frame, node_id, tx);
    }
    switch (frame->data[0] >> 5) {
    case DOWNLOAD_INITIATE:
        return begin_write(sdo, frame);
    case DOWNLOAD_SEGMENT:
        return segment_fits(sdo, frame, node_id, tx) ? write_segment(sdo, frame, node_id, tx)
                                                     : SDO_NOTHING;
    case UPLOAD_INITIATE:
        sdo_begin(sdo, frame);
        return SDO_READ;
    case UPLOAD_SEGMENT:
        if (segment_fits(sdo, frame, node_id, tx)) {
            read_segment(sdo, node_id, tx);
        }
        return SDO_NOTHING;
    case ABORT: /* the client gives up; an abort is not answered */
        sdo->transfer = SDO_IDLE;
        return SDO_NOTHING;
    default: /* no command at all */
        sdo_begin(sdo, frame);
        sdo_abort(sdo, OD_ABORT_COMMAND, node_id, tx);
        return SDO_NOTHING;
    }
}

void sdo_answer_read(sdo_t *sdo, od_abort_t abort, uint8_t node_id, frame_queue_t *tx) {
    if (abort != OD_DONE) {
        sdo_abort(sdo, abort, node_id, tx);
        return;
    }
    if (sdo->transfer == SDO_BLOCK_OFFERED) {
        sdo_block_offer(sdo, node_id, tx);
        return;
    }
    if (sdo->size > 4) {
        sdo->transfer = SDO_UPLOADING;
        sdo_send_addressed(sdo, UPLOAD_OK | SIZE_GIVEN, sdo->size, node_id, tx);
        return;
    }
    uint32_t value = 0;
    for (uint32_t i = 0; i < sdo->size; i++) {
        value |= (uint32_t)sdo->buffer[i] << (8 * i);
    }
    const uint32_t unused = 4 - sdo->size;
    sdo_send_addressed(sdo, (uint8_t)(UPLOAD_OK | EXPEDITED | SIZE_GIVEN | unused << 2), value,
                       node_id, tx);
}

void sdo_answer_write(sdo_t *sdo, od_abort_t abort, uint8_t node_id, frame_queue_t *tx) {
    if (abort != OD_DONE) {
        sdo_abort(sdo, abort, node_id, tx);
    } else if (sdo->answer == SDO_BLOCK_ACCEPTED) {
        sdo_block_accept(sdo, node_id, tx);
    } else if (sdo->answer == DOWNLOAD_OK) {
        sdo_send_addressed(sdo, DOWNLOAD_OK, 0, node_id, tx);
    } else {
        const uint8_t data[8] = {sdo->answer};
        sdo_send(node_id, data, tx);
    }
}

void sdo_tick(sdo_t *sdo, uint8_t node_id, uint32_t now_us, frame_queue_t *tx) {
    if (sdo_block_send(sdo, node_id, tx)) {
        sdo->active_us = now_us;
    }
    if (sdo->transfer != SDO_IDLE && sdo->transfer != SDO_WAITING &&
        now_us - sdo->active_us >= SDO_TIMEOUT_US) {
        sdo_abort(sdo, OD_ABORT_TIMEOUT, node_id, tx);
    }
}
