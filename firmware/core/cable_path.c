/* cable_path.c: see cable_path.h. */
#include "cable_path.h"

/* friction * length / R as an exponent in Q24. */
static uint32_t exponent_q24(uint32_t friction_ppm, uint32_t length_um, uint32_t curvature) {
    uint32_t saturations = 0;
    const ratio_t per_curvature = ratio_multiply(
        ratio_of((uint64_t)friction_ppm * length_um, UINT64_C(1000000000000)), /* ppm um */
        ratio_of(FIXED_Q24_ONE, UINT64_C(1000000)));                           /* 1/(1000 km) */
    return (uint32_t)fixed_scale((int32_t)curvature, per_curvature, &saturations);
}

static cable_segment_t segment_of(const cable_settings_t *settings, uint8_t index) {
    const uint32_t length_um = settings->segment_length_um[index];
    const uint32_t curvature = settings->segment_curvature_per_1000km[index];
    const uint32_t excess_ppm = settings->friction_static_ppm - settings->friction_dynamic_ppm;
    const uint32_t wrap_q24 = exponent_q24(settings->friction_dynamic_ppm, length_um, curvature);
    /* tanh(a/2)/a = (1 - exp(-a))/a : (1 + exp(-a)), the half that makes eq. (2) exact */
    const ratio_t half = ratio_of(fixed_exp_minus_mean(wrap_q24),
                                  (uint64_t)FIXED_Q31_ONE + fixed_exp_minus(wrap_q24));
    return (cable_segment_t){
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

/* Each product of a length in um and a curvature in 1e-6/m is
 * below 2e14; their sum times mu fits when it is in microradians. */
uint32_t cable_wrap_q24(const cable_settings_t *cable) {
    uint64_t turned = 0; /* 1e-12 rad */
    for (uint32_t i = 0; i < cable->segments && i < CABLE_SEGMENTS_MAX; i++) {
        turned += (uint64_t)cable->segment_length_um[i] * cable->segment_curvature_per_1000km[i];
    }
    const uint64_t exponent_ppm = turned / 1000000u * cable->friction_dynamic_ppm / 1000000u;
    const uint64_t exponent_q24 = exponent_ppm * FIXED_Q24_ONE / 1000000u;
    return exponent_q24 < CABLE_WRAP_MAX_Q24 ? (uint32_t)exponent_q24 : CABLE_WRAP_MAX_Q24;
}

/* 8 in 1e-18, a quarter of a millionth less: what rounding each of 40 exponents to Q24 adds to
 * their sum cannot carry that beyond CABLE_WRAP_MAX_Q24. */
#define EXPONENT_MAX_1E_18 UINT64_C(7999998000000000000)

/* The largest x with x * factor * 1e-18 within the limit of an exponent; below 2^63. */
static uint64_t most_with(uint64_t factor) {
    return factor > 0 ? EXPONENT_MAX_1E_18 / factor : EXPONENT_MAX_1E_18;
}

/* The angle dx/R of a segment, in 1e-12 rad, is below 2^63; so is the sum before it. */
static cable_defect_t check_segments(const cable_settings_t *settings, uint8_t *segment) {
    const uint32_t excess_ppm = settings->friction_static_ppm - settings->friction_dynamic_ppm;
    const uint64_t most_turned = most_with(settings->friction_dynamic_ppm);
    const uint64_t most_curvature = most_with((uint64_t)excess_ppm * settings->stiction_length_um);
    uint64_t turned = 0;
    for (uint8_t i = 0; i < settings->segments; i++) {
        const uint32_t length_um = settings->segment_length_um[i];
        const uint32_t curvature = settings->segment_curvature_per_1000km[i];
        *segment = i;
        if (length_um == 0) {
            return CABLE_BAD_LENGTH;
        }
        turned += (uint64_t)length_um * curvature;
        if (curvature > INT32_MAX || turned > most_turned) {
            return CABLE_BAD_WRAP;
        }
        if (curvature > most_curvature) {
            return CABLE_BAD_STICTION_LENGTH;
        }
    }
    *segment = 0;
    return CABLE_FINE;
}

/* Does the stretch of the whole cable without friction, T0 L/EA, fit? */
static bool stretch_fits(const cable_settings_t *settings) {
    uint64_t length_um = 0;
    for (uint8_t i = 0; i < settings->segments; i++) {
        length_um += settings->segment_length_um[i];
    }
    uint32_t saturations = 0;
    (void)fixed_scale(settings->pretension_un, ratio_of(length_um, settings->axial_stiffness_mn),
                      &saturations);
    return settings->pretension_un >= 0 && saturations == 0;
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
    const cable_defect_t defect = check_segments(settings, segment);
    return defect != CABLE_FINE || stretch_fits(settings) ? defect : CABLE_BAD_PRETENSION;
}

/* ---- the constants, a piece at a time ---- */

/* What follows from all segments: the start, at the nodes' equal tension. */
static void end_segments(cable_path_t *path, cable_build_t *build,
                         const cable_settings_t *settings) {
    uint32_t saturations = 0; /* cable_check() has seen that there are none */
    path->pretension_stretch_nm =
        fixed_scale(settings->pretension_un, build->whole_compliance, &saturations);
    path->start_tension_un = fixed_scale(path->pretension_stretch_nm,
                                         ratio_reciprocal(build->mesh_compliance), &saturations);
}

static void build_segment(cable_path_t *path, cable_build_t *build,
                          const cable_settings_t *settings) {
    const uint8_t i = build->next;
    const cable_segment_t segment = segment_of(settings, i);
    build->segment[i] = segment;
    path->wrap_q24 += segment.wrap_q24;
    for (uint8_t half = 0; half < 2; half++) {
        build->mesh_compliance = ratio_add(build->mesh_compliance, segment.half_compliance);
    }
    build->whole_compliance =
        ratio_add(build->whole_compliance,
                  ratio_of(settings->segment_length_um[i], settings->axial_stiffness_mn));
}

/* From the motor end to the slider, in the middle of its segment. */
static void build_slider(cable_path_t *path, cable_build_t *build) {
    const uint8_t i = build->next;
    const ratio_t half = build->segment[i].half_compliance;
    uint32_t saturations = 0;
    build->compliance = ratio_add(build->compliance, half);
    path->slider_start_nm[i] = fixed_scale(path->start_tension_un, build->compliance, &saturations);
    build->compliance = ratio_add(build->compliance, half);
}

/* A front at node k; then what lies between it and the next. */
static void build_front(cable_path_t *path, cable_build_t *build, cable_side_t side,
                        cable_direction_t direction) {
    const uint8_t k = build->next;
    cable_front_t *front = &path->front[side][direction][k];
    if (k == path->segments) {
        *front = (cable_front_t){
            .tension = build->tension,
            .breakaway = ratio_of(0, 1),
            .compliance = build->compliance,
            .stiffness = ratio_reciprocal(build->compliance),
        };
        return;
    }
    const bool release = direction == CABLE_RELEASE; /* tension rises away from a releasing end */
    const cable_segment_t segment =
        build->segment[side == CABLE_PROXIMAL ? k : path->segments - 1u - k];
    const ratio_t compliance =
        ratio_add(build->compliance, ratio_multiply(segment.half_compliance, build->tension));
    const uint32_t break_q24 = build->wrap_q24 + segment.wrap_q24 + segment.stiction_q24;
    *front = (cable_front_t){
        .tension = build->tension,
        .compliance = compliance,
        .stiffness = ratio_reciprocal(compliance),
        .breakaway = ratio_multiply(compliance, exponential(break_q24, !release)),
    };
    build->wrap_q24 += segment.wrap_q24;
    build->tension = exponential(build->wrap_q24, release);
    build->compliance =
        ratio_add(compliance, ratio_multiply(segment.half_compliance, build->tension));
}

void cable_build_start(cable_path_t *path, cable_build_t *build, const cable_settings_t *settings) {
    path->segments = settings->segments;
    path->wrap_q24 = 0;
    *build = (cable_build_t){.tension = ratio_of(1, 1)};
}

/* The next stage walks from an end again. */
static void next_piece(cable_path_t *path, cable_build_t *build, const cable_settings_t *settings) {
    const uint32_t pieces = path->segments + (build->stage >= CABLE_BUILD_FRONTS ? 1u : 0u);
    build->next++;
    if (build->next < pieces) {
        return;
    }
    if (build->stage == CABLE_BUILD_SEGMENTS) {
        end_segments(path, build, settings);
    }
    build->stage++;
    build->next = 0;
    build->wrap_q24 = 0;
    build->tension = ratio_of(1, 1);
    build->compliance = ratio_of(0, 1);
}

bool cable_build_step(cable_path_t *path, cable_build_t *build, const cable_settings_t *settings) {
    if (build->stage == CABLE_BUILD_SEGMENTS) {
        build_segment(path, build, settings);
    } else if (build->stage == CABLE_BUILD_SLIDERS) {
        build_slider(path, build);
    } else if (build->stage < CABLE_BUILD_DONE) {
        const uint8_t walk = build->stage - CABLE_BUILD_FRONTS;
        build_front(path, build, walk / 2u == 0 ? CABLE_PROXIMAL : CABLE_DISTAL,
                    walk % 2u == 0 ? CABLE_PULL : CABLE_RELEASE);
    } else {
        return true;
    }
    next_piece(path, build, settings);
    return build->stage == CABLE_BUILD_DONE;
}
