/* clock.h: 168 MHz from the 8 MHz crystal, or from the internal oscillator when it is dead. */
#ifndef BOWDEN_STM32F405_CLOCK_H
#define BOWDEN_STM32F405_CLOCK_H

#include <stdbool.h>

/* Core at 168 MHz, APB1 42 MHz (its timers 84), APB2 84 MHz (its timers 168). */
#define CLOCK_CORE_HZ 168000000u

typedef enum {
    CLOCK_CRYSTAL,
    CLOCK_INTERNAL, /* the crystal did not start in 10 ms: 1 % accurate, BOARD_FAULT_CLOCK */
    CLOCK_FAILED,   /* not even the PLL locks: nothing can run */
} clock_source_t;

/* Starts the clocks; at most 20 ms. With the crystal the clock security system watches: when it
 * stops later the hardware opens the bridge (break) and raises NMI, which ends in crash.c. */
clock_source_t clock_start(void);

#endif
