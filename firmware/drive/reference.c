/* reference.c: see reference.h. */
#include "reference.h"

#define DITHER_COUNTS 1 /* of an encoder that stands between two counts */

/* Counters may wrap; the compilers used define the cast as modulo 2^32. */
static int32_t less(int32_t a, int32_t b) {
    return (int32_t)((uint32_t)a - (uint32_t)b);
}

static bool is_away(int32_t counts, int32_t from) {
    const int32_t way = less(counts, from);
    return way > DITHER_COUNTS || way < -DITHER_COUNTS;
}

reference_t reference_of(reset_cause_t reset, board_reference_t kept) {
    if (reset == RESET_CAUSE_POWER_ON) {
        return (reference_t){.state = ANGLE_REFERENCE_POWER_ON};
    }
    if (!kept.holds) {
        return (reference_t){.state = ANGLE_REFERENCE_LOST};
    }
    return (reference_t){
        .state = ANGLE_REFERENCE_PROVING,
        .motor_zero_counts = less(0, kept.motor_counts),
        .load_zero_counts = less(0, kept.load_counts),
    };
}

/* The first counts are where the kept ones were; without kept ones they are the zero. */
static void start(reference_t *reference, int32_t motor_counts, int32_t load_counts) {
    reference->started = true;
    if (reference->state == ANGLE_REFERENCE_PROVING) {
        reference->motor_zero_counts = less(motor_counts, less(0, reference->motor_zero_counts));
        reference->load_zero_counts = less(load_counts, less(0, reference->load_zero_counts));
    }
    reference->motor_still_counts = motor_counts;
    reference->load_still_counts = load_counts;
}

void reference_step(reference_t *reference, int32_t motor_counts, int32_t load_counts) {
    if (!reference->started) {
        start(reference, motor_counts, load_counts);
    }
    if (is_away(motor_counts, reference->motor_still_counts) ||
        is_away(load_counts, reference->load_still_counts)) {
        reference->still_ticks = 0;
        reference->motor_still_counts = motor_counts;
        reference->load_still_counts = load_counts;
        if (reference->state == ANGLE_REFERENCE_PROVING) {
            reference->state = ANGLE_REFERENCE_MOVED;
        }
    } else if (reference->still_ticks < REFERENCE_PROOF_TICKS) {
        reference->still_ticks++;
    } else if (reference->state == ANGLE_REFERENCE_PROVING) {
        reference->state = ANGLE_REFERENCE_KEPT;
    }
}

void reference_set(reference_t *reference, int32_t motor_counts, int32_t load_counts,
                   angle_reference_t state) {
    reference->motor_zero_counts = motor_counts;
    reference->load_zero_counts = load_counts;
    reference->state = state;
}

bool reference_is_known(const reference_t *reference) {
    switch (reference->state) {
    case ANGLE_REFERENCE_POWER_ON:
    case ANGLE_REFERENCE_KEPT:
    case ANGLE_REFERENCE_HOMED:
    case ANGLE_REFERENCE_INDEXED:
        return true;
    default:
        return false;
    }
}

board_reference_t reference_to_keep(const reference_t *reference, int32_t motor_counts,
                                    int32_t load_counts) {
    return (board_reference_t){
        .holds = reference_is_known(reference) && reference->still_ticks == REFERENCE_PROOF_TICKS,
        .motor_counts = less(motor_counts, reference->motor_zero_counts),
        .load_counts = less(load_counts, reference->load_zero_counts),
    };
}
