/* storage.c: see storage.h. An image: its format, then two words an entry (index and sub, value).
 */
#include "storage.h"

#include <stddef.h>

#define FORMAT 1u
#define SIGNATURE_SAVE UINT32_C(0x65766173) /* "save", little-endian */
#define SIGNATURE_LOAD UINT32_C(0x64616F6C) /* "load" */

od_abort_t storage_check(const od_t *od, uint16_t index, uint32_t value) {
    if (index != STORAGE_SAVE && index != STORAGE_RESTORE) {
        return OD_DONE;
    }
    if (value != (index == STORAGE_SAVE ? SIGNATURE_SAVE : SIGNATURE_LOAD)) {
        return OD_ABORT_NOT_STORED;
    }
    return od->config_locked ? OD_ABORT_STATE : OD_DONE;
}

storage_request_t storage_request(uint16_t index) {
    switch (index) {
    case STORAGE_SAVE:
        return STORAGE_DO_SAVE;
    case STORAGE_RESTORE:
        return STORAGE_DO_RESTORE;
    default:
        return STORAGE_NOTHING;
    }
}

uint32_t storage_image(const od_t *od, bool defaults, uint32_t *image, uint32_t capacity) {
    uint32_t words = 0;
    if (capacity == 0) {
        return 0;
    }
    image[words++] = FORMAT;
    for (uint16_t row = 0; row < od->count && !defaults; row++) {
        const od_entry_t *entry = &od->entries[row];
        for (uint32_t i = 0; i < entry->count && (entry->flags & OD_PERSIST) != 0; i++) {
            const uint8_t sub = (uint8_t)(entry->sub + i);
            const uint32_t value = od_get(od, entry, sub);
            if (value == entry->initial) {
                continue;
            }
            if (capacity - words < 2) {
                return 0;
            }
            image[words++] = (uint32_t)entry->index << 16 | sub;
            image[words++] = value;
        }
    }
    return words;
}

bool storage_take(od_t *od, const uint32_t *image, uint32_t words) {
    if (words == 0 || image[0] != FORMAT || words % 2u == 0) {
        return false;
    }
    for (uint32_t word = 1; word < words; word += 2) {
        const uint8_t sub = (uint8_t)image[word];
        const od_entry_t *entry = NULL;
        const od_abort_t found = od_find(od, (uint16_t)(image[word] >> 16), sub, &entry);
        if (found == OD_DONE && (entry->flags & OD_PERSIST) != 0 &&
            od_check(od, entry, image[word + 1]) == OD_DONE) {
            od_set(od, entry, sub, image[word + 1]);
        }
    }
    od->config_revision++;
    return true;
}
