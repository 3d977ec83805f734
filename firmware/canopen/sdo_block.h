/* sdo_block.h: SDO block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16), both ways, with CRC.
 *
 * A transfer is cut into sub-blocks of numbered segments; only the end of a sub-block is answered,
 * by the number of the last segment that came in order, and what is missing is sent again. A CRC
 * over all bytes ends it, so a value arrives whole or not at all. Part of the protocol of sdo.h,
 * which passes on what belongs here; it knows the dictionary no more than sdo.c does.
 */
#ifndef BOWDEN_CANOPEN_SDO_BLOCK_H
#define BOWDEN_CANOPEN_SDO_BLOCK_H

#include "sdo.h"

/* First bytes of the server's answers to a block download, as sdo_t.answer. */
enum {
    SDO_BLOCK_ACCEPTED = 0xA4, /* with CRC */
    SDO_BLOCK_WRITTEN = 0xA1,
};

/* Is this frame, in this state of the transfer, one of a block transfer? */
bool sdo_block_concerns(const sdo_t *sdo, const can_frame_t *frame);

/* Handles such a frame; as sdo_receive(). */
sdo_request_t sdo_block_receive(sdo_t *sdo, const can_frame_t *frame, uint8_t node_id,
                                frame_queue_t *tx);

/* Lets a block download go on that the dictionary does not refuse. */
void sdo_block_accept(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx);

/* Offers the value in sdo->buffer, sdo->size bytes. */
void sdo_block_offer(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx);

/* Sends a segment of an upload, while the queue has room for what is more urgent. True: sent. */
bool sdo_block_send(sdo_t *sdo, uint8_t node_id, frame_queue_t *tx);

/* CRC of the transfers, x^16 + x^12 + x^5 + 1 from 0, of `count` bytes more. */
uint16_t sdo_block_crc(uint16_t crc, const uint8_t *bytes, uint32_t count);

#endif
