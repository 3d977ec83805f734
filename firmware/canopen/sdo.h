/* sdo.h: the protocol of the SDO server (CiA 301, 7.2.4): frames in, requests out, answers in.
 *
 * One transfer at a time: expedited or segmented (sdo.c), or in blocks with CRC (sdo_block.c).
 * This part knows the protocol only: sdo_receive() returns what the client wants of the dictionary,
 * the node does it and passes the outcome to sdo_answer_*().
 */
#ifndef BOWDEN_CANOPEN_SDO_H
#define BOWDEN_CANOPEN_SDO_H

#include "frame_queue.h"
#include "od.h"

#define SDO_RX_COB_ID 0x600
#define SDO_TX_COB_ID 0x580
#define SDO_BUFFER_SIZE 154              /* longest value in bytes; whole segments of 7 */
#define SDO_TIMEOUT_US UINT32_C(1000000) /* between two frames, then abort 0504 0000h */

typedef enum {
    SDO_NOTHING,     /* the protocol has answered by itself */
    SDO_READ,        /* read index, sub into sdo_t.buffer, then sdo_answer_read() */
    SDO_BEGIN_WRITE, /* a longer write will come: refuse it now or let it, sdo_answer_write() */
    SDO_WRITE,       /* write sdo_t.buffer to index, sub, then sdo_answer_write() */
} sdo_request_t;

/* Where a block transfer stands, sdo_block.h. */
typedef struct {
    bool with_crc;    /* the client checks, too */
    bool ended;       /* the last segment has come */
    uint8_t segments; /* of a sub-block, 1 .. 127 */
    uint8_t sequence; /* number of the last segment of this sub-block that came, or was sent */
    uint16_t crc;     /* of the first `checked` bytes */
    uint32_t checked;
} sdo_block_t;

typedef struct {
    enum {
        SDO_IDLE,
        SDO_UPLOADING,
        SDO_DOWNLOADING,
        SDO_BLOCK_DOWNLOADING, /* each frame is a segment */
        SDO_BLOCK_DOWNLOADED,  /* all have come; the end is to come, with the CRC */
        SDO_BLOCK_OFFERED,     /* the client is to start */
        SDO_BLOCK_UPLOADING,   /* segments go out, sdo_tick() */
        SDO_BLOCK_CONFIRMING,  /* a sub-block is out, the client is to confirm it */
        SDO_BLOCK_UPLOADED,    /* all is confirmed, the client is to end it */
        SDO_WAITING,           /* the node answers a write later */
    } transfer;
    uint16_t index; /* of the request or transfer */
    uint8_t sub;
    bool toggle;        /* expected in the next segment */
    bool size_given;    /* the client has said how many bytes it writes */
    uint32_t size;      /* of the value; of a write 0 while the client has not said it */
    uint32_t done;      /* bytes moved so far; of a block upload, those that are confirmed */
    uint32_t active_us; /* time of the last frame */
    uint8_t answer;     /* command byte that confirms the write in progress */
    sdo_block_t block;
    uint8_t buffer[SDO_BUFFER_SIZE];
} sdo_t;

/* Handles a frame on the server's COB-ID. Frames that do not have 8 bytes are ignored. */
sdo_request_t sdo_receive(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id, uint32_t now_us,
                          frame_queue_t *tx);

/* Answers SDO_READ: the value (sdo->size bytes in sdo->buffer), or the abort. */
void sdo_answer_read(sdo_t *sdo, od_abort_t abort, uint8_t node_id, frame_queue_t *tx);

/* Answers SDO_BEGIN_WRITE and SDO_WRITE. */
void sdo_answer_write(sdo_t *sdo, od_abort_t abort, uint8_t node_id, frame_queue_t *tx);

/* Sends segments of a block upload; aborts a transfer that the client has abandoned. */
void sdo_tick(sdo_t *sdo, uint8_t node_id, uint32_t now_us, frame_queue_t *tx);

#endif
