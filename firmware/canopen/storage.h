/* storage.h: store and restore parameters, CiA 301 7.5.2.13 and 7.5.2.14 (0x1010, 0x1011).
 *
 * An image of words holds the entries that are marked OD_PERSIST and differ from their initial
 * value: format, schema hash and revision of the firmware that made it, then two words an entry
 * (index, word of the value and sub; value). Entries are named, so that an image outlives a
 * firmware with other entries; what is gone, or out of range today, keeps its default and is
 * reported. Where the words are kept is not known here. Pure but for the dictionary's values.
 *
 * Sub-indices are groups of entries. Calibration, which the factory has measured, is saved with
 * everything but restored by its own sub-index alone. A log, persistent entries of role state, is
 * no configuration: an image of nothing else leaves the defaults.
 */
#ifndef BOWDEN_CANOPEN_STORAGE_H
#define BOWDEN_CANOPEN_STORAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"
#include "od.h"

#define STORAGE_SAVE 0x1010u
#define STORAGE_RESTORE 0x1011u

/* Sub-indices of both. */
enum {
    STORAGE_ALL = 1, /* to restore: all but calibration */
    STORAGE_COMMUNICATION,
    STORAGE_APPLICATION,
    STORAGE_CALIBRATION,
    STORAGE_LOG,  /* of the drive: it saves it by itself, and it is never restored */
    STORAGE_LINK, /* of LSS: node id and bit rate, which are calibration, alone */
};

/* What a host has asked for. Restoring means that the next start has the defaults. */
typedef struct {
    bool asked;
    bool restore;
    uint8_t sub;
} storage_request_t;

/* What became of an image. */
typedef struct {
    configuration_origin_outcome_t outcome; /* defaults, complete, migrated, partial or lost */
    uint32_t first;                         /* entry that was not taken: index << 8 | sub; 0 none */
    uint16_t entries;                       /* that were not taken */
    uint32_t schema_hash;                   /* of the firmware that made it; 0 unknown */
} storage_report_t;

/* Is the value written to 0x1010 or 0x1011 the signature that it demands, and may it be done now?
 * OD_DONE for every other index. */
od_abort_t storage_check(const od_t *od, uint16_t index, uint32_t value);

/* What a write that storage_check() allowed asks for. */
storage_request_t storage_request(uint16_t index, uint8_t sub);

/* Brings image[0 .. words - 1] up to date: the entries of the request's group from the dictionary,
 * or none of them, the others as they were. Returns its new length in words; 0, and nothing has
 * changed, when `capacity` is too small. */
uint32_t storage_update(const od_t *od, storage_request_t request, uint32_t *image, uint32_t words,
                        uint32_t capacity);

/* Takes an image: each entry that exists, is persistent and accepts its value; with
 * `communication_only` no others. Counts config_revision up when any was taken. */
storage_report_t storage_take(od_t *od, const uint32_t *image, uint32_t words,
                              bool communication_only);

/* Finds the value of one entry in an image; false: it is not in it. */
bool storage_find(const uint32_t *image, uint32_t words, uint16_t index, uint8_t sub,
                  uint32_t *value);

#endif
