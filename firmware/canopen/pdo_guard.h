/* pdo_guard.h: a count and a checksum in an RPDO, against frames that are repeated or wrong.
 *
 * CAN checks what is on the wire. A host's frame can be wrong before that: changed in a buffer, or
 * sent again and again by an adapter whose program hangs. A master that wants to be told maps the
 * guard, an entry with OD_GUARD, into its RPDO and fills it where the command is made. Then the
 * drive refuses a frame whose CRC does not fit, or whose count is that of the last frame taken.
 * Lost frames are no matter: counts may jump.
 */
#ifndef BOWDEN_CANOPEN_PDO_GUARD_H
#define BOWDEN_CANOPEN_PDO_GUARD_H

#include "../board/board.h"

/* The count in the guard at data[at]. */
uint8_t pdo_guard_count(const can_frame_t *frame, uint32_t at);

/* Does the checksum of the guard at data[at] fit the mapped bytes, data[0 .. length - 1]?
 * at + 2 <= length <= 8. */
bool pdo_guard_crc_fits(const can_frame_t *frame, uint32_t length, uint32_t at);

#endif
