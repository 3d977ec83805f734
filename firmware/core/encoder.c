/* encoder.c: see encoder.h. */
#include "encoder.h"

#define TWO_PI_Q32 UINT64_C(26986075409)

static ratio_t per_count(uint32_t per_radian, uint32_t counts_per_turn) {
    return ratio_of(per_radian * TWO_PI_Q32, (uint64_t)counts_per_turn << 32);
}

ratio_t encoder_urad_per_count(uint32_t counts_per_turn) {
    return per_count(1000000, counts_per_turn);
}

ratio_t encoder_arc_nm_per_count(uint32_t radius_nm, uint32_t counts_per_turn) {
    return per_count(radius_nm, counts_per_turn);
}
