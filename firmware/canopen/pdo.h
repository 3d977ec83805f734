/* pdo.h: process data: RPDOs into the dictionary, TPDOs out of it, SYNC (CiA 301, 7.2.2 and 7.2.5).
 *
 * Parameters live in the dictionary (0x1400 .., 0x1600 .., 0x1800 .., 0x1A00 ..) and are changed by
 * the procedure of CiA 301: in pre-operational, disable the PDO (bit 31 of its COB-ID), set the
 * number of mapped entries to 0, write them, write their number, enable the PDO. pdo_check()
 * refuses everything else. From there pdo_configure() takes them into the tables here, so that a
 * tick does no lookups. Entries are mapped whole, in bytes.
 *
 * TPDO types: 1 .. 240 at every n-th SYNC; 254, 255 by their event timer. All TPDOs that are sent
 * in one tick hold values of that tick. RPDO types: 0 .. 240 at the next SYNC, 254, 255 at once.
 * An RPDO is taken whole or not at all: not when it is too short, has a guard that does not fit
 * (pdo_guard.h) or carries a value that the dictionary refuses, and not yet when it waits for SYNC.
 * The value of an urgent entry (OD_URGENT) in such a frame is withheld: the drive takes it with
 * pdo_take_withheld() and decides itself. An RPDO with an event timer has a deadline (CiA
 * 301, 7.5.2.35): once one was accepted after NMT start, the next must be within it. Whether the
 * host comes at all is not watched here. PDOs without entries are not sent. Remote frames, type 0,
 * 252, 253 and the SYNC start value do not exist.
 */
#ifndef BOWDEN_CANOPEN_PDO_H
#define BOWDEN_CANOPEN_PDO_H

#include "frame_queue.h"
#include "od.h"

#define PDO_RX_MAX 4
#define PDO_TX_MAX 8
#define PDO_SLOTS 8 /* mapped entries in a PDO */

typedef struct {
    const od_entry_t *entry;
    uint8_t sub;
} pdo_slot_t;

typedef struct {
    bool exists;
    uint16_t cob_id;
    uint8_t type;
    uint8_t length;   /* bytes */
    bool guarded;     /* pdo_guard.h */
    uint8_t guard_at; /* first byte of the guard */
    uint8_t slot_count;
    pdo_slot_t slots[PDO_SLOTS];
} pdo_map_t;

typedef struct {
    pdo_map_t map;
    bool waiting; /* a frame that waits for SYNC */
    bool too_short;
    bool refused; /* the last frame had a value that the dictionary refuses, or a wrong guard */
    bool heard;   /* one was accepted since NMT start: its deadline runs */
    bool late;
    uint32_t deadline_us; /* 0: none */
    uint32_t heard_us;
    uint8_t guard_count; /* of the last frame that was accepted */
    can_frame_t frame;
} rpdo_t;

typedef struct {
    pdo_map_t map;
    uint32_t event_us;   /* 0: no event timer */
    uint32_t inhibit_us; /* 0: none */
    uint8_t syncs;       /* counted since it was sent */
    bool wanted;         /* by SYNC, or first after the start */
    bool sent;           /* less than the inhibit time ago */
    uint32_t timed_us;   /* when its event timer has last run out */
    uint32_t sent_us;
} tpdo_t;

typedef struct {
    bool accepted; /* an RPDO was taken, or waits for SYNC, since pdo_take_accepted() */
    bool by_sync;  /* any PDO follows SYNC */
    uint8_t late;  /* number, from 1, of the first RPDO that is late; 0: none */
    bool has_withheld;
    uint16_t withheld;       /* value of the urgent entry in the last frame that was not taken */
    uint32_t rx_end, tx_end; /* behind the last that exists: no tick looks further */
    rpdo_t rpdo[PDO_RX_MAX];
    tpdo_t tpdo[PDO_TX_MAX];
} pdo_t;

/* May the bus write `value` to a PDO parameter? `pre_operational`: the node is in that state.
 * Other entries are always allowed. Range and access are od_check()'s business. */
od_abort_t pdo_check(const od_t *od, uint16_t index, uint8_t sub, uint32_t value,
                     bool pre_operational);

/* Takes all parameters from the dictionary. */
void pdo_configure(pdo_t *pdo, const od_t *od);

/* The node has entered operational: all event-driven TPDOs are sent in the next tick. */
void pdo_start(pdo_t *pdo);

/* Handles a frame that may be an RPDO. Returns true if it is one. */
bool pdo_receive(pdo_t *pdo, const od_t *od, const can_frame_t *frame, uint32_t now_us);

/* Handles a SYNC: applies waiting RPDOs, marks the TPDOs whose turn it is. False: no PDO follows
 * SYNC, and nothing has changed. */
bool pdo_sync(pdo_t *pdo, const od_t *od);

/* Will pdo_tick() send anything? */
bool pdo_due(const pdo_t *pdo, uint32_t now_us);

/* Sends every TPDO that is due and looks which RPDO is late. */
void pdo_tick(pdo_t *pdo, const od_t *od, uint32_t now_us, frame_queue_t *tx);

/* Has an RPDO been accepted since the last call? */
bool pdo_take_accepted(pdo_t *pdo);

/* Takes the withheld value of the urgent entry; false when there is none. */
bool pdo_take_withheld(pdo_t *pdo, uint16_t *value);

/* Was the last frame of any RPDO shorter than its mapping? Or refused for a value in it? */
bool pdo_any_too_short(const pdo_t *pdo);
bool pdo_any_refused(const pdo_t *pdo);

#endif
