/* flash.c: see flash.h. The storage area is sectors 10 and 11, the last 256 KiB. */
#include "flash.h"

#include "protection.h"
#include "registers.h"

#define AREA 0x080C0000u
#define FIRST_SECTOR 10u

/* Waits of a program: many times the longest, in turns of a few cycles. The core stalls anyway; the
 * bound is for a flash that never comes back. */
#define WORD_TURNS 100000u

static volatile uint32_t *place(uint32_t sector, uint32_t word) {
    return (volatile uint32_t *)(uintptr_t)(AREA + 4u * (sector * FLASH_SECTOR_WORDS + word));
}

static bool is_inside(uint32_t sector, uint32_t word) {
    return sector < FLASH_SECTORS && word < FLASH_SECTOR_WORDS;
}

uint32_t flash_word(uint32_t sector, uint32_t word) {
    return is_inside(sector, word) ? *place(sector, word) : FLASH_BLANK;
}

static bool finished(void) {
    for (uint32_t turn = 0; turn < WORD_TURNS && (FLASH->SR & FLASH_SR_BSY) != 0; turn++) {
    }
    return (FLASH->SR & (FLASH_SR_BSY | FLASH_SR_ERRORS)) == 0;
}

/* A wrong key would lock the flash until the next reset: the sequence is whole or not begun. */
static void unlock(void) {
    FLASH->SR = FLASH_SR_ERRORS;
    if ((FLASH->CR & FLASH_CR_LOCK) != 0) {
        FLASH->KEYR = FLASH_KEYR_KEY1;
        FLASH->KEYR = FLASH_KEYR_KEY2;
    }
}

bool flash_program(uint32_t sector, uint32_t word, uint32_t value) {
    if (!is_inside(sector, word)) {
        return false;
    }
    unlock();
    FLASH->CR = FLASH_CR_PSIZE_WORD | FLASH_CR_PG;
    protection_open_storage(true);
    *place(sector, word) = value;
    core_barrier();
    const bool fine = finished();
    protection_open_storage(false);
    FLASH->CR = FLASH_CR_LOCK;
    return fine && *place(sector, word) == value;
}

/* Programming updates the data cache, erasing does not (3.4.2). */
void flash_forget_cached_data(void) {
    FLASH->ACR &= ~FLASH_ACR_DCEN;
    FLASH->ACR |= FLASH_ACR_DCRST;
    FLASH->ACR &= ~FLASH_ACR_DCRST;
    FLASH->ACR |= FLASH_ACR_DCEN;
}

void flash_prepare_erase(uint32_t sector) {
    unlock();
    FLASH->CR = FLASH_CR_PSIZE_WORD | FLASH_CR_SER | FLASH_CR_SNB(FIRST_SECTOR + sector);
}

void flash_finish_erase(void) {
    FLASH->CR = FLASH_CR_LOCK;
    flash_forget_cached_data();
}
