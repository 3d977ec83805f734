/* passivity.h: checks that the rendering gives the load no net energy.
 *
 * A tunnel stores energy and gives it back: over a closed path the wanted torque does no work. So
 * what counts is the work of the *error*, rendered minus wanted torque, on the load's motion:
 *   (E1)  E = sum of (tau - wanted) d theta
 * Friction makes it negative. When it is positive the drive has been active by that much, and less
 * of the friction is compensated until friction has taken it back. (A torque of its own against the
 * motion would be late like every measurement, and feed an oscillation that it is to stop.) Credit
 * is kept only up to a small bank, or an hour of friction could be given back at once.
 *
 * A load cell makes this an observation. The estimate alone does not contain the model's error:
 * without a cell friction_observer.h bounds what is compensated. Pure.
 */
#ifndef BOWDEN_CORE_PASSIVITY_H
#define BOWDEN_CORE_PASSIVITY_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"

typedef struct {
    ratio_t angle_per_arc; /* urad per nm */
    ratio_t uj_per_1024_pj;
    int64_t bank; /* least balance, uN m urad (pJ); <= 0 */
    ratio_t q16_per_1024_pj;
    int64_t balance; /* E, pJ */
    uint64_t given;  /* the same without a bank, pJ; wraps, differences tell */
    int32_t last_arc_nm;
    bool started;
} passivity_t;

/* `friction_unm`: scale of what can go wrong, the friction of the sliding pair at the load. */
passivity_t passivity_of(uint32_t load_radius_nm, int32_t friction_unm);

/* One tick. */
void passivity_step(passivity_t *passivity, int32_t load_arc_nm, int32_t excess_unm);

/* By how much less of the friction is to be compensated: 0 .. 0.75 in Q16. */
uint32_t passivity_back_off_q16(const passivity_t *passivity);

/* E in uJ, limited to the range of int32_t. */
int32_t passivity_energy_uj(const passivity_t *passivity);

#endif
