/* saving.c: see saving.h. */
#include "saving.h"

#include <stddef.h>

static void begin(saving_t *saving, node_t *node) {
    const bool defaults = node->storage == STORAGE_DO_RESTORE;
    node->storage = STORAGE_NOTHING;
    saving->words = storage_image(&node->od, defaults, saving->image, BOARD_STORE_WORDS);
    saving->state = saving->words > 0 ? STORAGE_STATE_UNDER_WAY : STORAGE_STATE_FAILED;
}

void saving_step(saving_t *saving, node_t *node, board_store_t board,
                 board_actuators_t *actuators) {
    if (saving->words > 0 && (board == BOARD_STORE_DONE || board == BOARD_STORE_FAILED)) {
        saving->state = board == BOARD_STORE_DONE ? STORAGE_STATE_DONE : STORAGE_STATE_FAILED;
        saving->words = 0;
    } else if (saving->words == 0 && board == BOARD_STORE_IDLE &&
               node->storage != STORAGE_NOTHING) {
        begin(saving, node);
    }
    actuators->store = saving->words > 0 ? saving->image : NULL;
    actuators->store_words = saving->words;
}
