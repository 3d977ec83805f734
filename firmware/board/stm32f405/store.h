/* store.h: keeps one image of words across power-off, whole or not at all.
 *
 * Two flash sectors of equal slots. Each save takes the next blank slot and ends with a check word;
 * the image with the highest sequence number whose check holds is the one that counts. So when the
 * power goes in mid-save the last whole image is still there. The sector that does not hold it is
 * erased at the next start. A sector holds STORE_SLOTS images: with 10 000 erase cycles that is a
 * million saves. Knows no image's meaning.
 */
#ifndef BOWDEN_STM32F405_STORE_H
#define BOWDEN_STM32F405_STORE_H

#include <stdbool.h>
#include <stdint.h>

#define STORE_SLOT_WORDS 512u
#define STORE_SLOTS 64u        /* of one sector */
#define STORE_IMAGE_WORDS 509u /* most words of an image: header, sequence and check go off */

typedef enum { STORE_IDLE, STORE_BUSY, STORE_DONE, STORE_FAILED } store_progress_t;

typedef struct {
    uint32_t sequence; /* of the image that counts; 0: there is none */
    uint32_t slot;     /* 0 .. 2 STORE_SLOTS - 1: where the next image goes */
    uint32_t word;     /* to be programmed next, in the slot */
    uint32_t tries;
    uint32_t check;
    const uint32_t *image;
    uint32_t words;
    store_progress_t progress;
} store_t;

/* Finds the image that counts and copies it to image[STORE_IMAGE_WORDS]; returns its length in
 * words, 0 when there is none. Erases a sector when it must: about a second, before the watchdog.
 */
uint32_t store_open(store_t *store, uint32_t *image);

/* Begins to save `words` words; they must not change until store_step() no longer returns
 * STORE_BUSY. Not while busy. False: too long, or no blank slot before the next start. */
bool store_begin(store_t *store, const uint32_t *image, uint32_t words);

/* Programs at most one word. STORE_DONE and STORE_FAILED stay until the next store_begin(). */
store_progress_t store_step(store_t *store);

#endif
