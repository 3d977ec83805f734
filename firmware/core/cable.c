/* cable.c: see cable.h. The configuration first, then the step. */
#include "cable.h"

/* ---- configuration ---- */

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

static void go_slack(cable_t *cable) {
    cable->motion = CABLE_SLACK;
    cable->end[CABLE_PROXIMAL].tension_un = 0;
    cable->end[CABLE_DISTAL].tension_un = 0;
    cable->end[CABLE_PROXIMAL].moving_nodes = 0;
    cable->end[CABLE_DISTAL].moving_nodes = 0;
}

void cable_start(cable_t *cable, const cable_path_t *path) {
    *cable = (cable_t){.motion = CABLE_PARTIAL};
    for (uint8_t i = 0; i < path->segments; i++) {
        cable->node_tension_un[i] = path->start_tension_un;
        cable->slider_nm[i] = path->slider_start_nm[i];
    }
    cable->node_tension_un[path->segments] = path->start_tension_un;
    cable->end[CABLE_PROXIMAL].tension_un = path->start_tension_un;
    cable->end[CABLE_DISTAL].tension_un = path->start_tension_un;
    cable->end[CABLE_DISTAL].inward_nm = -path->pretension_stretch_nm;
    if (path->pretension_stretch_nm == 0) {
        go_slack(cable);
    }
}

/* ---- the memory, seen from an end ---- */

static cable_side_t other_side(cable_side_t side) {
    return side == CABLE_PROXIMAL ? CABLE_DISTAL : CABLE_PROXIMAL;
}

static cable_direction_t other_direction(cable_direction_t direction) {
    return direction == CABLE_PULL ? CABLE_RELEASE : CABLE_PULL;
}

static const cable_front_t *front_at(const cable_path_t *path, cable_side_t side,
                                     const cable_end_t *end, uint8_t node) {
    return &path->front[side][end->direction][node];
}

/* Node `node`, counted from `side`, in the arrays, which count from the proximal end. */
static uint8_t node_index(const cable_path_t *path, cable_side_t side, uint8_t node) {
    return side == CABLE_PROXIMAL ? node : (uint8_t)(path->segments - node);
}

static uint8_t slider_index(const cable_path_t *path, cable_side_t side, uint8_t slider) {
    return side == CABLE_PROXIMAL ? slider : (uint8_t)(path->segments - 1u - slider);
}

/* Position of a slider of the memory as inward displacement of `side`. */
static int32_t slider_inward_nm(const cable_t *cable, const cable_path_t *path, cable_side_t side,
                                uint8_t slider) {
    const int32_t u_nm = cable->slider_nm[slider_index(path, side, slider)];
    return side == CABLE_PROXIMAL ? u_nm : -u_nm;
}

/* Tension of a moving node of `side`. */
static int32_t moving_tension_un(cable_t *cable, const cable_path_t *path, cable_side_t side,
                                 uint8_t node) {
    const cable_end_t *end = &cable->end[side];
    return fixed_scale(end->tension_un, front_at(path, side, end, node)->tension,
                       &cable->saturations);
}

/* Tension of the first node past the front of `side`: memory, or moving with the other end. */
static int32_t tension_ahead_un(cable_t *cable, const cable_path_t *path, cable_side_t side) {
    const uint8_t node = cable->end[side].moving_nodes;
    const uint8_t from_other = (uint8_t)(path->segments - node);
    const cable_side_t other = other_side(side);
    if (from_other < cable->end[other].moving_nodes) {
        return moving_tension_un(cable, path, other, from_other);
    }
    return cable->node_tension_un[node_index(path, side, node)];
}

/* Writes where a slider behind the front of `side` is now. */
static void remember_slider(cable_t *cable, const cable_path_t *path, cable_side_t side,
                            uint8_t slider) {
    const cable_end_t *end = &cable->end[side];
    const int32_t stretch = fixed_scale(
        end->tension_un, front_at(path, side, end, slider)->compliance, &cable->saturations);
    const int32_t inward_nm = fixed_add(end->inward_nm, stretch, &cable->saturations);
    cable->slider_nm[slider_index(path, side, slider)] =
        side == CABLE_PROXIMAL ? inward_nm : -inward_nm;
}

/* The nodes of `side` stop: they become memory. */
static void remember(cable_t *cable, const cable_path_t *path, cable_side_t side) {
    const uint8_t nodes = cable->end[side].moving_nodes;
    for (uint8_t i = 0; i < nodes; i++) {
        cable->node_tension_un[node_index(path, side, i)] = moving_tension_un(cable, path, side, i);
        if (i + 1u < nodes) {
            remember_slider(cable, path, side, i);
        }
    }
    cable->end[side].moving_nodes = 0;
}

/* ---- the step ---- */

static void slide_as_a_whole(cable_t *cable, cable_side_t side) {
    const cable_side_t other = other_side(side);
    cable->motion = CABLE_MASS;
    cable->end[other].direction = other_direction(cable->end[side].direction);
    cable->end[side].moving_nodes = 0;
    cable->end[other].moving_nodes = 0;
}

/* The node past the front of `side` begins to move with it. */
static void join_node(cable_t *cable, const cable_path_t *path, cable_side_t side) {
    cable_end_t *end = &cable->end[side];
    cable_end_t *other = &cable->end[other_side(side)];
    if (end->moving_nodes + other->moving_nodes >
        path->segments) {                         /* it moves with the other end */
        if (other->direction != end->direction) { /* outward here and inward there: one way */
            slide_as_a_whole(cable, side);
            return;
        }
        const uint8_t given_up = (uint8_t)(other->moving_nodes - 1u);
        if (given_up > 0) { /* the slider behind it is the new place where the fronts meet */
            remember_slider(cable, path, other_side(side), (uint8_t)(given_up - 1u));
        }
        other->moving_nodes = given_up;
    }
    end->moving_nodes++;
    if (end->moving_nodes > path->segments) {
        slide_as_a_whole(cable, side);
    }
}

void cable_turn(cable_t *cable, const cable_path_t *path, cable_side_t side,
                cable_direction_t direction) {
    cable_end_t *end = &cable->end[side];
    switch (cable->motion) {
    case CABLE_SLACK:
        end->direction = direction;
        return;
    case CABLE_MASS:
        if (end->direction == direction) {
            return;
        }
        end->moving_nodes = (uint8_t)(path->segments + 1u);
        remember(cable, path, side);
        cable->motion = CABLE_PARTIAL;
        break;
    case CABLE_PARTIAL:
    default:
        if (end->moving_nodes > 0 && end->direction == direction) {
            return;
        }
        remember(cable, path, side);
        break;
    }
    end->direction = direction;
    join_node(cable, path, side);
}

cable_piece_t cable_piece(cable_t *cable, const cable_path_t *path, cable_side_t side) {
    const cable_end_t *end = &cable->end[side];
    const bool pull = end->direction == CABLE_PULL;
    const int32_t unlimited_nm = pull ? -INT32_MAX : INT32_MAX;
    if (cable->motion == CABLE_PARTIAL) {
        const uint8_t k = (uint8_t)(end->moving_nodes - 1u);
        const cable_front_t *front = front_at(path, side, end, k);
        const int32_t anchor_nm = slider_inward_nm(cable, path, side, k);
        uint32_t out_of_reach = 0; /* a slider that nothing in range can break is no error */
        const int32_t stretch =
            fixed_scale(tension_ahead_un(cable, path, side), front->breakaway, &out_of_reach);
        const int32_t limit_nm = fixed_subtract(anchor_nm, stretch, &out_of_reach);
        return (cable_piece_t){
            .anchor_nm = anchor_nm,
            .limit_nm = out_of_reach > 0 ? unlimited_nm : limit_nm,
            .stiffness = front->stiffness,
        };
    }
    const int32_t anchor_nm = -cable->end[other_side(side)].inward_nm;
    if (cable->motion == CABLE_MASS) {
        return (cable_piece_t){
            .anchor_nm = anchor_nm,
            .limit_nm = pull ? unlimited_nm : anchor_nm,
            .stiffness = front_at(path, side, end, path->segments)->stiffness,
        };
    }
    return (cable_piece_t){
        .anchor_nm = anchor_nm,
        .limit_nm = pull ? anchor_nm : unlimited_nm,
        .stiffness = {0},
    };
}

int32_t cable_tension_un(const cable_piece_t *piece, int32_t inward_nm, uint32_t *saturations) {
    const int32_t stretch = fixed_subtract(piece->anchor_nm, inward_nm, saturations);
    return fixed_scale(stretch, piece->stiffness, saturations);
}

void cable_pass(cable_t *cable, const cable_path_t *path, cable_side_t side) {
    switch (cable->motion) {
    case CABLE_MASS:
        go_slack(cable);
        break;
    case CABLE_SLACK: /* taut again: from zero tension the whole cable slides at once */
        slide_as_a_whole(cable, side);
        break;
    case CABLE_PARTIAL:
    default:
        join_node(cable, path, side);
        break;
    }
}

void cable_place(cable_t *cable, const cable_path_t *path, cable_side_t side, int32_t inward_nm) {
    cable_end_t *end = &cable->end[side];
    end->inward_nm = inward_nm;
    if (cable->motion == CABLE_SLACK) {
        return;
    }
    const cable_piece_t piece = cable_piece(cable, path, side);
    const int32_t tension_un = cable_tension_un(&piece, inward_nm, &cable->saturations);
    end->tension_un = tension_un > 0 ? tension_un : 0;
    if (cable->motion == CABLE_MASS) {
        cable->end[other_side(side)].tension_un =
            moving_tension_un(cable, path, side, path->segments);
    }
}

static bool reached(const cable_end_t *end, int32_t inward_nm, int32_t limit_nm) {
    return end->direction == CABLE_PULL ? inward_nm <= limit_nm : inward_nm >= limit_nm;
}

void cable_move(cable_t *cable, const cable_path_t *path, cable_side_t side, int32_t inward_nm) {
    cable_end_t *end = &cable->end[side];
    if (inward_nm == end->inward_nm) {
        return;
    }
    cable_turn(cable, path, side, inward_nm < end->inward_nm ? CABLE_PULL : CABLE_RELEASE);
    for (uint32_t pieces = 0; pieces < CABLE_PIECES_MAX; pieces++) {
        const cable_piece_t piece = cable_piece(cable, path, side);
        const bool unlimited = piece.limit_nm == INT32_MAX || piece.limit_nm == -INT32_MAX;
        if (unlimited || !reached(end, inward_nm, piece.limit_nm)) {
            break;
        }
        cable_pass(cable, path, side);
    }
    cable_place(cable, path, side, inward_nm);
}

bool cable_is_slack(const cable_t *cable) {
    return cable->motion == CABLE_SLACK;
}
