/* can.h: the CAN controller (bxCAN): 125 kbit/s to 1 Mbit/s, hardware filters, a receive ring,
 * three mailboxes.
 *
 * Received frames are put into a ring by an interrupt, so that bursts outlive the three-deep FIFO;
 * the control tick takes them out. Frames are sent from the control tick alone: three mailboxes
 * last longer than its period at 1 Mbit/s, and they leave in the order in which they came.
 */
#ifndef BOWDEN_STM32F405_CAN_H
#define BOWDEN_STM32F405_CAN_H

#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

#define CAN_RPDOS 4

/* Starts the controller for NMT, SYNC, the node's SDO requests and all heartbeats. On a bus where
 * this does not complete, can_tick() continues it and reports bus-off meanwhile. */
void can_start(uint8_t node_id, uint16_t bit_rate_kbit);

/* Receives these identifiers too; 0 is none. Costs nothing while they stay the same. */
void can_listen(const uint16_t cob_ids[CAN_RPDOS]);

/* Once every control tick: recovers from bus-off, at most ten times a second. Returns
 * BOARD_FAULT_* bits. */
uint32_t can_tick(void);

/* Once every control tick, after can_tick(); `off`: that has reported bus-off. Does the bus take
 * our frames? What waits for 10 ms, and at bus-off at once, is taken back and will not be sent. */
board_bus_t can_bus(bool off);

/* Takes the oldest received frame; false when there is none. */
bool can_take(can_frame_t *frame);

/* Is a mailbox free? Then can_send() takes a frame. */
bool can_ready(void);

/* Has every frame left? */
bool can_is_idle(void);

/* Forgets the frames that were lost up to now. */
void can_forget_overrun(void);

void can_send(const can_frame_t *frame);

#endif
