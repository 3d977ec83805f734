/* lss.h: layer setting services (CiA 305): a host that knows no node id, or whose node shares its
 * id with another, finds the node by its identity (0x1018) and gives it a node id and bit rate.
 *
 *   waiting --switch state global, or selective with all four numbers--> configuring --> waiting
 *
 * Node id and bit rate are the entries node_id and bit_rate, with their checks: not while the
 * bridge is on. They hold from the next start on, once they are stored. Fastscan is for nodes
 * without a node id of their own (CiA 305); this node has one from power-on, so it takes part when
 * another has been heard under the same id. All but that works in every NMT state. Pure.
 */
#ifndef BOWDEN_CANOPEN_LSS_H
#define BOWDEN_CANOPEN_LSS_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"
#include "od.h"

#define LSS_RX_COB_ID 0x7E5u /* from the host */
#define LSS_TX_COB_ID 0x7E4u

/* The entries that it writes. */
#define LSS_NODE_ID_INDEX 0x2012u
#define LSS_BIT_RATE_INDEX 0x2013u

/* Errors of an answer; other services have 0 and 1 of these. */
enum {
    LSS_FINE = 0,
    LSS_NOT_SUPPORTED = 1, /* a node id or bit rate that the node does not have */
    LSS_STORE_FAILED = 2,
    LSS_REFUSED = 0xFF, /* the bridge is on */
};

typedef struct {
    bool configuring;
    bool disputed;    /* another node with our node id has been heard since the start */
    bool storing;     /* the drive is at it; lss_stored() answers */
    uint8_t selected; /* of the four numbers of a selective switch, how many have matched */
    uint8_t scanned;  /* number of the identity that fastscan is at, 0 .. 3 */
} lss_t;

typedef enum { LSS_NOTHING, LSS_ANSWER, LSS_STORE } lss_event_t;

/* Handles a frame of LSS_RX_COB_ID. LSS_ANSWER: `answer` is to be sent. LSS_STORE: node id and bit
 * rate are to be stored, then call lss_stored(). */
lss_event_t lss_receive(lss_t *lss, od_t *od, const can_frame_t *frame, can_frame_t *answer);

/* The answer to what led to LSS_STORE. `error`: LSS_FINE or LSS_STORE_FAILED. */
can_frame_t lss_stored(lss_t *lss, uint8_t error);

#endif
