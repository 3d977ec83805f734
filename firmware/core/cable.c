/* cable.c: see cable.h. */
#include "cable.h"

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
static int32_t moving_tension_un(const cable_t *cable, const cable_path_t *path, cable_side_t side,
                                 uint8_t node, uint32_t *saturations) {
    const cable_end_t *end = &cable->end[side];
    return fixed_scale(end->tension_un, front_at(path, side, end, node)->tension, saturations);
}

/* Tension of the first node past the front of `side`: memory, or moving with the other end. */
static int32_t tension_ahead_un(cable_t *cable, const cable_path_t *path, cable_side_t side) {
    const uint8_t node = cable->end[side].moving_nodes;
    const uint8_t from_other = (uint8_t)(path->segments - node);
    const cable_side_t other = other_side(side);
    if (from_other < cable->end[other].moving_nodes) {
        return moving_tension_un(cable, path, other, from_other, &cable->saturations);
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
        cable->node_tension_un[node_index(path, side, i)] =
            moving_tension_un(cable, path, side, i, &cable->saturations);
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
            moving_tension_un(cable, path, side, path->segments, &cable->saturations);
    }
}

static bool reached(const cable_end_t *end, int32_t inward_nm, int32_t limit_nm) {
    return end->direction == CABLE_PULL ? inward_nm <= limit_nm : inward_nm >= limit_nm;
}

bool cable_move_through(cable_t *cable, const cable_path_t *path, cable_side_t side,
                        int32_t inward_nm, uint32_t most) {
    cable_end_t *end = &cable->end[side];
    if (inward_nm == end->inward_nm) {
        return true;
    }
    cable_turn(cable, path, side, inward_nm < end->inward_nm ? CABLE_PULL : CABLE_RELEASE);
    int32_t place_nm = end->inward_nm; /* never back: a piece may have been passed before */
    for (uint32_t pieces = 0; pieces < most; pieces++) {
        const cable_piece_t piece = cable_piece(cable, path, side);
        const bool unlimited = piece.limit_nm == INT32_MAX || piece.limit_nm == -INT32_MAX;
        if (unlimited || !reached(end, inward_nm, piece.limit_nm)) {
            cable_place(cable, path, side, inward_nm);
            return true;
        }
        if (reached(end, piece.limit_nm, place_nm)) {
            place_nm = piece.limit_nm;
        }
        cable_pass(cable, path, side);
    }
    const bool all = most >= CABLE_PIECES_MAX;
    cable_place(cable, path, side, all ? inward_nm : place_nm);
    return all;
}

void cable_move(cable_t *cable, const cable_path_t *path, cable_side_t side, int32_t inward_nm) {
    (void)cable_move_through(cable, path, side, inward_nm, CABLE_PIECES_MAX);
}

int32_t cable_node_tension_un(const cable_t *cable, const cable_path_t *path, uint8_t node) {
    if (cable->motion == CABLE_SLACK) {
        return 0;
    }
    uint32_t told = 0; /* the step has counted what is beyond the range */
    const uint8_t from_distal = (uint8_t)(path->segments - node);
    const bool slides = cable->motion == CABLE_MASS;
    if (slides || node < cable->end[CABLE_PROXIMAL].moving_nodes) {
        return moving_tension_un(cable, path, CABLE_PROXIMAL, node, &told);
    }
    return from_distal < cable->end[CABLE_DISTAL].moving_nodes
               ? moving_tension_un(cable, path, CABLE_DISTAL, from_distal, &told)
               : cable->node_tension_un[node];
}

bool cable_is_slack(const cable_t *cable) {
    return cable->motion == CABLE_SLACK;
}
