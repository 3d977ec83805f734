/* sdo_frames.h: the frames that the SDO server sends, for its two protocols: sdo.c (expedited and
 * segmented) and sdo_block.c. Not for others.
 */
#ifndef BOWDEN_CANOPEN_SDO_FRAMES_H
#define BOWDEN_CANOPEN_SDO_FRAMES_H

#include "sdo.h"

#define SDO_SEGMENT_BYTES 7u

/* Eight bytes on the server's COB-ID. */
void sdo_send(uint8_t node_id, const uint8_t data[8], frame_queue_t *tx);

/* An answer that starts with command, index and sub, then 4 bytes. */
void sdo_send_addressed(const sdo_t *sdo, uint8_t command, uint32_t value, uint8_t node_id,
                        frame_queue_t *tx);

/* Ends the transfer and says why. */
void sdo_abort(sdo_t *sdo, od_abort_t code, uint8_t node_id, frame_queue_t *tx);

/* Takes index and sub of the frame that begins a transfer; one that was in progress ends. */
void sdo_begin(sdo_t *sdo, const can_frame_t *frame);

/* Bytes 4 .. 7 of a frame that begins a transfer: the size. */
uint32_t sdo_announced_size(const can_frame_t *frame);

#endif
