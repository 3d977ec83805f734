/* sdo_block.c: see sdo_block.h. Command bytes are those of CiA 301, 7.2.4.3. */
#include "sdo_block.h"

#include "sdo_frames.h"

/* Offered to the client: a number beyond it is no segment, but a client that has started anew. */
#define SEGMENTS_OFFERED 31u
#define SEGMENTS_MOST 127u

/* Frames that may wait in the queue when a segment is added. */
#define QUEUE_SHARE 8u

/* Client command specifiers, bits 5 .. 7 of the first byte. */
enum { ABORT = 4, UPLOAD = 5, DOWNLOAD = 6 };

/* Client subcommands: of an upload bits 0 and 1, of a download bit 0. */
enum { INITIATE = 0, END = 1, CONFIRM = 2, START = 3 };

/* First bytes of the server's frames. */
enum {
    DOWNLOAD_CONFIRM = 0xA2,
    UPLOAD_OFFER = 0xC6, /* with CRC, the size is given */
    UPLOAD_END = 0xC1,
};

/* Flags. */
enum { SIZE_GIVEN = 0x02, WITH_CRC = 0x04, LAST_SEGMENT = 0x80 };

#define CLIENT_GIVES_UP 0x80u

static uint32_t smaller(uint32_t a, uint32_t b) {
    return a < b ? a : b;
}

uint16_t sdo_block_crc(uint16_t crc, const uint8_t *bytes, uint32_t count) {
    static const uint16_t TABLE[16] = {
        0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
        0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF,
    };
    for (uint32_t i = 0; i < count; i++) { /* four bits at a time */
        crc = (uint16_t)(crc << 4 ^ TABLE[(crc >> 12 ^ bytes[i] >> 4) & 15u]);
        crc = (uint16_t)(crc << 4 ^ TABLE[(crc >> 12 ^ bytes[i]) & 15u]);
    }
    return crc;
}

/* Takes the bytes up to `end` into the CRC; each counts once, however often it is sent. */
static void check_up_to(sdo_t *sdo, uint32_t end) {
    sdo_block_t *block = &sdo->block;
    if (end > block->checked) {
        block->crc = sdo_block_crc(block->crc, &sdo->buffer[block->checked], end - block->checked);
        block->checked = end;
    }
}

/* ---- download ---- */

static sdo_request_t begin_download(sdo_t *sdo, const can_frame_t *frame) {
    sdo_begin(sdo, frame);
    sdo->size_given = (frame->data[0] & SIZE_GIVEN) != 0;
    sdo->size = sdo->size_given ? sdo_announced_size(frame) : 0;
    sdo->answer = SDO_BLOCK_ACCEPTED;
    sdo->block = (sdo_block_t){
        .with_crc = (frame->data[0] & WITH_CRC) != 0,
        .segments = SEGMENTS_OFFERED,
    };
    return SDO_BEGIN_WRITE;
}

void sdo_block_accept(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx) {
    sdo->transfer = SDO_BLOCK_DOWNLOADING;
    sdo_send_addressed(sdo, SDO_BLOCK_ACCEPTED, SEGMENTS_OFFERED, node_id, tx);
}

/* Is it the segment that ended the last sub-block, once more? CAN may deliver a frame twice. */
static bool is_repeated_end(const sdo_t *sdo, const can_frame_t *frame) {
    const sdo_block_t *block = &sdo->block;
    if (block->sequence > 0 || sdo->done < SDO_SEGMENT_BYTES ||
        (frame->data[0] & ~LAST_SEGMENT) != block->segments) {
        return false;
    }
    bool same = true;
    for (uint32_t i = 0; i < SDO_SEGMENT_BYTES; i++) {
        same = same && sdo->buffer[sdo->done - SDO_SEGMENT_BYTES + i] == frame->data[1 + i];
    }
    return same;
}

static void take_bytes(sdo_t *sdo, const can_frame_t *frame) {
    check_up_to(sdo, sdo->done); /* this segment may be the last, and end in unused bytes */
    for (uint32_t i = 0; i < SDO_SEGMENT_BYTES; i++) {
        sdo->buffer[sdo->done + i] = frame->data[1 + i];
    }
    sdo->done += SDO_SEGMENT_BYTES;
    sdo->block.sequence++;
    sdo->block.ended = (frame->data[0] & LAST_SEGMENT) != 0;
}

static void take_segment(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id, frame_queue_t *tx) {
    sdo_block_t *block = &sdo->block;
    const uint32_t number = frame->data[0] & ~(uint32_t)LAST_SEGMENT;
    if (frame->data[0] == CLIENT_GIVES_UP) {
        sdo->transfer = SDO_IDLE;
        return;
    }
    if (number == 0 || number > block->segments) {
        sdo_abort(sdo, OD_ABORT_SEQUENCE, node_id, tx);
        return;
    }
    if (is_repeated_end(sdo, frame)) {
        return;
    }
    if (number == block->sequence + 1u) {
        if (sdo->done + SDO_SEGMENT_BYTES > SDO_BUFFER_SIZE) {
            sdo_abort(sdo, OD_ABORT_TOO_LONG, node_id, tx);
            return;
        }
        take_bytes(sdo, frame);
    }
    if (number == block->segments || (frame->data[0] & LAST_SEGMENT) != 0) {
        const uint8_t data[8] = {DOWNLOAD_CONFIRM, block->sequence, SEGMENTS_OFFERED};
        sdo_send(node_id, data, tx);
        block->sequence = 0;
        sdo->transfer = block->ended ? SDO_BLOCK_DOWNLOADED : SDO_BLOCK_DOWNLOADING;
    }
}

static sdo_request_t end_download(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id,
                                  frame_queue_t *tx) {
    const uint32_t unused = frame->data[0] >> 2 & 7u;
    const uint16_t crc = (uint16_t)(frame->data[1] | frame->data[2] << 8);
    const uint32_t size = sdo->done - unused; /* at least one segment has come */
    check_up_to(sdo, size);
    if (sdo->block.with_crc && crc != sdo->block.crc) {
        sdo_abort(sdo, OD_ABORT_CRC, node_id, tx);
        return SDO_NOTHING;
    }
    if (sdo->size_given && sdo->size != size) {
        sdo_abort(sdo, OD_ABORT_LENGTH, node_id, tx);
        return SDO_NOTHING;
    }
    sdo->transfer = SDO_IDLE;
    sdo->size = size;
    sdo->size_given = true;
    sdo->answer = SDO_BLOCK_WRITTEN;
    return SDO_WRITE;
}

/* ---- upload ---- */

/* How many segments the client takes at a time; false: the number means nothing, aborted. */
static bool take_segments(sdo_t *sdo, uint8_t segments, uint8_t node_id, frame_queue_t *tx) {
    if (segments < 1 || segments > SEGMENTS_MOST) {
        sdo_abort(sdo, OD_ABORT_BLOCK_SIZE, node_id, tx);
        return false;
    }
    sdo->block.segments = segments;
    return true;
}

static sdo_request_t begin_upload(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id,
                                  frame_queue_t *tx) {
    sdo_begin(sdo, frame);
    sdo->block = (sdo_block_t){.with_crc = (frame->data[0] & WITH_CRC) != 0};
    if (!take_segments(sdo, frame->data[4], node_id, tx)) {
        return SDO_NOTHING;
    }
    sdo->transfer = SDO_BLOCK_OFFERED;
    return SDO_READ;
}

void sdo_block_offer(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx) {
    sdo_send_addressed(sdo, UPLOAD_OFFER, sdo->size, node_id, tx);
}

bool sdo_block_send(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx) {
    if (sdo->transfer != SDO_BLOCK_UPLOADING || tx->count >= QUEUE_SHARE) {
        return false;
    }
    sdo_block_t *block = &sdo->block;
    const uint32_t from = sdo->done + SDO_SEGMENT_BYTES * block->sequence;
    const uint32_t count = smaller(SDO_SEGMENT_BYTES, sdo->size - from);
    const bool last = from + count == sdo->size;
    block->sequence++;
    uint8_t data[8] = {(uint8_t)(block->sequence | (last ? LAST_SEGMENT : 0))};
    for (uint32_t i = 0; i < count; i++) {
        data[1 + i] = sdo->buffer[from + i];
    }
    check_up_to(sdo, from + count);
    sdo_send(node_id, data, tx);
    if (last || block->sequence == block->segments) {
        sdo->transfer = SDO_BLOCK_CONFIRMING;
    }
    return true;
}

/* The client has the segments up to a number: goes on behind it. It may say so early, when it has
 * seen one missing. */
static void go_on(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id, frame_queue_t *tx) {
    const uint8_t number = frame->data[1];
    if (number > sdo->block.sequence) {
        sdo_abort(sdo, OD_ABORT_SEQUENCE, node_id, tx);
        return;
    }
    if (!take_segments(sdo, frame->data[2], node_id, tx)) {
        return;
    }
    sdo->done = smaller(sdo->done + SDO_SEGMENT_BYTES * number, sdo->size);
    sdo->block.sequence = 0;
    sdo->transfer = SDO_BLOCK_UPLOADING;
    if (sdo->done == sdo->size) {
        const uint32_t odd = sdo->size % SDO_SEGMENT_BYTES;
        const uint32_t unused = odd > 0 ? SDO_SEGMENT_BYTES - odd : 0;
        const uint16_t crc = sdo->block.with_crc ? sdo->block.crc : 0;
        const uint8_t data[8] = {(uint8_t)(UPLOAD_END | unused << 2), (uint8_t)crc,
                                 (uint8_t)(crc >> 8)};
        sdo_send(node_id, data, tx);
        sdo->transfer = SDO_BLOCK_UPLOADED;
    }
}

/* ---- both ---- */

bool sdo_block_concerns(const sdo_t *sdo, const can_frame_t *frame) {
    const uint8_t command = frame->data[0] >> 5;
    const bool late = sdo->transfer == SDO_BLOCK_DOWNLOADED && frame->data[0] > CLIENT_GIVES_UP &&
                      command == ABORT; /* the last segment once more */
    return sdo->transfer == SDO_BLOCK_DOWNLOADING || late || command == UPLOAD ||
           command == DOWNLOAD;
}

static sdo_request_t receive_upload(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id,
                                    frame_queue_t *tx) {
    const uint8_t command = frame->data[0] & 3u;
    const bool sends =
        sdo->transfer == SDO_BLOCK_UPLOADING || sdo->transfer == SDO_BLOCK_CONFIRMING;
    if (command == INITIATE) {
        return begin_upload(sdo, frame, node_id, tx);
    }
    if (command == START && sdo->transfer == SDO_BLOCK_OFFERED) {
        sdo->transfer = SDO_BLOCK_UPLOADING;
    } else if (command == CONFIRM && sends) {
        go_on(sdo, frame, node_id, tx);
    } else if (command == END && sdo->transfer == SDO_BLOCK_UPLOADED) {
        sdo->transfer = SDO_IDLE;
    } else {
        sdo_abort(sdo, OD_ABORT_COMMAND, node_id, tx);
    }
    return SDO_NOTHING;
}

sdo_request_t sdo_block_receive(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id,
                                frame_queue_t *tx) {
    if (sdo->transfer == SDO_BLOCK_DOWNLOADING) {
        take_segment(sdo, frame, node_id, tx);
        return SDO_NOTHING;
    }
    switch (frame->data[0] >> 5) {
    case UPLOAD:
        return receive_upload(sdo, frame, node_id, tx);
    case DOWNLOAD:
        if ((frame->data[0] & 1u) == INITIATE) {
            return begin_download(sdo, frame);
        }
        if (sdo->transfer == SDO_BLOCK_DOWNLOADED) {
            return end_download(sdo, frame, node_id, tx);
        }
        sdo_abort(sdo, OD_ABORT_COMMAND, node_id, tx);
        return SDO_NOTHING;
    default: /* the last segment of a download once more */
        return SDO_NOTHING;
    }
}
