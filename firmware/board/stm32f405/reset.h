/* reset.h: why this program started, from the reset flags of RCC_CSR (RM0090 7.1, 7.3.21). */
#ifndef BOWDEN_STM32F405_RESET_H
#define BOWDEN_STM32F405_RESET_H

#include "../board.h"

/* Reads the flags and clears them, or they would still stand at the next start: asked once. */
reset_cause_t reset_cause(void);

#endif
