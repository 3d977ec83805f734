/* protection.h: what the program may not do to memory, and the supply below which nothing runs. */
#ifndef BOWDEN_STM32F405_PROTECTION_H
#define BOWDEN_STM32F405_PROTECTION_H

#include <stdbool.h>

/* Memory protection: flash is read-only, SRAM and registers never executed, a guard of 256 bytes
 * below the stack, everything else (address 0 too) forbidden. A violation ends in crash.c. */
void protection_start_memory(void);

/* Lets the program write to the storage area of flash.h, or no longer. */
void protection_open_storage(bool open);

/* Lets the code in SRAM (erase.h) be executed, or no longer. */
void protection_open_sram_code(bool open);

/* Supply supervision: waits until the chip has 2.9 V; from then on a drop below is a crash. The
 * brown-out reset of the option bytes (docs/hardware.md: set to level 3 when flashing) is the
 * second line; it also works when the program does not. */
void protection_start_supply(void);

#endif
