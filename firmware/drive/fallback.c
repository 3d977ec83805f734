/* fallback.c: see fallback.h. */
#include "fallback.h"

#include "../board/board.h"
#include "../core/fixed.h"

#define TICKS_PER_MS (1000u / BOARD_CONTROL_PERIOD_US)

/* A cell lags behind by its filter, and a front arrives a little earlier or later than the model
 * has it: both are over in less. */
#define IMPLAUSIBLE_TICKS (50u * TICKS_PER_MS)

/* A slip of an encoder stays. What an oscillating motor causes, or takes up a slack
 * one, goes back and forth: the model has no masses. */
#define SLIPPED_TICKS (50u * TICKS_PER_MS)

/* A stuck cell shows when the estimate has moved on by this part of the tolerance, and for so long:
 * a cell with little noise may well read the same twice. */
#define STUCK_PART 4
#define STUCK_TICKS (50u * TICKS_PER_MS)

static int32_t distance(int32_t a, int32_t b) {
    uint32_t saturations = 0;
    const int32_t difference = fixed_subtract(a, b, &saturations);
    return difference < 0 ? -difference : difference;
}

/* Has `true_now` been true for so many ticks? */
static bool lasts(bool true_now, uint32_t *ticks, uint32_t long_ticks) {
    if (!true_now) {
        *ticks = 0;
    } else if (*ticks < long_ticks) {
        (*ticks)++;
    }
    return *ticks == long_ticks;
}

/* The largest difference between cell and model that a usable model leaves possible. */
static int32_t apart_most_unm(const fallback_t *fallback, const fallback_found_t *found) {
    uint32_t saturations = 0; /* a margin of 2 kN m is as good as none */
    return fixed_add(fallback->settings.tolerance_unm, found->model_margin_unm, &saturations);
}

static uint16_t causes_of_cell(fallback_t *fallback, const fallback_found_t *found) {
    const int32_t tolerance_unm = apart_most_unm(fallback, found);
    uint16_t causes = 0;
    if (found->cell_broken) {
        causes |= COMPENSATION_FALLBACK_CELL_BROKEN;
    }
    if (found->cell_end_of_range) {
        causes |= COMPENSATION_FALLBACK_CELL_END_OF_RANGE;
    }
    const bool quiet = found->cell_counts == fallback->quiet_counts;
    if (!quiet) {
        fallback->quiet_counts = found->cell_counts;
        fallback->quiet_model_unm = found->model_torque_unm;
    }
    if (lasts(quiet, &fallback->quiet_ticks, STUCK_TICKS) &&
        distance(found->model_torque_unm, fallback->quiet_model_unm) > tolerance_unm / STUCK_PART) {
        causes |= COMPENSATION_FALLBACK_CELL_STUCK;
    }
    if (lasts(distance(found->cell_torque_unm, found->model_torque_unm) > tolerance_unm,
              &fallback->implausible_ticks, IMPLAUSIBLE_TICKS)) {
        causes |= COMPENSATION_FALLBACK_CELL_IMPLAUSIBLE;
    }
    return causes;
}

/* A cause that is absent now stays until the clean time is over. */
static void keep(fallback_t *fallback, uint16_t causes) {
    for (uint32_t i = 0; i < COMPENSATION_FALLBACK_BITS; i++) {
        const uint16_t bit = (uint16_t)(1u << i);
        if ((causes & bit) != 0) {
            fallback->causes |= bit;
            fallback->absent_ticks[i] = 0;
        } else if (++fallback->absent_ticks[i] >= fallback->settings.clean_ticks) {
            fallback->absent_ticks[i] = fallback->settings.clean_ticks;
            fallback->causes &= (uint16_t)~bit;
        }
    }
}

static compensation_level_t level_for(const fallback_t *fallback) {
    if (fallback->settings.model_refused) {
        return COMPENSATION_LEVEL_NONE;
    }
    if ((fallback->causes & FALLBACK_MODEL_CAUSES) != 0) {
        return COMPENSATION_LEVEL_COULOMB;
    }
    const bool cell =
        fallback->settings.use_load_cell && (fallback->causes & FALLBACK_CELL_CAUSES) == 0;
    return cell ? COMPENSATION_LEVEL_WITH_CELL : COMPENSATION_LEVEL_WITHOUT_CELL;
}

void fallback_start(fallback_t *fallback, const fallback_settings_t *settings) {
    *fallback = (fallback_t){
        .settings = *settings,
        .causes = settings->model_refused ? COMPENSATION_FALLBACK_MODEL_REFUSED : 0,
    };
    fallback->level = level_for(fallback);
}

bool fallback_step(fallback_t *fallback, const fallback_found_t *found) {
    const fallback_settings_t *settings = &fallback->settings;
    uint32_t saturations = 0;
    const int32_t slip_limit_nm =
        fixed_add(settings->slip_limit_nm, found->innovation_margin_nm, &saturations);
    uint16_t causes = settings->use_load_cell ? causes_of_cell(fallback, found) : 0;
    if (settings->model_refused) {
        causes |= COMPENSATION_FALLBACK_MODEL_REFUSED;
    }
    if (found->model_saturates) {
        causes |= COMPENSATION_FALLBACK_MODEL_SATURATES;
    }
    const bool back = found->innovation_nm < 0;
    fallback->slipped_ticks = back == fallback->slipped_back ? fallback->slipped_ticks : 0;
    fallback->slipped_back = back;
    if (lasts(distance(found->innovation_nm, 0) > slip_limit_nm, &fallback->slipped_ticks,
              SLIPPED_TICKS)) {
        causes |= COMPENSATION_FALLBACK_ENCODER_SLIPPED;
    }
    const bool was_used = (fallback->causes & FALLBACK_CELL_CAUSES) == 0;
    keep(fallback, causes);
    fallback->used_wrong_cell = was_used && (fallback->causes & FALLBACK_CELL_LATE_CAUSES) != 0;
    const compensation_level_t before = fallback->level;
    fallback->level = level_for(fallback);
    return fallback->level != before;
}

int32_t fallback_plausible_unm(const fallback_t *fallback, const fallback_found_t *found) {
    uint32_t saturations = 0; /* clamped to what both can be */
    const int32_t most_unm = apart_most_unm(fallback, found);
    const int32_t apart_unm =
        fixed_subtract(found->cell_torque_unm, found->model_torque_unm, &saturations);
    return fixed_add(found->model_torque_unm, fixed_clamp(apart_unm, -most_unm, most_unm),
                     &saturations);
}

int32_t fallback_blend(fallback_t *fallback, int32_t torque_unm, bool changed) {
    uint32_t saturations = 0;
    const int32_t step = fallback->settings.step_unm;
    int32_t offset = fallback->offset_unm;
    if (changed) {
        offset = fixed_subtract(fallback->given_unm, torque_unm, &saturations);
    }
    fallback->offset_unm = fixed_subtract(offset, fixed_clamp(offset, -step, step), &saturations);
    fallback->given_unm = fixed_add(torque_unm, fallback->offset_unm, &saturations);
    return fallback->given_unm;
}

void fallback_idle(fallback_t *fallback) {
    fallback->given_unm = 0;
    fallback->offset_unm = 0;
}
