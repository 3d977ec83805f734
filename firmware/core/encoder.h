/* encoder.h: encoder counts to angle and to arc length on a pulley, exact to one unit over the
 * whole range of int32_t: the factor keeps 31 significant bits (2 pi itself to 2^-36), the
 * product 62. Pure; no state.
 */
#ifndef BOWDEN_CORE_ENCODER_H
#define BOWDEN_CORE_ENCODER_H

#include <stdint.h>

#include "fixed.h"

/* Microradians per count. counts_per_turn 1 .. 2^24. */
ratio_t encoder_urad_per_count(uint32_t counts_per_turn);

/* Nanometres of arc per count on a pulley of radius_nm, 1 .. 600000000. */
ratio_t encoder_arc_nm_per_count(uint32_t radius_nm, uint32_t counts_per_turn);

#endif
