/* pdo.c: see pdo.h. */
#include "pdo.h"

#include <stddef.h>

#include "pdo_guard.h"

#define RPDO_COMMUNICATION 0x1400
#define RPDO_MAPPING 0x1600
#define TPDO_COMMUNICATION 0x1800
#define TPDO_MAPPING 0x1A00
#define MAPPING_OFFSET (TPDO_MAPPING - TPDO_COMMUNICATION)
#define PDO_AREA_END 0x1C00

#define COB_ID_MASK UINT32_C(0x7FF)
#define NOT_VALID (UINT32_C(1) << 31)
#define NO_RTR (UINT32_C(1) << 30)

/* Sub-indices of the communication parameters. */
enum { COB_ID = 1, TYPE = 2, INHIBIT = 3, EVENT = 5 };

#define LAST_SYNC_TYPE 240
#define EVENT_TYPE 254
#define INHIBIT_STEP_US UINT32_C(100)
#define US_PER_MS UINT32_C(1000)

static bool is_event_type(uint32_t type) {
    return type >= EVENT_TYPE;
}

/* COB-IDs that CiA 301 (7.3.5, restricted CAN-IDs) keeps for other services, and SYNC. */
static bool is_restricted(uint32_t id) {
    return id <= 0x080 || (id >= 0x101 && id <= 0x180) || (id >= 0x581 && id <= 0x5FF) ||
           (id >= 0x601 && id <= 0x67F) || id >= 0x6E0;
}

/* The entry that a mapping value names, if it may be mapped there. */
static od_abort_t find_mapped(const od_t *od, uint32_t mapping, bool receives, pdo_slot_t *slot) {
    const uint8_t sub = (uint8_t)(mapping >> 8);
    const od_entry_t *entry = NULL;
    const od_abort_t found = od_find(od, (uint16_t)(mapping >> 16), sub, &entry);
    if (found != OD_DONE) {
        return OD_ABORT_NO_OBJECT;
    }
    if ((entry->flags & (receives ? OD_MAP_RX : OD_MAP_TX)) == 0 ||
        (mapping & 0xFF) != 8 * od_size(entry)) {
        return OD_ABORT_NOT_MAPPABLE;
    }
    *slot = (pdo_slot_t){.entry = entry, .sub = sub};
    return OD_DONE;
}

static od_abort_t check_cob_id(const od_t *od, uint16_t index, uint32_t value) {
    const uint32_t present = od_value(od, index, COB_ID);
    if ((value & ~(COB_ID_MASK | NOT_VALID | NO_RTR)) != 0 || is_restricted(value & COB_ID_MASK)) {
        return OD_ABORT_VALUE;
    }
    const bool stays_valid = ((present | value) & NOT_VALID) == 0;
    return stays_valid && ((present ^ value) & COB_ID_MASK) != 0 ? OD_ABORT_VALUE : OD_DONE;
}

static od_abort_t check_communication(const od_t *od, uint16_t index, uint8_t sub, uint32_t value) {
    switch (sub) {
    case COB_ID:
        return check_cob_id(od, index, value);
    case TYPE:
        return is_event_type(value) ||
                       (value <= LAST_SYNC_TYPE && (value != 0 || index < RPDO_MAPPING))
                   ? OD_DONE
                   : OD_ABORT_VALUE;
    case INHIBIT: /* CiA 301, 7.5.2.37: not while the PDO exists */
        return (od_value(od, index, COB_ID) & NOT_VALID) != 0 ? OD_DONE : OD_ABORT_ACCESS;
    default:
        return OD_DONE;
    }
}

/* The number of mapped entries: each must be valid and all must fit into a frame. */
static od_abort_t check_count(const od_t *od, uint16_t index, uint32_t count) {
    if (count > PDO_SLOTS) {
        return OD_ABORT_PDO_LENGTH;
    }
    uint32_t bits = 0;
    for (uint32_t sub = 1; sub <= count; sub++) {
        const uint32_t mapping = od_value(od, index, (uint8_t)sub);
        pdo_slot_t slot;
        const od_abort_t bad = find_mapped(od, mapping, index < TPDO_COMMUNICATION, &slot);
        if (bad != OD_DONE) {
            return bad;
        }
        bits += mapping & 0xFF;
    }
    return bits > 64 ? OD_ABORT_PDO_LENGTH : OD_DONE;
}

static od_abort_t check_mapping(const od_t *od, uint16_t index, uint8_t sub, uint32_t value) {
    if ((od_value(od, (uint16_t)(index - MAPPING_OFFSET), COB_ID) & NOT_VALID) == 0) {
        return OD_ABORT_ACCESS;
    }
    if (sub == 0) {
        return check_count(od, index, value);
    }
    if (od_value(od, index, 0) != 0) {
        return OD_ABORT_ACCESS;
    }
    pdo_slot_t slot;
    return value == 0 ? OD_DONE : find_mapped(od, value, index < TPDO_COMMUNICATION, &slot);
}

od_abort_t pdo_check(const od_t *od, uint16_t index, uint8_t sub, uint32_t value,
                     bool pre_operational) {
    if (index < RPDO_COMMUNICATION || index >= PDO_AREA_END) {
        return OD_DONE;
    }
    if (!pre_operational) {
        return OD_ABORT_STATE;
    }
    const bool is_mapping =
        index >= TPDO_MAPPING || (index >= RPDO_MAPPING && index < TPDO_COMMUNICATION);
    return is_mapping ? check_mapping(od, index, sub, value)
                      : check_communication(od, index, sub, value);
}

static pdo_map_t read_map(const od_t *od, uint16_t index, bool receives) {
    pdo_map_t map = {.type = (uint8_t)od_value(od, index, TYPE)};
    const uint32_t cob_id = od_value(od, index, COB_ID);
    map.cob_id = (uint16_t)(cob_id & COB_ID_MASK);
    map.exists = cob_id != 0 && (cob_id & NOT_VALID) == 0;
    const uint16_t mapping = (uint16_t)(index + MAPPING_OFFSET);
    const uint32_t count = od_value(od, mapping, 0);
    for (uint32_t i = 0; i < count && i < PDO_SLOTS; i++) {
        const uint32_t value = od_value(od, mapping, (uint8_t)(i + 1));
        if (find_mapped(od, value, receives, &map.slots[i]) != OD_DONE) {
            map.exists = false; /* cannot come from the bus: a defect of the generated defaults */
            return map;
        }
        if ((map.slots[i].entry->flags & OD_GUARD) != 0) {
            map.guarded = true;
            map.guard_at = map.length;
        }
        map.slot_count++;
        map.length = (uint8_t)(map.length + od_size(map.slots[i].entry));
    }
    map.exists = map.exists && map.slot_count > 0 && map.length <= 8;
    return map;
}

void pdo_configure(pdo_t *pdo, const od_t *od) {
    for (uint32_t i = 0; i < PDO_RX_MAX; i++) {
        const uint16_t index = (uint16_t)(RPDO_COMMUNICATION + i);
        pdo->rpdo[i] = (rpdo_t){
            .map = read_map(od, index, true),
            .deadline_us = od_value(od, index, EVENT) * US_PER_MS,
        };
    }
    for (uint32_t i = 0; i < PDO_TX_MAX; i++) {
        const uint16_t index = (uint16_t)(TPDO_COMMUNICATION + i);
        pdo->tpdo[i] = (tpdo_t){
            .map = read_map(od, index, false),
            .inhibit_us = od_value(od, index, INHIBIT) * INHIBIT_STEP_US,
            .event_us = od_value(od, index, EVENT) * US_PER_MS,
        };
    }
    pdo->by_sync = false;
    pdo->rx_end = 0;
    pdo->tx_end = 0;
    for (uint32_t i = 0; i < PDO_RX_MAX; i++) {
        const pdo_map_t *map = &pdo->rpdo[i].map;
        pdo->by_sync = pdo->by_sync || (map->exists && !is_event_type(map->type));
        pdo->rx_end = map->exists ? i + 1u : pdo->rx_end;
    }
    for (uint32_t i = 0; i < PDO_TX_MAX; i++) {
        const pdo_map_t *map = &pdo->tpdo[i].map;
        pdo->by_sync = pdo->by_sync || (map->exists && !is_event_type(map->type));
        pdo->tx_end = map->exists ? i + 1u : pdo->tx_end;
    }
}

void pdo_start(pdo_t *pdo) {
    for (uint32_t i = 0; i < pdo->rx_end; i++) {
        pdo->rpdo[i].waiting = false;
        pdo->rpdo[i].heard = false;
    }
    pdo->late = 0;
    for (uint32_t i = 0; i < pdo->tx_end; i++) {
        tpdo_t *tpdo = &pdo->tpdo[i];
        tpdo->syncs = 0;
        tpdo->sent = false;
        tpdo->wanted = is_event_type(tpdo->map.type);
    }
}

/* All values of a frame or none: a refused one must not leave half a command behind. */
static bool apply(const pdo_map_t *map, const od_t *od, const can_frame_t *frame) {
    uint32_t values[PDO_SLOTS];
    uint32_t start = 0;
    for (uint32_t i = 0; i < map->slot_count; i++) {
        const od_entry_t *entry = map->slots[i].entry;
        values[i] = od_decode(entry, &frame->data[start]);
        start += od_size(entry);
        if (od_check(od, entry, values[i]) != OD_DONE) {
            return false;
        }
    }
    for (uint32_t i = 0; i < map->slot_count; i++) {
        od_set(od, map->slots[i].entry, map->slots[i].sub, values[i]);
    }
    return true;
}

/* Keeps the value of an urgent entry that is in the frame as far as it came. */
static void withhold(pdo_t *pdo, const pdo_map_t *map, const can_frame_t *frame) {
    uint32_t start = 0;
    for (uint32_t i = 0; i < map->slot_count; i++) {
        const od_entry_t *entry = map->slots[i].entry;
        const uint32_t size = od_size(entry);
        if ((entry->flags & OD_URGENT) != 0 && start + size <= frame->length) {
            pdo->withheld = (uint16_t)od_decode(entry, &frame->data[start]);
            pdo->has_withheld = true;
        }
        start += size;
    }
}

bool pdo_take_accepted(pdo_t *pdo) {
    const bool accepted = pdo->accepted;
    pdo->accepted = false;
    return accepted;
}

bool pdo_take_withheld(pdo_t *pdo, uint16_t *value) {
    const bool has = pdo->has_withheld;
    *value = has ? pdo->withheld : *value;
    pdo->has_withheld = false;
    return has;
}

static void accept(pdo_t *pdo, rpdo_t *rpdo, const can_frame_t *frame, uint32_t now_us) {
    pdo->accepted = true;
    rpdo->heard = true;
    rpdo->late = false;
    rpdo->heard_us = now_us;
    rpdo->guard_count = pdo_guard_count(frame, rpdo->map.guard_at);
}

static bool guard_fits(const rpdo_t *rpdo, const can_frame_t *frame) {
    const pdo_map_t *map = &rpdo->map;
    const bool repeated = rpdo->heard && pdo_guard_count(frame, map->guard_at) == rpdo->guard_count;
    return !map->guarded || (!repeated && pdo_guard_crc_fits(frame, map->length, map->guard_at));
}

bool pdo_receive(pdo_t *pdo, const od_t *od, const can_frame_t *frame, uint32_t now_us) {
    bool taken = false;
    for (uint32_t i = 0; i < pdo->rx_end; i++) {
        rpdo_t *rpdo = &pdo->rpdo[i];
        if (!rpdo->map.exists || rpdo->map.cob_id != frame->cob_id) {
            continue;
        }
        taken = true;
        rpdo->too_short = frame->length < rpdo->map.length; /* longer: the rest is ignored */
        if (rpdo->too_short) {
            withhold(pdo, &rpdo->map, frame);
        } else if (!guard_fits(rpdo, frame)) {
            rpdo->refused = true;
            withhold(pdo, &rpdo->map, frame);
        } else if (is_event_type(rpdo->map.type)) {
            rpdo->refused = !apply(&rpdo->map, od, frame);
            if (rpdo->refused) {
                withhold(pdo, &rpdo->map, frame);
            } else {
                accept(pdo, rpdo, frame, now_us);
            }
        } else {
            accept(pdo, rpdo, frame, now_us);
            withhold(pdo, &rpdo->map, frame);
            rpdo->frame = *frame;
            rpdo->waiting = true;
        }
    }
    return taken;
}

bool pdo_sync(pdo_t *pdo, const od_t *od) {
    if (!pdo->by_sync) {
        return false;
    }
    for (uint32_t i = 0; i < pdo->rx_end; i++) {
        rpdo_t *rpdo = &pdo->rpdo[i];
        if (rpdo->waiting) {
            rpdo->waiting = false;
            rpdo->refused = !apply(&rpdo->map, od, &rpdo->frame);
        }
    }
    for (uint32_t i = 0; i < pdo->tx_end; i++) {
        tpdo_t *tpdo = &pdo->tpdo[i];
        if (!tpdo->map.exists || is_event_type(tpdo->map.type)) {
            continue;
        }
        tpdo->syncs++;
        if (tpdo->syncs >= tpdo->map.type) {
            tpdo->syncs = 0;
            tpdo->wanted = true;
        }
    }
    return true;
}

static bool timer_ran_out(const tpdo_t *tpdo, uint32_t now_us) {
    return tpdo->event_us != 0 && is_event_type(tpdo->map.type) &&
           now_us - tpdo->timed_us >= tpdo->event_us;
}

static bool is_due(const tpdo_t *tpdo, uint32_t now_us) {
    if (!tpdo->map.exists || !(tpdo->wanted || timer_ran_out(tpdo, now_us))) {
        return false;
    }
    return !tpdo->sent || now_us - tpdo->sent_us >= tpdo->inhibit_us;
}

bool pdo_due(const pdo_t *pdo, uint32_t now_us) {
    for (uint32_t i = 0; i < pdo->tx_end; i++) {
        if (is_due(&pdo->tpdo[i], now_us)) {
            return true;
        }
    }
    return false;
}

static void send(const tpdo_t *tpdo, const od_t *od, frame_queue_t *tx) {
    can_frame_t frame = {.cob_id = tpdo->map.cob_id, .length = tpdo->map.length};
    uint32_t start = 0;
    for (uint32_t i = 0; i < tpdo->map.slot_count; i++) {
        const pdo_slot_t *slot = &tpdo->map.slots[i];
        const uint32_t size = od_size(slot->entry);
        od_encode(od_get(od, slot->entry, slot->sub), &frame.data[start], size);
        start += size;
    }
    frame_queue_push(tx, &frame);
}

/* Only hearing it again takes `late` back: the wrap of the clock must not. */
static void look_who_is_late(pdo_t *pdo, uint32_t now_us) {
    pdo->late = 0;
    for (uint32_t i = pdo->rx_end; i > 0; i--) {
        rpdo_t *rpdo = &pdo->rpdo[i - 1];
        if (rpdo->deadline_us != 0 && rpdo->heard) {
            rpdo->late = rpdo->late || now_us - rpdo->heard_us > rpdo->deadline_us;
            pdo->late = rpdo->late ? (uint8_t)i : pdo->late;
        }
    }
}

void pdo_tick(pdo_t *pdo, const od_t *od, uint32_t now_us, frame_queue_t *tx) {
    look_who_is_late(pdo, now_us);
    for (uint32_t i = 0; i < pdo->tx_end; i++) {
        tpdo_t *tpdo = &pdo->tpdo[i];
        if (tpdo->sent && now_us - tpdo->sent_us >= tpdo->inhibit_us) {
            tpdo->sent = false; /* dropped now, lest the clock's wrap makes it young again */
        }
        if (!is_due(tpdo, now_us)) {
            continue;
        }
        if (tpdo->wanted) {
            tpdo->timed_us = now_us; /* first of a series: all timers run from here */
        } else {
            tpdo->timed_us += tpdo->event_us; /* keeps the rate although ticks are coarse */
            if (timer_ran_out(tpdo, now_us)) {
                tpdo->timed_us = now_us; /* late by a whole period: no burst */
            }
        }
        tpdo->wanted = false;
        tpdo->sent = true;
        tpdo->sent_us = now_us;
        send(tpdo, od, tx);
    }
}

bool pdo_any_too_short(const pdo_t *pdo) {
    bool any = false;
    for (uint32_t i = 0; i < pdo->rx_end; i++) {
        any = any || pdo->rpdo[i].too_short;
    }
    return any;
}

bool pdo_any_refused(const pdo_t *pdo) {
    bool any = false;
    for (uint32_t i = 0; i < pdo->rx_end; i++) {
        any = any || pdo->rpdo[i].refused;
    }
    return any;
}
