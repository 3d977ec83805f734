/* cable_path.c: see cable_path.h. */
#include "cable_path.h"

/* What one segment contributes. */
typedef struct {
    ratio_t half_compliance; /* tanh(a/2)/a dx/EA, nm per uN */
    uint32_t wrap_q24;       /* mu_d dx/R: capstan exponent when it slips */
    uint32_t stiction_q24;   /* (mu_s - mu_d) l_s/R: what breakaway takes on top */
} segment_t;

/* friction * length / R as an exponent in Q24. */
static uint32_t exponent_q24(uint32_t friction_ppm, uint32_t length_um, uint32_t curvature) {
    uint32_t saturations = 0;
    const ratio_t per_curvature = ratio_multiply(
        ratio_of((uint64_t)friction_ppm * length_um, UINT64_C(1000000000000)), /* ppm um */
        ratio_of(FIXED_Q24_ONE, UINT64_C(1000000)));                           /* 1/(1000 km) */
    return (uint32_t)fixed_scale((int32_t)curvature, per_curvature, &saturations);
}

static segment_t segment_of(const cable_settings_t *settings, uint8_t index) {
    const uint32_t length_um = settings->segment_length_um[index];
    const uint32_t curvature = settings->segment_curvature_per_1000km[index];
    const uint32_t excess_ppm = settings->friction_static_ppm - settings->friction_dynamic_ppm;
    const uint32_t wrap_q24 = exponent_q24(settings->friction_dynamic_ppm, length_um, curvature);
    /* tanh(a/2)/a = (1 - exp(-a))/a : (1 + exp(-a)), the half that makes eq. (2) exact */
    const ratio_t half = ratio_of(fixed_exp_minus_mean(wrap_q24),
                                  (uint64_t)FIXED_Q31_ONE + fixed_exp_minus(wrap_q24));
    return (segment_t){
        .half_compliance = ratio_multiply(half, ratio_of(length_um, settings->axial_stiffness_mn)),
        .wrap_q24 = wrap_q24,
        .stiction_q24 = exponent_q24(excess_ppm, settings->stiction_length_um, curvature),
    };
}

/* exp(-x), or exp(x) when `rising`. */
static ratio_t exponential(uint32_t x_q24, bool rising) {
    const ratio_t fall = ratio_of(fixed_exp_minus(x_q24), FIXED_Q31_ONE);
    return rising ? ratio_reciprocal(fall) : fall;
}

/* Walks once from one end to the other and notes the constants of a front at each node. */
static void configure_fronts(cable_path_t *path, const segment_t *segment_from_motor,
                             cable_side_t side, cable_direction_t direction) {
    const uint8_t segments = path->segments;
    cable_front_t *front = path->front[side][direction];
    const bool release = direction == CABLE_RELEASE; /* tension rises away from a releasing end */
    ratio_t tension = ratio_of(1, 1);
    ratio_t compliance = ratio_of(0, 1);
    uint32_t wrap_q24 = 0;
    for (uint8_t k = 0; k < segments; k++) {
        const uint8_t index = side == CABLE_PROXIMAL ? k : (uint8_t)(segments - 1u - k);
        const segment_t segment = segment_from_motor[index];
        compliance = ratio_add(compliance, ratio_multiply(segment.half_compliance, tension));
        const uint32_t break_q24 = wrap_q24 + segment.wrap_q24 + segment.stiction_q24;
        front[k] = (cable_front_t){
            .tension = tension,
            .compliance = compliance,
            .stiffness = ratio_reciprocal(compliance),
            .breakaway = ratio_multiply(compliance, exponential(break_q24, !release)),
        };
        wrap_q24 += segment.wrap_q24;
        tension = exponential(wrap_q24, release);
        compliance = ratio_add(compliance, ratio_multiply(segment.half_compliance, tension));
    }
    front[segments] = (cable_front_t){
        .tension = tension,
        .breakaway = ratio_of(0, 1),
        .compliance = compliance,
        .stiffness = ratio_reciprocal(compliance),
    };
}

/* Each product of a length in um and a curvature in 1e-9/m is
 * below 2e14; their sum times mu fits when it is in microradians. */
uint32_t cable_wrap_q24(const cable_settings_t *cable) {
    uint64_t turned = 0; /* 1e-15 rad */
    for (uint32_t i = 0; i < cable->segments && i < CABLE_SEGMENTS_MAX; i++) {
        turned += (uint64_t)cable->segment_length_um[i] * cable->segment_curvature_per_1000km[i];
    }
    const uint64_t exponent_ppm = turned / 1000000u * cable->friction_dynamic_ppm / 1000000u;
    const uint64_t exponent_q24 = exponent_ppm * FIXED_Q24_ONE / 1000000u;
    return exponent_q24 < CABLE_WRAP_MAX_Q24 ? (uint32_t)exponent_q24 : CABLE_WRAP_MAX_Q24;
}

static cable_defect_t check_segment(const cable_settings_t *settings, uint8_t index,
                                    uint64_t *wrap_q24) {
    if (settings->segment_length_um[index] == 0) {
        return CABLE_BAD_LENGTH;
    }
    if (settings->segment_curvature_per_1000km[index] > INT32_MAX) {
        return CABLE_BAD_WRAP;
    }
    const segment_t segment = segment_of(settings, index);
    *wrap_q24 += segment.wrap_q24;
    if (*wrap_q24 > CABLE_WRAP_MAX_Q24) {
        return CABLE_BAD_WRAP;
    }
    return segment.stiction_q24 > CABLE_WRAP_MAX_Q24 ? CABLE_BAD_STICTION_LENGTH : CABLE_FINE;
}

/* Nanometres that `tension_un` stretches the whole cable by, without friction. */
static ratio_t whole_compliance(const cable_settings_t *settings) {
    ratio_t compliance = ratio_of(0, 1);
    for (uint8_t i = 0; i < settings->segments; i++) {
        compliance = ratio_add(
            compliance, ratio_of(settings->segment_length_um[i], settings->axial_stiffness_mn));
    }
    return compliance;
}

cable_defect_t cable_check(const cable_settings_t *settings, uint8_t *segment) {
    *segment = 0;
    if (settings->axial_stiffness_mn == 0) {
        return CABLE_BAD_STIFFNESS;
    }
    if (settings->segments < 1 || settings->segments > CABLE_SEGMENTS_MAX) {
        return CABLE_BAD_SEGMENTS;
    }
    if (settings->friction_static_ppm < settings->friction_dynamic_ppm) {
        return CABLE_BAD_STATIC_FRICTION;
    }
    uint64_t wrap_q24 = 0;
    for (uint8_t i = 0; i < settings->segments; i++) {
        const cable_defect_t defect = check_segment(settings, i, &wrap_q24);
        if (defect != CABLE_FINE) {
            *segment = i;
            return defect;
        }
    }
    uint32_t saturations = 0;
    (void)fixed_scale(settings->pretension_un, whole_compliance(settings), &saturations);
    return settings->pretension_un < 0 || saturations > 0 ? CABLE_BAD_PRETENSION : CABLE_FINE;
}

bool cable_configure(cable_path_t *path, const cable_settings_t *settings) {
    uint8_t segment;
    if (cable_check(settings, &segment) != CABLE_FINE) {
        return false;
    }
    segment_t segments[CABLE_SEGMENTS_MAX];
    ratio_t mesh_compliance = ratio_of(0, 1); /* of the nodes, at equal tension */
    for (uint8_t i = 0; i < settings->segments; i++) {
        segments[i] = segment_of(settings, i);
        mesh_compliance = ratio_add(mesh_compliance, segments[i].half_compliance);
        mesh_compliance = ratio_add(mesh_compliance, segments[i].half_compliance);
    }
    uint32_t saturations = 0; /* cable_check() has seen that there are none */
    path->segments = settings->segments;
    path->wrap_q24 = 0;
    for (uint8_t i = 0; i < settings->segments; i++) {
        path->wrap_q24 += segments[i].wrap_q24;
    }
    path->pretension_stretch_nm =
        fixed_scale(settings->pretension_un, whole_compliance(settings), &saturations);
    path->start_tension_un =
        fixed_scale(path->pretension_stretch_nm, ratio_reciprocal(mesh_compliance), &saturations);
    ratio_t compliance = ratio_of(0, 1); /* from the motor end to the slider */
    for (uint8_t i = 0; i < settings->segments; i++) {
        compliance = ratio_add(compliance, segments[i].half_compliance);
        path->slider_start_nm[i] = fixed_scale(path->start_tension_un, compliance, &saturations);
        compliance = ratio_add(compliance, segments[i].half_compliance);
    }
    for (uint8_t side = CABLE_PROXIMAL; side <= CABLE_DISTAL; side++) {
        configure_fronts(path, segments, (cable_side_t)side, CABLE_PULL);
        configure_fronts(path, segments, (cable_side_t)side, CABLE_RELEASE);
    }
    return true;
}
