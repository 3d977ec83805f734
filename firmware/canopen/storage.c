/* storage.c: see storage.h. */
#include "storage.h"

#include <stddef.h>

#include "lss.h"

#define FORMAT 2u
#define HEAD_WORDS 3u /* format, schema hash, revision */
#define DICTIONARY_HASH_INDEX 0x2000u
#define IDENTITY_INDEX 0x1018u
#define REVISION_SUB 3u
#define PROFILE_AREA_END 0x2000u

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

storage_request_t storage_request(uint16_t index, uint8_t sub) {
    return (storage_request_t){
        .asked = sub != 0 && (index == STORAGE_SAVE || index == STORAGE_RESTORE),
        .restore = index == STORAGE_RESTORE,
        .sub = sub,
    };
}

/* ---- reading an image ---- */

static bool is_known(const uint32_t *image, uint32_t words) {
    return words >= HEAD_WORDS && image[0] == FORMAT && (words - HEAD_WORDS) % 2u == 0;
}

static uint16_t index_of(uint32_t name) {
    return (uint16_t)(name >> 16);
}

static uint8_t sub_of(uint32_t name) {
    return (uint8_t)name;
}

static uint32_t word_of(uint32_t name) {
    return name >> 8 & 0xFFu;
}

static uint8_t group_of(const od_entry_t *entry) {
    if (entry->index == LSS_NODE_ID_INDEX || entry->index == LSS_BIT_RATE_INDEX) {
        return STORAGE_LINK;
    }
    if (entry->role == OD_CALIBRATION) {
        return STORAGE_CALIBRATION;
    }
    if (entry->role == OD_STATE) {
        return STORAGE_LOG;
    }
    return entry->index < PROFILE_AREA_END ? STORAGE_COMMUNICATION : STORAGE_APPLICATION;
}

static bool concerns(storage_request_t request, uint8_t group) {
    const bool calibration = group == STORAGE_CALIBRATION || group == STORAGE_LINK;
    const bool outlives = calibration || group == STORAGE_LOG;
    return request.sub == group || (request.sub == STORAGE_CALIBRATION && calibration) ||
           (request.sub == STORAGE_ALL && !(request.restore && outlives));
}

/* The persistent entry of that name, NULL when there is none. */
static const od_entry_t *find_persistent(const od_t *od, uint32_t name) {
    const od_entry_t *entry = NULL;
    const od_abort_t found = od_find(od, index_of(name), sub_of(name), &entry);
    const bool there =
        found == OD_DONE && (entry->flags & OD_PERSIST) != 0 && word_of(name) < od_words(entry);
    return there ? entry : NULL;
}

bool storage_find(const uint32_t *image, uint32_t words, uint16_t index, uint8_t sub,
                  uint32_t *value) {
    const uint32_t end = is_known(image, words) ? words : 0;
    for (uint32_t word = HEAD_WORDS; word < end; word += 2) {
        if (image[word] == ((uint32_t)index << 16 | sub)) {
            *value = image[word + 1];
            return true;
        }
    }
    return false;
}

storage_report_t storage_take(od_t *od, const uint32_t *image, uint32_t words,
                              bool communication_only) {
    if (!is_known(image, words)) {
        return (storage_report_t){.outcome = words > 0 ? CONFIGURATION_ORIGIN_OUTCOME_LOST
                                                       : CONFIGURATION_ORIGIN_OUTCOME_DEFAULTS};
    }
    storage_report_t report = {.schema_hash = image[1]};
    bool configures = false;
    for (uint32_t word = HEAD_WORDS; word < words; word += 2) {
        const uint32_t name = image[word];
        if (communication_only && index_of(name) >= PROFILE_AREA_END) {
            continue; /* without a search: there may be a thousand of them */
        }
        const od_entry_t *entry = find_persistent(od, name);
        if (communication_only && (entry == NULL || group_of(entry) != STORAGE_COMMUNICATION)) {
            continue;
        }
        const bool is_log = entry != NULL && group_of(entry) == STORAGE_LOG;
        configures = configures || !is_log;
        if (is_log || (entry != NULL && od_check(od, entry, image[word + 1]) == OD_DONE)) {
            od_set_word(od, entry, sub_of(name), word_of(name), image[word + 1]);
        } else {
            report.first =
                report.entries == 0 ? (uint32_t)index_of(name) << 8 | sub_of(name) : report.first;
            report.entries++;
        }
    }
    od->config_revision++;
    report.outcome = !configures          ? CONFIGURATION_ORIGIN_OUTCOME_DEFAULTS
                     : report.entries > 0 ? CONFIGURATION_ORIGIN_OUTCOME_PARTIAL
                     : report.schema_hash != od_value(od, DICTIONARY_HASH_INDEX, 0)
                         ? CONFIGURATION_ORIGIN_OUTCOME_MIGRATED
                         : CONFIGURATION_ORIGIN_OUTCOME_COMPLETE;
    return report;
}

/* ---- making an image ---- */

/* Words of one value that is not at its initial one; with `image` they are written to it. */
static uint32_t put_value(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t *image) {
    uint32_t words = 0;
    for (uint32_t i = 0; i < od_words(entry); i++) {
        const uint32_t value = od_get_word(od, entry, sub, i);
        if (value != od_initial(od, entry)) {
            if (image != NULL) {
                image[words] = (uint32_t)entry->index << 16 | i << 8 | sub;
                image[words + 1] = value;
            }
            words += 2;
        }
    }
    return words;
}

/* Words of the entries in the request's group that are not at their initial value. With `image`
 * they are written to it. */
static uint32_t put_group(const od_t *od, storage_request_t request, uint32_t *image) {
    uint32_t words = 0;
    for (uint16_t row = 0; row < od->count && !request.restore; row++) {
        const od_entry_t *entry = &od->entries[row];
        if ((entry->flags & OD_PERSIST) == 0 || !concerns(request, group_of(entry))) {
            continue;
        }
        for (uint32_t i = 0; i < entry->count; i++) {
            words += put_value(od, entry, (uint8_t)(entry->sub + i),
                               image != NULL ? &image[words] : NULL);
        }
    }
    return words;
}

/* An entry that the request does not concern stays; so does one that this firmware does not know,
 * unless everything is saved or restored. */
static bool stays(const od_t *od, storage_request_t request, uint32_t name) {
    const od_entry_t *entry = find_persistent(od, name);
    return entry != NULL ? !concerns(request, group_of(entry)) : request.sub != STORAGE_ALL;
}

static uint32_t words_that_stay(const od_t *od, storage_request_t request, const uint32_t *image,
                                uint32_t words) {
    uint32_t kept = 0;
    for (uint32_t word = HEAD_WORDS; word < words; word += 2) {
        kept += stays(od, request, image[word]) ? 2u : 0u;
    }
    return kept;
}

uint32_t storage_update(const od_t *od, storage_request_t request, uint32_t *image, uint32_t words,
                        uint32_t capacity) {
    const uint32_t end = is_known(image, words) ? words : 0;
    const uint32_t kept = words_that_stay(od, request, image, end);
    if (HEAD_WORDS + kept + put_group(od, request, NULL) > capacity) {
        return 0;
    }
    uint32_t to = HEAD_WORDS;
    for (uint32_t word = HEAD_WORDS; word < end; word += 2) {
        if (stays(od, request, image[word])) {
            image[to] = image[word];
            image[to + 1] = image[word + 1];
            to += 2;
        }
    }
    image[0] = FORMAT;
    image[1] = od_value(od, DICTIONARY_HASH_INDEX, 0);
    image[2] = od_value(od, IDENTITY_INDEX, REVISION_SUB);
    return to + put_group(od, request, &image[to]);
}
