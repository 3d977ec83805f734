/* saving.h: has the board keep the configuration across power-off when a host asks for it.
 *
 * The node makes the image (canopen/storage.h), the board keeps it (board.h); this is the
 * handshake between the two. One save at a time; asked for while one is under way, the next
 * follows with the values of then.
 */
#ifndef BOWDEN_DRIVE_SAVING_H
#define BOWDEN_DRIVE_SAVING_H

#include <stdint.h>

#include "../board/board.h"
#include "../canopen/node.h"
#include "../meanings.h"

typedef struct {
    storage_state_t state;
    uint32_t words; /* of the image; 0: nothing given to the board */
    uint32_t image[BOARD_STORE_WORDS];
} saving_t;

/* One tick: takes a request of the node, looks what the board has done, asks it to go on. */
void saving_step(saving_t *saving, node_t *node, board_store_t board, board_actuators_t *actuators);

#endif
