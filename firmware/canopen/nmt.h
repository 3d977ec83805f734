/* nmt.h: the NMT state of the node and the commands that change it (CiA 301, 7.3.2). */
#ifndef BOWDEN_CANOPEN_NMT_H
#define BOWDEN_CANOPEN_NMT_H

#include "../board/board.h"

/* States as they stand in the heartbeat. */
enum {
    NMT_INITIALISING = 0x00, /* boot-up message; after "reset node" the node is silent in it */
    NMT_STOPPED = 0x04,
    NMT_OPERATIONAL = 0x05,
    NMT_PRE_OPERATIONAL = 0x7F,
};

/* What a received frame asks of the node. */
typedef enum {
    NMT_NOTHING,
    NMT_CHANGED, /* the state has changed */
    NMT_RESET_NODE,
    NMT_RESET_COMMUNICATION,
} nmt_request_t;

typedef struct {
    uint8_t state;
} nmt_t;

/* Carries out an NMT command (COB-ID 0) that is meant for node_id or for all; others do nothing. */
nmt_request_t nmt_receive(nmt_t *nmt, const can_frame_t *frame, uint8_t node_id);

#endif
