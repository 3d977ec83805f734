/* storage.h: store and restore parameters, CiA 301 7.5.2.13 and 7.5.2.14 (0x1010, 0x1011).
 *
 * Makes an image of words from the entries that are marked OD_PERSIST and differ from their initial
 * value, and takes such an image back. The image names entries by index and sub-index, so that it
 * outlives a firmware with other entries: what is gone, or out of range today, keeps its default.
 * Where the words are kept is not known here. Pure but for the dictionary's values.
 */
#ifndef BOWDEN_CANOPEN_STORAGE_H
#define BOWDEN_CANOPEN_STORAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "od.h"

#define STORAGE_SAVE 0x1010u
#define STORAGE_RESTORE 0x1011u

/* What a host has asked for. Restoring means that the next start has the defaults. */
typedef enum { STORAGE_NOTHING, STORAGE_DO_SAVE, STORAGE_DO_RESTORE } storage_request_t;

/* Is the value written to 0x1010 or 0x1011 the signature that it demands, and may it be done now?
 * OD_DONE for every other index. */
od_abort_t storage_check(const od_t *od, uint16_t index, uint32_t value);

/* What a write that storage_check() allowed asks for. */
storage_request_t storage_request(uint16_t index);

/* Writes the image; `defaults`: that of a drive as delivered. Returns its length in words, 0 when
 * `capacity` is too small. */
uint32_t storage_image(const od_t *od, bool defaults, uint32_t *image, uint32_t capacity);

/* Takes an image: each entry that exists, is persistent and accepts its value. Counts
 * config_revision up. False: no image of this format; nothing has changed then. */
bool storage_take(od_t *od, const uint32_t *image, uint32_t words);

#endif
