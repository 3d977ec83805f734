/* store.c: see store.h. A slot: header (mark and length), sequence, the image, check. */
#include "store.h"

#include "flash.h"

#define MARK 0xB0E00000u     /* of slots of this size */
#define MARK_LOG 0x4F1E0000u /* far from the other: no few flipped bits make one of the other */
#define MARK_BITS 0xFFFF0000u
#define HEAD_WORDS 2u
#define ALL_SLOTS (FLASH_SECTORS * STORE_SLOTS)
#define CHECK_SEED 0x5EED5EEDu

/* A word that does not read back spoils its slot; the next one is tried. */
#define TRIES 3u

_Static_assert(STORE_SLOTS *STORE_SLOT_WORDS == FLASH_SECTOR_WORDS, "slots fill a sector");
_Static_assert(HEAD_WORDS + STORE_IMAGE_WORDS + 1u == STORE_SLOT_WORDS, "an image fills a slot");

static uint32_t word_at(uint32_t slot, uint32_t word) {
    return flash_word(slot / STORE_SLOTS, slot % STORE_SLOTS * STORE_SLOT_WORDS + word);
}

/* CRC-32 (reflected 0x04C11DB7) of one word more, four bits at a time. */
static uint32_t check_with(uint32_t check, uint32_t word) {
    static const uint32_t TABLE[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
        0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
        0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C,
    };
    check ^= word;
    for (uint32_t i = 0; i < 8; i++) {
        check = check >> 4 ^ TABLE[check & 15u];
    }
    return check;
}

static uint32_t length_of(uint32_t header) {
    const uint32_t words = header & 0xFFFFu;
    const uint32_t mark = header & MARK_BITS;
    const bool known = mark == MARK || mark == MARK_LOG;
    return known && words <= STORE_IMAGE_WORDS ? words : 0;
}

/* Length of the image in a slot; 0: none that is whole. */
static uint32_t whole_image(uint32_t slot) {
    const uint32_t words = length_of(word_at(slot, 0));
    uint32_t check = CHECK_SEED;
    for (uint32_t word = 0; word < HEAD_WORDS + words; word++) {
        check = check_with(check, word_at(slot, word));
    }
    return words > 0 && word_at(slot, HEAD_WORDS + words) == check ? words : 0;
}

/* A slot is free when neither it nor one behind it in its sector was begun. So in a sector the
 * slots are begun in order since it was erased, also when an erase was cut short. */
static bool is_free(uint32_t slot) {
    bool blank = true;
    for (uint32_t at = slot; at % STORE_SLOTS != 0 || at == slot; at++) {
        blank = blank && word_at(at, 0) == FLASH_BLANK;
    }
    return blank;
}

/* The first free slot after `slot`, across the end of the area; ALL_SLOTS: none. */
static uint32_t free_slot_after(uint32_t slot) {
    for (uint32_t step = 1; step < ALL_SLOTS; step++) {
        const uint32_t at = (slot + step) % ALL_SLOTS;
        if (is_free(at)) {
            return at;
        }
    }
    return ALL_SLOTS;
}

/* Was a slot begun on a request whose failure has to be reported? */
static bool is_asked_for(uint32_t slot) {
    const uint32_t header = word_at(slot, 0);
    return header != FLASH_BLANK && (header & MARK_BITS) != MARK_LOG;
}

/* Is there a whole image in the sector that begins with slot `first`? */
static bool holds_an_image(uint32_t first) {
    bool found = false;
    for (uint32_t i = STORE_SLOTS; i > 0 && !found; i--) {
        found = whole_image(first + i - 1u) > 0;
    }
    return found;
}

/* Slots are used in order: is the one after the newest image begun? Then a save was cut short, or
 * it is spoiled since. Only the first slot of the other sector may hold what is older: then that
 * sector holds a whole image, which is older too, and was begun no later than it. What stands in a
 * slot that is not whole is never trusted. */
static bool is_followed(const store_t *store) {
    const uint32_t next = (store->newest + 1u) % ALL_SLOTS;
    const bool is_older = next % STORE_SLOTS == 0 && holds_an_image(next);
    return is_asked_for(next) && !is_older;
}

static bool was_ever_asked(void) {
    for (uint32_t slot = 0; slot < ALL_SLOTS; slot++) {
        if (is_asked_for(slot)) {
            return true;
        }
    }
    return false;
}

uint32_t store_open(store_t *store, uint32_t *image) {
    *store = (store_t){.newest = ALL_SLOTS, .progress = STORE_IDLE};
    uint32_t words = 0;
    for (uint32_t slot = 0; slot < ALL_SLOTS; slot++) {
        const uint32_t sequence = word_at(slot, 1);
        if (length_of(word_at(slot, 0)) > 0 && sequence > store->sequence) {
            const uint32_t found = whole_image(slot);
            if (found > 0) {
                store->newest = slot;
                words = found;
                store->sequence = sequence;
            }
        }
    }
    store->damaged = words > 0 ? is_followed(store) : was_ever_asked();
    for (uint32_t word = 0; word < words; word++) {
        image[word] = word_at(store->newest, HEAD_WORDS + word);
    }
    store->slot = free_slot_after(store->newest % ALL_SLOTS);
    if (words == 0 && is_free(0)) {
        store->slot = 0;
    }
    return words;
}

bool store_is_full(const store_t *store) {
    return store->slot == ALL_SLOTS;
}

uint32_t store_sector_to_erase(const store_t *store) {
    return store->newest < STORE_SLOTS ? 1u : 0u;
}

void store_erased(store_t *store) {
    store->slot = free_slot_after(store->newest % ALL_SLOTS);
    const uint32_t first = store_sector_to_erase(store) * STORE_SLOTS;
    if (store->slot == ALL_SLOTS && is_free(first)) {
        store->slot = first;
    }
}

bool store_begin(store_t *store, const uint32_t *image, uint32_t words, bool is_log) {
    if (store->progress == STORE_BUSY) {
        return false;
    }
    store->progress = STORE_FAILED;
    const bool hides_damage = is_log && store->damaged;
    if (words == 0 || words > STORE_IMAGE_WORDS || store->slot == ALL_SLOTS || hides_damage) {
        return false;
    }
    store->image = image;
    store->words = words;
    store->mark = is_log ? MARK_LOG : MARK;
    store->word = 0;
    store->tries = 0;
    store->check = CHECK_SEED;
    store->progress = STORE_BUSY;
    return true;
}

static uint32_t word_to_program(const store_t *store) {
    if (store->word == 0) {
        return store->mark | store->words;
    }
    if (store->word == 1) {
        return store->sequence + 1u;
    }
    return store->word < HEAD_WORDS + store->words ? store->image[store->word - HEAD_WORDS]
                                                   : store->check;
}

/* All is written: reads it back from the flash itself. */
static void finish(store_t *store) {
    flash_forget_cached_data();
    const bool whole = whole_image(store->slot) == store->words;
    if (whole) {
        store->newest = store->slot;
        store->sequence++;
        store->damaged = false;
    }
    store->slot = free_slot_after(store->slot);
    store->progress = whole ? STORE_DONE : STORE_FAILED;
}

store_progress_t store_step(store_t *store) {
    if (store->progress != STORE_BUSY) {
        return store->progress;
    }
    const uint32_t value = word_to_program(store);
    const bool fine =
        flash_program(store->slot / STORE_SLOTS,
                      store->slot % STORE_SLOTS * STORE_SLOT_WORDS + store->word, value);
    if (!fine) {
        store->slot = free_slot_after(store->slot);
        store->word = 0;
        store->check = CHECK_SEED;
        store->tries++;
        if (store->tries == TRIES || store->slot == ALL_SLOTS) {
            store->progress = STORE_FAILED;
        }
    } else if (store->word == HEAD_WORDS + store->words) {
        finish(store);
    } else {
        store->check = check_with(store->check, value);
        store->word++;
    }
    return store->progress;
}
