/* saving.c: see saving.h. */
#include "saving.h"

#include <stddef.h>

storage_report_t saving_recall(saving_t *saving, node_t *node, const board_identity_t *identity) {
    saving->words =
        identity->saved_words <= BOARD_STORE_WORDS ? identity->saved_words : BOARD_STORE_WORDS;
    for (uint32_t i = 0; i < saving->words; i++) {
        saving->image[i] = identity->saved[i];
    }
    storage_report_t report = node_take_image(node, saving->image, saving->words);
    if (identity->saved_state == BOARD_SAVED_DAMAGED && saving->words == 0) {
        report.outcome = CONFIGURATION_ORIGIN_OUTCOME_LOST;
    } else if (identity->saved_state == BOARD_SAVED_DAMAGED) {
        report.outcome = CONFIGURATION_ORIGIN_OUTCOME_OLDER;
    }
    return report;
}

static void begin(saving_t *saving, node_t *node) {
    const uint32_t words =
        storage_update(&node->od, node->storage, saving->image, saving->words, BOARD_STORE_WORDS);
    node->storage = (storage_request_t){0};
    saving->busy = words > 0;
    if (!saving->busy) {
        saving->state = STORAGE_STATE_FAILED;
        node_storage_done(node, OD_ABORT_NO_ROOM);
        return;
    }
    saving->words = words;
    node->image_words = words;
    saving->state = STORAGE_STATE_UNDER_WAY;
}

static void end(saving_t *saving, node_t *node, storage_state_t state, od_abort_t abort) {
    saving->busy = false;
    saving->state = state;
    node_storage_done(node, abort);
}

bool saving_step(saving_t *saving, node_t *node, board_store_t board,
                 board_actuators_t *actuators) {
    const bool done = saving->busy && board == BOARD_STORE_DONE;
    if (done) {
        end(saving, node, STORAGE_STATE_DONE, OD_DONE);
    } else if (saving->busy && board == BOARD_STORE_FAILED) {
        end(saving, node, STORAGE_STATE_FAILED, OD_ABORT_HARDWARE);
    } else if (saving->busy && board == BOARD_STORE_FULL) {
        end(saving, node, STORAGE_STATE_MAKES_ROOM, OD_ABORT_BUSY);
    } else if (!saving->busy && board == BOARD_STORE_IDLE && node->storage.asked) {
        begin(saving, node);
    }
    actuators->store = saving->busy ? saving->image : NULL;
    actuators->store_words = saving->busy ? saving->words : 0;
    return done;
}
