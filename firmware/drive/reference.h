/* reference.h: where the angles count from, and whether that is known.
 *
 * Incremental encoders start at 0 at every reset. After power-on the zero is where the rig stands,
 * until a host has it set (homing.h). Over another reset the zero goes on only where that can be
 * proved: the memory has kept the last angles, both encoders stood still before the reset (the
 * board sees to that, board_reference_t) and stand still for REFERENCE_PROOF_TICKS after it. A load
 * that starts from standstill and stops again in the T = 6 ms without counting moves by at most a
 * T^2/4: 2 mrad at 200 rad/s^2. Else the reference is lost, and the tunnel, which lies around the
 * zero, is refused until a host has it set.
 *
 * Pure.
 */
#ifndef BOWDEN_DRIVE_REFERENCE_H
#define BOWDEN_DRIVE_REFERENCE_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"
#include "../meanings.h"

/* 100 ms. */
#define REFERENCE_PROOF_TICKS (100000u / BOARD_CONTROL_PERIOD_US)

typedef struct {
    angle_reference_t state;
    int32_t motor_zero_counts, load_zero_counts; /* encoder counts less these: from the zero */
    int32_t motor_still_counts, load_still_counts;
    uint32_t still_ticks; /* for which neither encoder has left those, but for dither */
    bool started;
} reference_t;

/* At the start: `kept` is what the board has kept of the program before. */
reference_t reference_of(reset_cause_t reset, board_reference_t kept);

/* One tick. */
void reference_step(reference_t *reference, int32_t motor_counts, int32_t load_counts);

/* The zero lies at these counts of the encoders; `state`: how that is known. After reference_step()
 * of the tick. */
void reference_set(reference_t *reference, int32_t motor_counts, int32_t load_counts,
                   angle_reference_t state);

/* May a tunnel be laid around the zero? */
bool reference_is_known(const reference_t *reference);

/* For the board to keep. */
board_reference_t reference_to_keep(const reference_t *reference, int32_t motor_counts,
                                    int32_t load_counts);

#endif
