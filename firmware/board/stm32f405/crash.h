/* crash.h: the end of a program that cannot go on, and what it tells the next one.
 *
 * Every fault exception, NMI (crystal lost), the supply's warning and each interrupt that nobody
 * asked for come to crash_handler(): the bridge is switched off before anything else, without using
 * the stack. Then a record is kept in memory that reset does not clear, and the chip is reset. The
 * next start reports it as a fault of the drive; `make debug` shows it as crash_record.
 */
#ifndef BOWDEN_STM32F405_CRASH_H
#define BOWDEN_STM32F405_CRASH_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint32_t magic;
    uint32_t count;      /* crashes since power-on */
    uint32_t exception;  /* number in IPSR: 2 NMI, 3 HardFault, 16 + n interrupt n */
    uint32_t pc, lr, sp; /* where; 0 when the frame could not be read */
    uint32_t cfsr, hfsr, mmfar, bfar;
    uint32_t fresh; /* not yet reported: 1 */
    uint32_t check; /* over all words before */
} crash_record_t;

/* Why did this start happen? True after a crash or a reset by the watchdog. Asked once: clears
 * the reset flags of RCC and marks the record as reported. */
bool crash_was_abnormal_reset(void);

/* Starts the chip anew, bridge off. */
_Noreturn void crash_restart(void);

#endif
