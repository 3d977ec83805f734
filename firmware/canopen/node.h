/* node.h: the CANopen node: everything of CiA 301 that the drive has, behind six calls.
 *
 * The node owns its parts (NMT, heartbeat, LSS, SDO server, PDO, SYNC, EMCY, transmit queue) and
 * knows nothing of the drive: it sees the table of the object dictionary and the struct of its
 * values. Frames come in by node_receive(), go out by node_transmit(); time comes with node_tick()
 * in microseconds and may wrap. No globals, no allocation, no waiting; every loop is bounded.
 *
 * Not re-entrant: all calls on one node come from one context, the control tick. A board that
 * receives in an interrupt queues the frames and passes them over in the tick.
 *
 * Order of a tick:  node_receive() for each frame;  the drive computes;
 *                   if (node_sample_due()) the drive counts its sample and sets the time stamp;
 *                   node_tick();  node_transmit() until it returns false.
 */
#ifndef BOWDEN_CANOPEN_NODE_H
#define BOWDEN_CANOPEN_NODE_H

#include "../board/board.h"
#include "emcy.h"
#include "frame_queue.h"
#include "heartbeat.h"
#include "lss.h"
#include "nmt.h"
#include "od.h"
#include "pdo.h"
#include "sdo.h"
#include "storage.h"

typedef struct {
    od_t od; /* the drive may set od.config_locked and read od.config_revision */
    nmt_t nmt;
    heartbeat_t heartbeat;
    lss_t lss;
    sdo_t sdo;
    pdo_t pdo;
    emcy_t emcy;
    frame_queue_t tx;
    bool commanded;            /* the host has written a command, or its heartbeat has come */
    bool communication_reset;  /* NMT reset communication has come */
    bool namesake;             /* a heartbeat with our own node id has come */
    storage_request_t storage; /* the drive carries it out, sets it back, node_storage_done() */
    const uint32_t *image;     /* what is kept across power-off; not owned */
    uint32_t image_words;
    uint32_t now_us;    /* time of the last tick */
    board_bus_t bus;    /* as node_follow_bus() was told */
    bool announced;     /* the boot-up message has gone out for all that is known */
    uint32_t booted_us; /* its time in the queue, or when the bus was last lost since */
} node_t;

/* Starts a node: sets every value to its initial one (so set the serial number after it), queues
 * the boot-up message, enters pre-operational. `entries` and `values` must outlive the node.
 * node_id 1 .. 127. */
void node_init(node_t *node, const od_entry_t *entries, uint16_t count, void *values,
               uint8_t node_id, uint32_t now_us);

/* Takes the configuration from an image (storage.h), which must outlive the node: the entries of
 * communication come from it again at each reset communication. */
storage_report_t node_take_image(node_t *node, const uint32_t *image, uint32_t words);

/* Answers the write to 0x1010 or 0x1011, or the LSS frame, that node_t.storage came from. */
void node_storage_done(node_t *node, od_abort_t abort);

/* The value of type OD_DOMAIN that a host has written whole, and where; NULL: none. What it means
 * is the drive's business: it answers with node_answer_offer() in the same tick. */
const uint8_t *node_offered(const node_t *node, uint16_t *index, uint8_t *sub);

/* Takes that value (OD_DONE) or refuses it, and tells the host. */
void node_answer_offer(node_t *node, od_abort_t abort);

/* Handles one received frame at once; unknown frames are ignored. Answers go into the queue. */
void node_receive(node_t *node, const can_frame_t *frame);

/* Takes the value of the urgent entry, the controlword, in an RPDO that was not taken (pdo.h);
 * false when there was none since the last call. Ask after each node_receive(). */
bool node_take_withheld(node_t *node, uint16_t *value);

/* Reports the state of the bus, in every tick before node_tick(). While it takes no frames none are
 * queued but the heartbeat, anew each time the controller has dropped the one before: so no
 * outdated frame is sent. EMCY frames wait, and those of errors that are present are repeated; an
 * SDO transfer ends. */
void node_follow_bus(node_t *node, board_bus_t bus);

/* Will node_tick(now_us) send a TPDO? All TPDOs of that tick are one sample. */
bool node_sample_due(const node_t *node, uint32_t now_us);

/* Does what time demands: TPDOs, heartbeat, EMCY, timeouts. Call it once every control tick. */
void node_tick(node_t *node, uint32_t now_us);

/* Takes the next frame to send. Returns false when there is none. */
bool node_transmit(node_t *node, can_frame_t *frame);

/* NMT_PRE_OPERATIONAL, NMT_OPERATIONAL or NMT_STOPPED (nmt.h). */
uint8_t node_state(const node_t *node);

/* Has a reset of the node been commanded? The board restarts the drive then; the node is silent. */
bool node_reset_requested(const node_t *node);

/* Is the heartbeat of 0x1016 overdue? It is watched from its configuration on; true until it is
 * back. */
bool node_host_lost(const node_t *node);

/* The number, from 1, of the first RPDO that is beyond its deadline (pdo.h); 0: none. */
uint8_t node_rpdo_late(const node_t *node);

/* Has the host of 0x1016 started anew since the last node_tick()? */
bool node_host_restarted(const node_t *node);

/* Has NMT reset communication come since the last call? That tick is longer than a period. */
bool node_take_communication_reset(node_t *node);

/* Has another node with our node id been heard since the last call? */
bool node_take_namesake(node_t *node);

/* Has the host given a sign of life since the last call: an RPDO that was accepted, an SDO write to
 * an entry of role command, or the heartbeat of 0x1016? */
bool node_take_commanded(node_t *node);

/* The heartbeat that the node would send now. */
can_frame_t node_heartbeat(const node_t *node);

/* Declares an error present: EMCY frame, error register, history. `code` and `register_bits` come
 * from the generated table, `detail` goes into bytes 3 .. 6 of the frame and the history's high
 * word. An error that is present already is not sent again. */
void node_error_set(node_t *node, uint16_t code, uint8_t register_bits, uint32_t detail);

/* Declares an error, or all of them, gone. The frame "error reset" is sent when something changed.
 */
void node_error_clear(node_t *node, uint16_t code);
void node_error_clear_all(node_t *node);

/* Frames lost because the transmit queue was full, since node_init(). */
uint32_t node_tx_overflow_count(const node_t *node);

#endif
