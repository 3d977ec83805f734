/* keep_reference.c: see keep_reference.h. */
#include "keep_reference.h"

#define MAGIC 0xB0DE0AE1u
#define DITHER_COUNTS 1

typedef struct {
    uint32_t magic;
    uint32_t motor_counts, load_counts;
    uint32_t latch; /* counters then: motor, load << 16 */
    uint32_t hangs; /* the reset to come is the watchdog's, and the counters are looked at */
    uint32_t check;
} record_t;

__attribute__((section(".noinit"))) static record_t record;

static uint32_t check(void) {
    const uint32_t words[] = {record.motor_counts, record.load_counts, record.latch, record.hangs};
    uint32_t sum = MAGIC;
    for (uint32_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        sum = (sum << 5 | sum >> 27) ^ words[i];
    }
    return sum;
}

board_reference_t kept_reference(reset_cause_t reset) {
    const bool valid = record.magic == MAGIC && record.check == check();
    const bool hung = reset == RESET_CAUSE_WATCHDOG || reset == RESET_CAUSE_WINDOW_WATCHDOG;
    const bool spares =
        hung ? record.hangs != 0 : reset == RESET_CAUSE_SOFTWARE || reset == RESET_CAUSE_RESET_PIN;
    record.magic = 0;
    return (board_reference_t){
        .holds = valid && spares,
        .motor_counts = (int32_t)record.motor_counts,
        .load_counts = (int32_t)record.load_counts,
    };
}

void keep_reference(board_reference_t reference, encoders_latch_t latch) {
    const uint32_t counters = (uint32_t)latch.motor | (uint32_t)latch.load << 16;
    if (!reference.holds) {
        record.magic = 0;
        return;
    }
    if (record.magic == MAGIC && record.latch == counters &&
        record.load_counts == (uint32_t)reference.load_counts &&
        record.motor_counts == (uint32_t)reference.motor_counts && record.hangs == 0) {
        return; /* it is set already */
    }
    record = (record_t){
        .magic = MAGIC,
        .motor_counts = (uint32_t)reference.motor_counts,
        .load_counts = (uint32_t)reference.load_counts,
        .latch = counters,
    };
    record.check = check();
}

/* Has a 16-bit counter gone further than dither? */
static bool moved(uint16_t now, uint32_t then) {
    return (uint16_t)(now - (uint16_t)then + DITHER_COUNTS) > 2u * DITHER_COUNTS;
}

void watch_reference(encoders_latch_t latch, bool hangs) {
    if (moved(latch.motor, record.latch) || moved(latch.load, record.latch >> 16)) {
        record.magic = 0;
    } else if (hangs && record.hangs == 0) {
        record.hangs = 1u;
        record.check = check();
    }
}
