/* emcy.h: which errors are present, and their EMCY frames (CiA 301, 7.2.7).
 *
 * An error is set once and stays present until it is cleared; both send one EMCY frame, so a
 * condition that is found in every tick does not flood the bus. Frames keep the inhibit time
 * (0x1015). The error register (0x1001) is the union of what is present; the history (0x1003)
 * keeps what was set, newest first.
 *
 * Frame: code, error register, detail (4 bytes), age: how long ago it was, in 10 ms, 255 for 2.55 s
 * and more. A frame that had to wait for the bus so still tells when.
 */
#ifndef BOWDEN_CANOPEN_EMCY_H
#define BOWDEN_CANOPEN_EMCY_H

#include "frame_queue.h"
#include "od.h"

#define EMCY_COB_ID 0x80
#define EMCY_PRESENT_MAX 16 /* different errors present at a time; more only go to the history */
#define EMCY_WAITING_MAX 8  /* frames that wait for the inhibit time */

/* Errors that the node itself finds (CiA 301, table 26). */
enum {
    NODE_ERROR_PROTOCOL = 0x8200,   /* an RPDO carries a value that the drive refuses */
    NODE_ERROR_PDO_LENGTH = 0x8210, /* an RPDO is shorter than its mapping */
    NODE_ERROR_REGISTER = 0x11,     /* generic and communication bit, for both */
};

typedef struct {
    uint16_t code;
    uint8_t register_bits;
    uint32_t detail;
    uint32_t time_us; /* set by this part */
} emcy_error_t;

typedef struct {
    emcy_error_t present[EMCY_PRESENT_MAX];
    uint8_t present_count;
    emcy_error_t waiting[EMCY_WAITING_MAX]; /* register_bits: of the whole register at that time */
    uint8_t waiting_count;
    bool inhibited; /* a frame was sent less than the inhibit time ago */
    uint32_t sent_us;
    uint32_t inhibit_us;
    uint32_t now_us; /* of the last emcy_tick() */
} emcy_t;

/* Takes the inhibit time from the dictionary. */
void emcy_configure(emcy_t *emcy, const od_t *od);

/* An error has come; nothing happens if it is present already. */
void emcy_set(emcy_t *emcy, const od_t *od, emcy_error_t error);

/* An error has gone; nothing happens if it was not present. */
void emcy_clear(emcy_t *emcy, const od_t *od, uint16_t code);

/* All errors have gone. */
void emcy_clear_all(emcy_t *emcy, const od_t *od);

/* Sends every present error again, with its age: frames may have been lost. */
void emcy_repeat(emcy_t *emcy, const od_t *od);

/* Sends the next waiting frame when the inhibit time allows it, `allowed` (not stopped), and there
 * is room: on a blocked bus the cause must not be lost. */
void emcy_tick(emcy_t *emcy, uint8_t node_id, bool allowed, uint32_t now_us, frame_queue_t *tx);

#endif
