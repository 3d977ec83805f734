/* pdo_guard.c: see pdo_guard.h. */
#include "pdo_guard.h"

/* x^12 + x^11 + x^3 + x^2 + x + 1 (CRC-12 of DECT) finds any three wrong bits of a frame, and all
 * but 1 in 4096 of other changes: at 100 wrong frames a second a drive that gives up after 0.5 s
 * takes one of them in 1 of 80 cases. Eight bits would be 1 of 6. */
#define POLYNOMIAL 0x80Fu
#define TOP 0x800u
#define MASK 0xFFFu
#define GUARD_BYTES 2u
#define COUNT_MASK 0x0Fu

static uint32_t with_byte(uint32_t crc, uint32_t byte) {
    uint32_t rest = crc ^ byte << 4;
    for (uint32_t bit = 0; bit < 8; bit++) {
        rest = (rest & TOP) != 0 ? rest << 1 ^ POLYNOMIAL : rest << 1;
    }
    return rest & MASK;
}

uint8_t pdo_guard_count(const can_frame_t *frame, uint32_t at) {
    return frame->data[at] & COUNT_MASK;
}

bool pdo_guard_crc_fits(const can_frame_t *frame, uint32_t length, uint32_t at) {
    uint32_t crc = with_byte(0, frame->cob_id & 0xFFu);
    crc = with_byte(crc, (uint32_t)frame->cob_id >> 8);
    for (uint32_t i = 0; i < length; i++) {
        const bool own = i >= at && i < at + GUARD_BYTES;
        crc = own ? crc : with_byte(crc, frame->data[i]);
    }
    crc = with_byte(crc, pdo_guard_count(frame, at));
    return crc == ((uint32_t)frame->data[at] >> 4 | (uint32_t)frame->data[at + 1u] << 4);
}
