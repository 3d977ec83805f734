/* store.h: keeps one image of words across power-off, whole or not at all.
 *
 * Two flash sectors of equal slots. Each save takes the next free slot and ends with a check word;
 * the image with the highest sequence number whose check holds is the one that counts. So when the
 * power goes in mid-save the last whole image is still there. A sector holds STORE_SLOTS images:
 * with 10 000 erase cycles that is 320 000 saves. Erasing takes seconds, so a start never does
 * it: a save that finds no free slot names the sector to erase. Knows no image's meaning.
 */
#ifndef BOWDEN_STM32F405_STORE_H
#define BOWDEN_STM32F405_STORE_H

#include <stdbool.h>
#include <stdint.h>

#define STORE_SLOT_WORDS 2048u
#define STORE_SLOTS 16u         /* of one sector */
#define STORE_IMAGE_WORDS 2045u /* most words of an image: header, sequence and check go off */

typedef enum { STORE_IDLE, STORE_BUSY, STORE_DONE, STORE_FAILED } store_progress_t;

typedef struct {
    uint32_t sequence; /* of the image that counts; 0: there is none */
    uint32_t slot;     /* 0 .. 2 STORE_SLOTS - 1: where the next image goes */
    uint32_t word;     /* to be programmed next, in the slot */
    uint32_t tries;
    uint32_t check;
    const uint32_t *image;
    uint32_t words;
    uint32_t mark; /* of the image that is being saved */
    store_progress_t progress;
    uint32_t newest; /* slot of the image that counts; 2 STORE_SLOTS: there is none */
    bool damaged;    /* something, but a log, younger than it, or than nothing, is not whole */
} store_t;

/* Finds the image that counts and copies it to image[STORE_IMAGE_WORDS]; returns its length in
 * words, 0 when there is none. */
uint32_t store_open(store_t *store, uint32_t *image);

/* Is there no free slot? Then the sector of store_sector_to_erase(), which does not hold the image
 * that counts, must be erased and store_erased() called before the next save. */
bool store_is_full(const store_t *store);
uint32_t store_sector_to_erase(const store_t *store);
void store_erased(store_t *store);

/* Begins to save `words` words; they must not change until store_step() no longer returns
 * STORE_BUSY. Not while busy. `is_log`: not requested, and cut short after its first word
 * it is no damage. False: too long, or full, or a log that would hide that an asked save is
 * damaged. */
bool store_begin(store_t *store, const uint32_t *image, uint32_t words, bool is_log);

/* Programs at most one word; after the last it reads the whole image back. STORE_DONE and
 * STORE_FAILED stay until the next store_begin(). */
store_progress_t store_step(store_t *store);

#endif
