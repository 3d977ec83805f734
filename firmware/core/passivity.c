/* passivity.c: see passivity.h. */
#include "passivity.h"

#define BANK_URAD 2000          /* motion against full friction that fills the bank */
#define DEBT_URAD 80000         /* motion with full friction: the debt at which nothing is left */
#define BACK_OFF_MOST_Q16 49152 /* three quarters */

passivity_t passivity_of(uint32_t load_radius_nm, int32_t friction_unm) {
    return (passivity_t){
        .angle_per_arc = ratio_of(1000000, load_radius_nm),
        .uj_per_1024_pj = ratio_of(1024, 1000000),
        .bank = -(int64_t)friction_unm * BANK_URAD,
        .q16_per_1024_pj =
            ratio_of(UINT64_C(65536) * 1024u, (uint64_t)(uint32_t)friction_unm * DEBT_URAD + 1u),
    };
}

void passivity_step(passivity_t *passivity, int32_t load_arc_nm, int32_t excess_unm) {
    uint32_t saturations = 0; /* a tick's motion is small */
    if (!passivity->started) {
        passivity->started = true;
        passivity->last_arc_nm = load_arc_nm;
    }
    const int32_t step_nm = fixed_subtract(load_arc_nm, passivity->last_arc_nm, &saturations);
    const int32_t step_urad = fixed_scale(step_nm, passivity->angle_per_arc, &saturations);
    passivity->last_arc_nm = load_arc_nm;
    /* 2^62 is added to at most 2^61: no overflow */
    const int64_t most = INT64_C(1) << 61;
    const int64_t step_pj = (int64_t)excess_unm * step_urad;
    passivity->given += (uint64_t)step_pj;
    const int64_t sum = passivity->balance + step_pj;
    const int64_t limited = sum > most ? most : sum;
    passivity->balance = limited < passivity->bank ? passivity->bank : limited;
}

uint32_t passivity_back_off_q16(const passivity_t *passivity) {
    uint32_t saturations = 0; /* beyond the range is beyond the most */
    const int32_t debt = fixed_saturate(passivity->balance / 1024, &saturations);
    const int32_t q16 = fixed_scale(debt, passivity->q16_per_1024_pj, &saturations);
    return (uint32_t)fixed_clamp(q16, 0, BACK_OFF_MOST_Q16);
}

int32_t passivity_energy_uj(const passivity_t *passivity) {
    uint32_t saturations = 0;
    const int32_t nj = fixed_saturate(passivity->balance / 1024, &saturations); /* 1.024 nJ */
    return fixed_scale(nj, passivity->uj_per_1024_pj, &saturations);
}
