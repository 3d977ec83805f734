/* fallback.h: which compensation runs: the law that is configured, or a lesser one while something
 * that it needs is wrong; and how the torque goes over from one to the other without a jump.
 *
 *   COMPENSATION_LEVEL_*   what runs                      left because
 *   WITH_CELL             the configured law             the cell cannot be trusted
 *   WITHOUT_CELL          the same on the model alone    an encoder slipped, a number saturated
 *   COULOMB               Coulomb feed-forward           there is no model: it was refused
 *   NONE                  the torque as it is asked for
 *
 * A cause counts from the tick that finds it until it has been absent for the clean time. The
 * estimate that the cell is held against must not itself be corrected by the cell. What that
 * estimate leaves possible bounds the cell from the first tick: while it is still to be found out
 * whether the cell is wrong, it is off by no more than the model may be.
 *
 * Pure: what was found in a tick in, the level out. drive.c runs the laws.
 */
#ifndef BOWDEN_DRIVE_FALLBACK_H
#define BOWDEN_DRIVE_FALLBACK_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"

/* Causes by what they take away. */
enum {
    FALLBACK_MODEL_CAUSES =
        COMPENSATION_FALLBACK_ENCODER_SLIPPED | COMPENSATION_FALLBACK_MODEL_SATURATES,
    FALLBACK_CELL_CAUSES =
        COMPENSATION_FALLBACK_CELL_BROKEN | COMPENSATION_FALLBACK_CELL_END_OF_RANGE |
        COMPENSATION_FALLBACK_CELL_STUCK | COMPENSATION_FALLBACK_CELL_IMPLAUSIBLE,
    /* Found only after a while, in which the laws have learned from the wrong cell. */
    FALLBACK_CELL_LATE_CAUSES =
        COMPENSATION_FALLBACK_CELL_STUCK | COMPENSATION_FALLBACK_CELL_IMPLAUSIBLE,
};

typedef struct {
    bool use_load_cell;
    bool model_refused;
    int32_t step_unm;      /* > 0; a change of the level moves the torque by no more in a tick */
    uint32_t clean_ticks;  /* > 0 */
    int32_t tolerance_unm; /* > 0; between cell and model, beyond the margin of the model */
    int32_t slip_limit_nm; /* > 0; of the innovation, beyond its margin */
} fallback_settings_t;

/* What the tick has found. Torques in uN m by the cables on the load. */
typedef struct {
    bool cell_broken;
    bool cell_end_of_range;
    int32_t cell_counts;      /* raw */
    int32_t cell_torque_unm;  /* as the cell reads */
    int32_t model_torque_unm; /* from encoders and motor torque alone */
    int32_t model_margin_unm; /* >= 0; that a sane model may be off by */
    int32_t innovation_nm;    /* arc of the motor pulley, encoder minus model */
    int32_t innovation_margin_nm;
    bool model_saturates;
} fallback_found_t;

typedef struct {
    fallback_settings_t settings;
    compensation_level_t level;
    uint16_t causes; /* COMPENSATION_FALLBACK_* that count */
    uint32_t absent_ticks[COMPENSATION_FALLBACK_BITS];
    int32_t quiet_counts, quiet_model_unm; /* cell and estimate when the cell last moved */
    uint32_t quiet_ticks, implausible_ticks, slipped_ticks;
    bool slipped_back;             /* the innovation was negative */
    bool used_wrong_cell;          /* found in this tick: a cell in use has been wrong */
    int32_t given_unm, offset_unm; /* of the blend */
} fallback_t;

/* Starts on the best level that the settings allow. */
void fallback_start(fallback_t *fallback, const fallback_settings_t *settings);

/* Looks at one tick; true when the level has changed. */
bool fallback_step(fallback_t *fallback, const fallback_found_t *found);

/* The cell's torque, or the nearest one that a usable model leaves possible. */
int32_t fallback_plausible_unm(const fallback_t *fallback, const fallback_found_t *found);

/* From the torque of the law on the level to the one to give: the same, but for a difference that
 * starts at a change of the level (`changed`) with what is missing to the torque given last, and
 * decays by step_unm a tick. */
int32_t fallback_blend(fallback_t *fallback, int32_t torque_unm, bool changed);

/* Forgets the torque given last: the bridge is off. */
void fallback_idle(fallback_t *fallback);

#endif
