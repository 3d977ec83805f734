/* flash.h: the flash driver: erases and programs the two sectors that keep the configuration.
 *
 * The program itself cannot be reached: a sector is named by its number in the storage area, and
 * only that area is made writable, and only while a word is programmed. While the flash works, the
 * core waits for its next instruction: 16 us (at most 100) for a word, about a second (at most 2)
 * for a sector. So words go one a tick with the bridge off, and erasing is erase.h's business.
 * RM0090 chapter 3; 2.7 to 3.6 V, 32 bits at a time.
 */
#ifndef BOWDEN_STM32F405_FLASH_H
#define BOWDEN_STM32F405_FLASH_H

#include <stdbool.h>
#include <stdint.h>

#define FLASH_SECTORS 2u
#define FLASH_SECTOR_WORDS 32768u
#define FLASH_BLANK UINT32_C(0xFFFFFFFF)

/* sector 0 .. FLASH_SECTORS - 1; word 0 .. FLASH_SECTOR_WORDS - 1. */
uint32_t flash_word(uint32_t sector, uint32_t word);

/* False: the flash reported an error or the word reads back as something else. */
bool flash_program(uint32_t sector, uint32_t word, uint32_t value);

/* Before and after the erasing of a sector, 0 .. FLASH_SECTORS - 1, that erase.h starts between. */
void flash_prepare_erase(uint32_t sector);
void flash_finish_erase(void);

/* What is read next is what the flash holds, not what the cache does. */
void flash_forget_cached_data(void);

#endif
