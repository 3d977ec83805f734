/* ends.c: see ends.h. */
#include "ends.h"

/* The envelope of the torque falls with a time constant of 128 ticks, 32 ms. */
#define ENVELOPE_SHIFT 7

static ratio_t q31(uint64_t numerator_q31) {
    return ratio_of(numerator_q31, FIXED_Q31_ONE);
}

void ends_configure(ends_t *ends, const cable_settings_t *cable, uint32_t motor_pulley_radius_nm,
                    int32_t tolerance_nm) {
    uint32_t saturations = 0; /* a band of 2 m is as good as none */
    uint64_t length_um = 0;
    for (uint32_t i = 0; i < cable->segments && i < CABLE_SEGMENTS_MAX; i++) {
        length_um += cable->segment_length_um[i];
    }
    const uint32_t m = cable_wrap_q24(cable);
    const uint32_t falls = fixed_exp_minus(m); /* e^-m; at least e^-8 */
    const ratio_t compliance = ratio_of(length_um, cable->axial_stiffness_mn); /* nm per uN */
    const ratio_t force = ratio_of(1000000000u, motor_pulley_radius_nm);       /* uN per uN m */
    const ratio_t lower =
        ratio_multiply(ratio_multiply(compliance, q31(fixed_exp_minus_mean(m))), force);
    const uint64_t both = (uint64_t)FIXED_Q31_ONE + falls;
    const int32_t stretch_nm = fixed_scale(cable->pretension_un, compliance, &saturations);
    *ends = (ends_t){
        .taut = ratio_multiply(lower, ratio_of(FIXED_Q31_ONE, both)),
        .slack = ratio_multiply(lower, ratio_of(FIXED_Q31_ONE, falls)),
        .stretch_nm = stretch_nm,
        .held_nm = fixed_scale(stretch_nm, ratio_of(FIXED_Q31_ONE - falls, both), &saturations),
        .tolerance_nm = tolerance_nm,
    };
}

void ends_start(ends_t *ends, int32_t apart_nm) {
    ends->zero_nm = apart_nm;
    ends->high_unm = 0;
    ends->low_unm = 0;
}

/* The largest difference at a motor torque. One that pulls the other way takes off at least what it
 * stretches cables of twice the stiffness by. */
static int32_t reach_nm(const ends_t *ends, int32_t torque_unm) {
    uint32_t saturations = 0; /* 2 m are beyond any difference */
    const int32_t pulled_nm = fixed_scale(torque_unm, ends->taut, &saturations);
    if (torque_unm <= 0) {
        return fixed_add(pulled_nm / 2, ends->held_nm, &saturations);
    }
    const int32_t taut_nm = fixed_add(pulled_nm, ends->held_nm, &saturations);
    const int32_t slack_nm = fixed_subtract(fixed_scale(torque_unm, ends->slack, &saturations),
                                            ends->stretch_nm, &saturations);
    return taut_nm > slack_nm ? taut_nm : slack_nm;
}

bool ends_beyond(ends_t *ends, int32_t apart_nm, int32_t motor_torque_unm) {
    uint32_t saturations = 0;
    const int32_t high_unm =
        ends->high_unm - ((ends->high_unm - motor_torque_unm) >> ENVELOPE_SHIFT);
    const int32_t low_unm = ends->low_unm + ((motor_torque_unm - ends->low_unm) >> ENVELOPE_SHIFT);
    ends->high_unm = motor_torque_unm > high_unm ? motor_torque_unm : high_unm;
    ends->low_unm = motor_torque_unm < low_unm ? motor_torque_unm : low_unm;
    const int32_t difference_nm = fixed_subtract(apart_nm, ends->zero_nm, &saturations);
    const int32_t margin_nm = fixed_add(ends->held_nm, ends->tolerance_nm, &saturations);
    const int32_t span_unm = ends->high_unm - ends->low_unm;
    const int32_t above_nm =
        fixed_subtract(difference_nm, reach_nm(ends, ends->high_unm + span_unm), &saturations);
    const int32_t below_nm =
        fixed_subtract(-difference_nm, reach_nm(ends, span_unm - ends->low_unm), &saturations);
    return above_nm > margin_nm || below_nm > margin_nm;
}
