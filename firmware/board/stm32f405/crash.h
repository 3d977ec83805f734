/* crash.h: the end of a program that cannot continue, and the record that it leaves to the next
 * start.
 *
 * Every fault exception, NMI (crystal lost), the supply's warning and each interrupt that is not
 * enabled come to crash_handler(): the bridge is switched off before anything else, without using
 * the stack. Then a record is kept in memory that reset does not clear, and the chip is reset. The
 * next start reports it as a fault of the drive and in the entry crash_record; `make debug` shows
 * all of it.
 */
#ifndef BOWDEN_STM32F405_CRASH_H
#define BOWDEN_STM32F405_CRASH_H

#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

typedef struct {
    uint32_t magic;
    uint32_t count;      /* crashes since power-on */
    uint32_t exception;  /* number in IPSR: 2 NMI, 3 HardFault, 16 + n interrupt n */
    uint32_t pc, lr, sp; /* where; 0 when the frame could not be read */
    uint32_t cfsr, hfsr, mmfar, bfar;
    uint32_t tick;  /* control ticks from the start to the crash */
    uint32_t fresh; /* not yet reported: 1 */
    uint32_t check; /* over all words before */
} crash_record_t;

/* Did the program before this one end in a crash? Asked once: marks the record as reported. */
bool crash_is_news(void);

/* What the record holds, for the drive; all zero without a crash since power-on. */
board_crash_t crash_report(void);

/* Writes the present tick into the record. */
void crash_note_tick(uint32_t tick);

/* Starts the chip anew, bridge off. */
_Noreturn void crash_restart(void);

#endif
