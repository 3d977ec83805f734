/* node.c: the node's parts put together; see node.h. */
#include "node.h"

#include <stddef.h>

#define SYNC_COB_ID 0x80
#define ERROR_HISTORY 0x1003
#define EMCY_INHIBIT_TIME 0x1015
#define CONSUMER_HEARTBEAT 0x1016
#define PRODUCER_HEARTBEAT 0x1017
#define PDO_AREA_BEGIN 0x1400
#define PDO_AREA_END 0x1C00

/* A boot-up message that the bus has not dropped by then has been sent: 50 ms, several times what
 * a board waits for an acknowledge. */
#define ANNOUNCED_US UINT32_C(50000)

/* Lets the parts take their parameters from the dictionary. */
static void configure_parts(node_t *node) {
    heartbeat_configure(&node->heartbeat, &node->od, node->now_us);
    emcy_configure(&node->emcy, &node->od);
    pdo_configure(&node->pdo, &node->od);
}

static void boot_up(node_t *node) {
    configure_parts(node);
    node->sdo.transfer = SDO_IDLE;
    node->lss = (lss_t){0};
    node->nmt.state = NMT_PRE_OPERATIONAL;
    heartbeat_send(node->od.node_id, NMT_INITIALISING, &node->tx);
    node->announced = false;
    node->booted_us = node->now_us;
}

void node_init(node_t *node, const od_entry_t *entries, uint16_t count, void *values,
               uint8_t node_id, uint32_t now_us) {
    *node = (node_t){
        .od = {.entries = entries, .count = count, .values = values, .node_id = node_id},
        .now_us = now_us,
    };
    od_set_initial(&node->od);
    boot_up(node);
}

storage_report_t node_take_image(node_t *node, const uint32_t *image, uint32_t words) {
    node->image = image;
    node->image_words = words;
    const storage_report_t report = storage_take(&node->od, image, words, false);
    configure_parts(node);
    return report;
}

void node_storage_done(node_t *node, od_abort_t abort) {
    if (node->lss.storing && !node->storage.asked) {
        const can_frame_t answer =
            lss_stored(&node->lss, abort == OD_DONE ? LSS_FINE : LSS_STORE_FAILED);
        frame_queue_push(&node->tx, &answer);
    } else if (node->sdo.transfer == SDO_WAITING) { /* else a reset communication has ended it */
        node->sdo.transfer = SDO_IDLE;
        sdo_answer_write(&node->sdo, abort, node->od.node_id, &node->tx);
    }
}

static void receive_nmt(node_t *node, const can_frame_t *frame) {
    switch (nmt_receive(&node->nmt, frame, node->od.node_id)) {
    case NMT_CHANGED:
        if (node->nmt.state == NMT_OPERATIONAL) {
            pdo_start(&node->pdo);
        } else if (node->nmt.state == NMT_STOPPED) {
            node->sdo.transfer = SDO_IDLE; /* no SDO in stopped: forget what was going on */
        }
        break;
    case NMT_RESET_COMMUNICATION:
        od_reset_communication(&node->od);
        (void)storage_take(&node->od, node->image, node->image_words, true);
        boot_up(node);
        node->communication_reset = true;
        break;
    case NMT_RESET_NODE: /* node_reset_requested() tells the drive */
    case NMT_NOTHING:
    default:
        break;
    }
}

static od_abort_t read_object(node_t *node) {
    sdo_t *sdo = &node->sdo;
    /* CiA 301, 7.5.2.4: places of the history without an error have no data. */
    if (sdo->index == ERROR_HISTORY && sdo->sub > od_value(&node->od, ERROR_HISTORY, 0)) {
        const od_entry_t *entry = NULL;
        const od_abort_t found = od_find(&node->od, sdo->index, sdo->sub, &entry);
        return found != OD_DONE ? found : OD_ABORT_NO_DATA;
    }
    return od_read(&node->od, sdo->index, sdo->sub, sdo->buffer, SDO_BUFFER_SIZE, &sdo->size);
}

/* Can a write of this size, whose value is yet to come, succeed at all? */
static od_abort_t check_begin(const node_t *node) {
    const sdo_t *sdo = &node->sdo;
    const od_entry_t *entry = NULL;
    const od_abort_t found = od_find(&node->od, sdo->index, sdo->sub, &entry);
    if (found != OD_DONE) {
        return found;
    }
    if ((entry->flags & OD_WRITE) == 0) {
        return OD_ABORT_READ_ONLY;
    }
    if (sdo->size_given && sdo->size != od_size(entry)) {
        return sdo->size > od_size(entry) ? OD_ABORT_TOO_LONG : OD_ABORT_TOO_SHORT;
    }
    return od_is_locked(&node->od, entry) ? OD_ABORT_STATE : OD_DONE;
}

/* Lets the part that `index` belongs to take its changed parameters. */
static void reconfigure(node_t *node, uint16_t index) {
    if (index == EMCY_INHIBIT_TIME) {
        emcy_configure(&node->emcy, &node->od);
    } else if (index == CONSUMER_HEARTBEAT || index == PRODUCER_HEARTBEAT) {
        heartbeat_configure(&node->heartbeat, &node->od, node->now_us);
    } else if (index >= PDO_AREA_BEGIN && index < PDO_AREA_END) {
        pdo_configure(&node->pdo, &node->od);
    }
}

static od_abort_t write_object(node_t *node) {
    sdo_t *sdo = &node->sdo;
    const od_entry_t *entry = NULL;
    od_abort_t abort = od_find(&node->od, sdo->index, sdo->sub, &entry);
    if (abort != OD_DONE) {
        return abort;
    }
    if (!sdo->size_given) { /* an expedited write, of four bytes, may leave its size out */
        sdo->size = od_size(entry) < 4u ? od_size(entry) : 4u;
    }
    if (entry->type == OD_DOMAIN && sdo->size == od_size(entry)) {
        abort = od_check(&node->od, entry, 0);
        sdo->transfer = abort == OD_DONE ? SDO_WAITING : sdo->transfer;
        return abort;
    }
    if ((entry->flags & OD_WRITE) != 0 && sdo->size == od_size(entry)) {
        const uint32_t value = od_decode(entry, sdo->buffer);
        const storage_request_t request = storage_request(sdo->index, sdo->sub);
        if (request.asked) { /* the signature is no value: a read stays what it is */
            abort = node->lss.storing ? OD_ABORT_BUSY : storage_check(&node->od, sdo->index, value);
            if (abort == OD_DONE) {
                node->storage = request;
                sdo->transfer = SDO_WAITING;
            }
            return abort;
        }
        abort = pdo_check(&node->od, sdo->index, sdo->sub, value,
                          node->nmt.state == NMT_PRE_OPERATIONAL);
    }
    if (abort == OD_DONE) {
        abort = od_write(&node->od, sdo->index, sdo->sub, sdo->buffer, sdo->size);
    }
    if (abort == OD_DONE) {
        node->commanded |= entry->role == OD_COMMAND;
        reconfigure(node, sdo->index);
    }
    return abort;
}

const uint8_t *node_offered(const node_t *node, uint16_t *index, uint8_t *sub) {
    const sdo_t *sdo = &node->sdo;
    const od_entry_t *entry = NULL;
    const bool waits = sdo->transfer == SDO_WAITING &&
                       od_find(&node->od, sdo->index, sdo->sub, &entry) == OD_DONE &&
                       entry->type == OD_DOMAIN;
    *index = sdo->index;
    *sub = sdo->sub;
    return waits ? sdo->buffer : NULL;
}

void node_answer_offer(node_t *node, od_abort_t abort) {
    sdo_t *sdo = &node->sdo;
    sdo->transfer = SDO_IDLE;
    const od_abort_t found = abort == OD_DONE
                                 ? od_write(&node->od, sdo->index, sdo->sub, sdo->buffer, sdo->size)
                                 : abort;
    sdo_answer_write(sdo, found, node->od.node_id, &node->tx);
}

/* Answers a write, unless the drive will. */
static void finish_write(node_t *node, od_abort_t abort) {
    if (node->sdo.transfer != SDO_WAITING) {
        sdo_answer_write(&node->sdo, abort, node->od.node_id, &node->tx);
    }
}

static void receive_sdo(node_t *node, const can_frame_t *frame) {
    const uint8_t node_id = node->od.node_id;
    switch (sdo_receive(&node->sdo, frame, node_id, node->now_us, &node->tx)) {
    case SDO_READ:
        sdo_answer_read(&node->sdo, read_object(node), node_id, &node->tx);
        break;
    case SDO_BEGIN_WRITE:
        sdo_answer_write(&node->sdo, check_begin(node), node_id, &node->tx);
        break;
    case SDO_WRITE:
        finish_write(node, write_object(node));
        break;
    case SDO_NOTHING:
    default:
        break;
    }
}

static void receive_lss(node_t *node, const can_frame_t *frame) {
    can_frame_t answer;
    const bool busy = node->sdo.transfer == SDO_WAITING; /* an SDO client stores */
    switch (lss_receive(&node->lss, &node->od, frame, &answer)) {
    case LSS_STORE:
        if (!busy) {
            node->storage = (storage_request_t){.asked = true, .sub = STORAGE_LINK};
            break;
        }
        answer = lss_stored(&node->lss, LSS_STORE_FAILED);
        frame_queue_push(&node->tx, &answer);
        break;
    case LSS_ANSWER:
        frame_queue_push(&node->tx, &answer);
        break;
    case LSS_NOTHING:
    default:
        break;
    }
}

static void set_or_clear(node_t *node, bool present, uint16_t code, const can_frame_t *frame) {
    if (present) {
        const uint32_t detail = (uint32_t)frame->cob_id | (uint32_t)frame->length << 16;
        node_error_set(node, code, NODE_ERROR_REGISTER, detail);
    } else {
        node_error_clear(node, code);
    }
}

static void receive_process_data(node_t *node, const can_frame_t *frame) {
    const bool news = frame->cob_id == SYNC_COB_ID
                          ? pdo_sync(&node->pdo, &node->od)
                          : pdo_receive(&node->pdo, &node->od, frame, node->now_us);
    if (!news) {
        return;
    }
    set_or_clear(node, pdo_any_too_short(&node->pdo), NODE_ERROR_PDO_LENGTH, frame);
    set_or_clear(node, pdo_any_refused(&node->pdo), NODE_ERROR_PROTOCOL, frame);
}

void node_receive(node_t *node, const can_frame_t *frame) {
    const uint8_t state = node->nmt.state;
    if (state == NMT_INITIALISING || frame->length > 8) {
        return;
    }
    if (frame->cob_id == 0) {
        receive_nmt(node, frame);
    } else if (frame->cob_id == SDO_RX_COB_ID + node->od.node_id) {
        if (state != NMT_STOPPED) {
            receive_sdo(node, frame);
        }
    } else if (frame->cob_id == LSS_RX_COB_ID) {
        receive_lss(node, frame);
    } else if (frame->cob_id > HEARTBEAT_COB_ID) {
        const bool namesake = frame->cob_id == HEARTBEAT_COB_ID + node->od.node_id;
        node->namesake |= namesake;
        node->lss.disputed |= namesake;
        node->commanded |= heartbeat_receive(&node->heartbeat, frame, node->now_us);
    } else if (state == NMT_OPERATIONAL) {
        receive_process_data(node, frame);
    }
}

bool node_take_withheld(node_t *node, uint16_t *value) {
    return pdo_take_withheld(&node->pdo, value);
}

bool node_sample_due(const node_t *node, uint32_t now_us) {
    return node->nmt.state == NMT_OPERATIONAL && pdo_due(&node->pdo, now_us);
}

void node_follow_bus(node_t *node, board_bus_t bus) {
    const bool was_lost = node->bus != BOARD_BUS_FINE;
    node->bus = bus;
    if (bus == BOARD_BUS_FINE) {
        if (was_lost) {
            emcy_repeat(&node->emcy, &node->od);
        }
        return;
    }
    frame_queue_clear(&node->tx);
    node->sdo.transfer = SDO_IDLE;
    node->booted_us = node->now_us;
    if (bus == BOARD_BUS_DROPPED) {
        heartbeat_send(node->od.node_id, node->announced ? node->nmt.state : NMT_INITIALISING,
                       &node->tx);
    }
}

/* What time demands while the bus takes nothing: all timers run, nothing is queued. */
static void tick_without_bus(node_t *node) {
    frame_queue_t unsent;
    frame_queue_start(&unsent);
    if (node->nmt.state == NMT_OPERATIONAL) {
        pdo_tick(&node->pdo, &node->od, node->now_us, &unsent);
    }
    heartbeat_tick(&node->heartbeat, node->od.node_id, node->nmt.state, node->now_us, &unsent);
    emcy_tick(&node->emcy, node->od.node_id, false, node->now_us, &unsent);
}

void node_tick(node_t *node, uint32_t now_us) {
    const uint8_t node_id = node->od.node_id;
    const uint8_t state = node->nmt.state;
    node->now_us = now_us;
    if (state == NMT_INITIALISING) {
        return;
    }
    if (node->bus != BOARD_BUS_FINE) {
        tick_without_bus(node);
        return;
    }
    node->announced |= now_us - node->booted_us >= ANNOUNCED_US;
    if (state == NMT_OPERATIONAL) {
        pdo_tick(&node->pdo, &node->od, now_us, &node->tx);
    }
    heartbeat_tick(&node->heartbeat, node_id, state, now_us, &node->tx);
    emcy_tick(&node->emcy, node_id, state != NMT_STOPPED, now_us, &node->tx);
    sdo_tick(&node->sdo, node_id, now_us, &node->tx);
}

bool node_transmit(node_t *node, can_frame_t *frame) {
    return frame_queue_pop(&node->tx, frame);
}

uint8_t node_state(const node_t *node) {
    return node->nmt.state;
}

bool node_reset_requested(const node_t *node) {
    return node->nmt.state == NMT_INITIALISING;
}

uint8_t node_rpdo_late(const node_t *node) {
    return node->nmt.state == NMT_OPERATIONAL ? node->pdo.late : 0;
}

bool node_host_lost(const node_t *node) {
    return node->heartbeat.lost;
}

bool node_host_restarted(const node_t *node) {
    return node->heartbeat.restarted;
}

bool node_take_communication_reset(node_t *node) {
    const bool reset = node->communication_reset;
    node->communication_reset = false;
    return reset;
}

bool node_take_namesake(node_t *node) {
    const bool namesake = node->namesake;
    node->namesake = false;
    return namesake;
}

bool node_take_commanded(node_t *node) {
    const bool commanded = pdo_take_accepted(&node->pdo) || node->commanded;
    node->commanded = false;
    return commanded;
}

can_frame_t node_heartbeat(const node_t *node) {
    return heartbeat_frame(node->od.node_id, node->nmt.state);
}

void node_error_set(node_t *node, uint16_t code, uint8_t register_bits, uint32_t detail) {
    emcy_set(&node->emcy, &node->od,
             (emcy_error_t){.code = code, .register_bits = register_bits, .detail = detail});
}

void node_error_clear(node_t *node, uint16_t code) {
    emcy_clear(&node->emcy, &node->od, code);
}

void node_error_clear_all(node_t *node) {
    emcy_clear_all(&node->emcy, &node->od);
}

uint32_t node_tx_overflow_count(const node_t *node) {
    return node->tx.overflow_count;
}
