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

/* Answers the host, unless the save was the drive's own. */
static void end(saving_t *saving, node_t *node, storage_state_t state, od_abort_t abort) {
    saving->busy = false;
    if (!saving->for_log) {
        saving->state = state;
        node_storage_done(node, abort);
    }
}

static void begin(saving_t *saving, node_t *node, storage_request_t request) {
    const uint32_t words =
        storage_update(&node->od, request, saving->image, saving->words, BOARD_STORE_WORDS);
    saving->busy = words > 0;
    saving->began = true;
    if (!saving->busy) {
        end(saving, node, STORAGE_STATE_FAILED, OD_ABORT_NO_ROOM);
        return;
    }
    saving->words = words;
    node->image_words = words;
    saving->state = saving->for_log ? saving->state : STORAGE_STATE_UNDER_WAY;
}

/* The host's request first: it waits for an answer, and saves the log as well. */
static void begin_what_is_due(saving_t *saving, node_t *node) {
    if (node->storage.asked) {
        const storage_request_t request = node->storage;
        node->storage = (storage_request_t){0};
        saving->for_log = false;
        begin(saving, node, request);
    } else if (saving->log_has_grown && !node->od.config_locked) {
        saving->log_has_grown = false;
        saving->for_log = true;
        begin(saving, node, (storage_request_t){.asked = true, .sub = STORAGE_LOG});
    }
}

bool saving_step(saving_t *saving, node_t *node, board_store_t board,
                 board_actuators_t *actuators) {
    const bool done = saving->busy && board == BOARD_STORE_DONE;
    saving->began = false;
    if (done) {
        end(saving, node, STORAGE_STATE_DONE, OD_DONE);
    } else if (saving->busy && board == BOARD_STORE_FAILED) {
        end(saving, node, STORAGE_STATE_FAILED, OD_ABORT_HARDWARE);
    } else if (saving->busy && board == BOARD_STORE_FULL) {
        end(saving, node, STORAGE_STATE_MAKES_ROOM, OD_ABORT_BUSY);
        saving->log_has_grown = saving->log_has_grown || saving->for_log; /* once there is room */
    } else if (!saving->busy && board == BOARD_STORE_IDLE) {
        begin_what_is_due(saving, node);
    }
    actuators->store = saving->busy ? saving->image : NULL;
    actuators->store_words = saving->busy ? saving->words : 0;
    actuators->store_is_log = saving->busy && saving->for_log;
    return done && !saving->for_log;
}
