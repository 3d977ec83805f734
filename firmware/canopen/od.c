/* od.c: lookup and checked access to the object dictionary; see od.h. */
#include "od.h"

#include <stddef.h>

/* One past the last row that does not come after (index, sub): rows are sorted by both. */
static uint32_t rows_up_to(const od_t *od, uint16_t index, uint8_t sub) {
    uint32_t low = 0;
    uint32_t high = od->count;
    while (low < high) { /* halves each time: at most 16 rounds */
        const uint32_t middle = low + (high - low) / 2;
        const od_entry_t *row = &od->entries[middle];
        if (row->index < index || (row->index == index && row->sub <= sub)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

od_abort_t od_find(const od_t *od, uint16_t index, uint8_t sub, const od_entry_t **entry) {
    const uint32_t next = rows_up_to(od, index, sub);
    const od_entry_t *row = next > 0 ? &od->entries[next - 1] : NULL;
    if (row == NULL || row->index != index) {
        return OD_ABORT_NO_OBJECT; /* every object has a sub 0, so none of its rows is later */
    }
    if (sub - row->sub >= row->count) {
        return OD_ABORT_NO_SUB;
    }
    *entry = row;
    return OD_DONE;
}

uint32_t od_size(const od_entry_t *entry) {
    switch (entry->type) {
    case OD_U8:
    case OD_I8:
        return 1;
    case OD_U16:
    case OD_I16:
        return 2;
    case OD_I24:
        return 3;
    case OD_TEXT:
        return entry->initial;
    case OD_DOMAIN:
        return entry->high;
    default:
        return 4;
    }
}

uint32_t od_words(const od_entry_t *entry) {
    return entry->type == OD_DOMAIN ? entry->high / 4u : 1u;
}

static bool is_signed(const od_entry_t *entry) {
    return entry->type >= OD_I8 && entry->type <= OD_I32;
}

uint32_t od_initial(const od_t *od, const od_entry_t *entry) {
    return entry->initial + ((entry->flags & OD_ADD_NODE_ID) != 0 ? od->node_id : 0u);
}

/* Bytes of one value in the struct: an I24 lives in an int32_t. */
static uint32_t stored_size(const od_entry_t *entry) {
    return entry->type == OD_I24 ? 4 : od_size(entry);
}

static void *address(const od_t *od, const od_entry_t *entry, uint8_t sub) {
    uint8_t *base = od->values;
    return base + entry->offset + (uint32_t)(sub - entry->sub) * stored_size(entry);
}

uint32_t od_get(const od_t *od, const od_entry_t *entry, uint8_t sub) {
    if (entry->type == OD_TEXT) {
        return 0;
    }
    if (entry->offset == OD_NO_STORAGE) {
        return od_initial(od, entry);
    }
    const void *value = address(od, entry, sub);
    switch (entry->type) {
    case OD_U8:
        return *(const uint8_t *)value;
    case OD_I8:
        return (uint32_t)(int32_t)*(const int8_t *)value;
    case OD_U16:
        return *(const uint16_t *)value;
    case OD_I16:
        return (uint32_t)(int32_t)*(const int16_t *)value;
    default:
        return *(const uint32_t *)value;
    }
}

void od_set(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t value) {
    if (entry->offset == OD_NO_STORAGE) {
        return;
    }
    void *target = address(od, entry, sub);
    switch (entry->type) {
    case OD_U8:
    case OD_I8:
        *(uint8_t *)target = (uint8_t)value;
        break;
    case OD_U16:
    case OD_I16:
        *(uint16_t *)target = (uint16_t)value;
        break;
    default:
        *(uint32_t *)target = value;
        break;
    }
}

uint32_t od_value(const od_t *od, uint16_t index, uint8_t sub) {
    const od_entry_t *entry = NULL;
    return od_find(od, index, sub, &entry) == OD_DONE ? od_get(od, entry, sub) : 0;
}

uint32_t od_get_word(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t word) {
    if (entry->type != OD_DOMAIN) {
        return od_get(od, entry, sub);
    }
    const uint32_t *words = address(od, entry, sub);
    return words[word];
}

void od_set_word(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t word,
                 uint32_t value) {
    if (entry->type != OD_DOMAIN) {
        od_set(od, entry, sub, value);
        return;
    }
    uint32_t *words = address(od, entry, sub);
    words[word] = value;
}

static bool needs_unlocked(const od_entry_t *entry) {
    return entry->role == OD_CONFIG || entry->role == OD_CALIBRATION;
}

bool od_is_locked(const od_t *od, const od_entry_t *entry) {
    return needs_unlocked(entry) && od->config_locked;
}

static bool is_accepted(const uint32_t *accepted, uint32_t value) {
    bool found = accepted == NULL;
    for (uint32_t i = 0; !found && i < accepted[0]; i++) {
        found = accepted[1 + i] == value;
    }
    return found;
}

od_abort_t od_check(const od_t *od, const od_entry_t *entry, uint32_t value) {
    if ((entry->flags & OD_WRITE) == 0) {
        return OD_ABORT_READ_ONLY;
    }
    if (entry->type == OD_DOMAIN) { /* any word of it */
        return od_is_locked(od, entry) ? OD_ABORT_STATE : OD_DONE;
    }
    const bool too_low =
        is_signed(entry) ? (int32_t)value < (int32_t)entry->low : value < entry->low;
    const bool too_high =
        is_signed(entry) ? (int32_t)value > (int32_t)entry->high : value > entry->high;
    if (too_low || too_high) {
        return too_low ? OD_ABORT_TOO_LOW : OD_ABORT_TOO_HIGH;
    }
    if (!is_accepted(entry->accepted, value)) {
        return OD_ABORT_VALUE;
    }
    return od_is_locked(od, entry) ? OD_ABORT_STATE : OD_DONE;
}

od_abort_t od_read(const od_t *od, uint16_t index, uint8_t sub, uint8_t *bytes, uint32_t capacity,
                   uint32_t *size) {
    const od_entry_t *entry = NULL;
    const od_abort_t found = od_find(od, index, sub, &entry);
    if (found != OD_DONE) {
        return found;
    }
    if ((entry->flags & OD_READ) == 0) {
        return OD_ABORT_WRITE_ONLY;
    }
    *size = od_size(entry);
    if (*size > capacity) {
        return OD_ABORT_TOO_LONG;
    }
    if (entry->type == OD_DOMAIN) {
        for (uint32_t word = 0; word < od_words(entry); word++) {
            od_encode(od_get_word(od, entry, sub, word), &bytes[4u * word], 4);
        }
        return OD_DONE;
    }
    if (entry->type != OD_TEXT) {
        od_encode(od_get(od, entry, sub), bytes, *size);
        return OD_DONE;
    }
    for (uint32_t i = 0; i < *size; i++) {
        bytes[i] = (uint8_t)entry->text[i];
    }
    return OD_DONE;
}

od_abort_t od_write(od_t *od, uint16_t index, uint8_t sub, const uint8_t *bytes, uint32_t size) {
    const od_entry_t *entry = NULL;
    const od_abort_t found = od_find(od, index, sub, &entry);
    if (found != OD_DONE) {
        return found;
    }
    if ((entry->flags & OD_WRITE) == 0) { /* before the length: that is what the user should hear */
        return OD_ABORT_READ_ONLY;
    }
    if (size != od_size(entry)) {
        return size > od_size(entry) ? OD_ABORT_TOO_LONG : OD_ABORT_TOO_SHORT;
    }
    const bool is_domain = entry->type == OD_DOMAIN;
    const uint32_t value = is_domain ? 0 : od_decode(entry, bytes);
    const od_abort_t refused = od_check(od, entry, value);
    if (refused != OD_DONE) {
        return refused;
    }
    for (uint32_t word = 0; word < od_words(entry); word++) {
        od_set_word(od, entry, sub, word, is_domain ? od_word_of(&bytes[4u * word]) : value);
    }
    od->config_revision += needs_unlocked(entry) ? 1u : 0u;
    return OD_DONE;
}

uint32_t od_word_of(const uint8_t *bytes) {
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

uint32_t od_decode(const od_entry_t *entry, const uint8_t *bytes) {
    const uint32_t size = od_size(entry);
    uint32_t value = 0;
    for (uint32_t i = 0; i < size; i++) {
        value |= (uint32_t)bytes[i] << (8 * i);
    }
    const uint32_t sign = UINT32_C(1) << (8 * size - 1);
    if (is_signed(entry) && (value & sign) != 0) {
        value |= ~(sign - 1); /* all bits from the sign upwards */
    }
    return value;
}

void od_encode(uint32_t value, uint8_t *bytes, uint32_t size) {
    for (uint32_t i = 0; i < size; i++) {
        bytes[i] = (uint8_t)(value >> (8 * i));
    }
}

static void set_row_initial(const od_t *od, const od_entry_t *entry) {
    for (uint32_t i = 0; i < entry->count; i++) {
        for (uint32_t word = 0; word < od_words(entry); word++) {
            od_set_word(od, entry, (uint8_t)(entry->sub + i), word, od_initial(od, entry));
        }
    }
}

void od_set_initial(const od_t *od) {
    for (uint32_t row = 0; row < od->count; row++) {
        set_row_initial(od, &od->entries[row]);
    }
}

void od_reset_communication(const od_t *od) {
    for (uint32_t row = 0; row < od->count; row++) {
        const od_entry_t *entry = &od->entries[row];
        if (entry->index < 0x2000 &&
            (entry->role == OD_COMMUNICATION || entry->role == OD_CONFIG)) {
            set_row_initial(od, entry);
        }
    }
}
