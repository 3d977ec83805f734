/* saving.h: has the board keep the configuration across power-off when a host asks for it.
 *
 * The node makes the image (canopen/storage.h), the board keeps it (board.h); this is the
 * handshake between the two. The host's write is answered when the board has read all of it back,
 * with an abort when it could not, and with "busy" (0800 0021h) when the board must first make
 * room. The log of faults is kept in the same image, without being asked and without touching what
 * else is in it.
 */
#ifndef BOWDEN_DRIVE_SAVING_H
#define BOWDEN_DRIVE_SAVING_H

#include <stdint.h>

#include "../board/board.h"
#include "../canopen/node.h"
#include "../meanings.h"

typedef struct {
    storage_state_t state;
    bool busy;          /* the image is with the board */
    bool began;         /* in this tick: making the image takes longer than a tick has */
    bool for_log;       /* for the log of faults, not for a host */
    bool log_has_grown; /* it is to be kept as soon as the board is free */
    uint32_t words;     /* of the image; 0: nothing was ever kept */
    uint32_t image[BOARD_STORE_WORDS];
} saving_t;

/* Copies what the board has kept; the node takes its configuration from it. Returns what became of
 * it. */
storage_report_t saving_recall(saving_t *saving, node_t *node, const board_identity_t *identity);

/* One tick: takes a request of the node, looks what the board has done, asks it to go on. True in
 * the tick in which a save was done. */
bool saving_step(saving_t *saving, node_t *node, board_store_t board, board_actuators_t *actuators);

#endif
