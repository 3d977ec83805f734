/* control.h: the control tick, 4 kHz: from the sensors through the drive to bridge and bus.
 *
 * SysTick (highest priority) latches the sensors every 250 us and asks for the tick, which runs in
 * PendSV (lowest priority), under everything else. All of the drive runs there and only there.
 */
#ifndef BOWDEN_STM32F405_CONTROL_H
#define BOWDEN_STM32F405_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

#include "../../drive/drive.h"

/* Finds what was kept across power-off. */
void control_recall(void);

/* Prepares the drive, with what control_recall() found. `standing_faults` last until power-off (a
 * dead crystal), `first_faults` are for the first tick (why the last program ended): BOARD_FAULT_*
 * bits. */
void control_start(const board_identity_t *identity, uint32_t standing_faults,
                   uint32_t first_faults);

/* Lets SysTick run. The 20 kHz loop must run already; see control.c for the phase. */
void control_run(void);

/* Of the node, once control_start() has been called. */
uint8_t control_node_id(void);
uint16_t control_bit_rate_kbit(void);

/* State of the drive, for the lamp. */
drive_state_t control_state(void);

#endif
