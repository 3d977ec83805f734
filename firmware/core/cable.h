/* cable.h: the reduced-segment model of one cable in its conduit, both ends of which may move.
 *
 * The mesh. N segments make N + 1 nodes, of which each carries a tension. Friction acts in the
 * middle of each segment, at a *slider*: a slider that slips holds the tensions of its two nodes at
 * the capstan ratio exp(a), a = mu dx/R, eq. (1); one that sticks does not move, eq. (3). Between
 * two sliders lies the cable of two half segments, at the node's tension: a chain of springs and
 * friction elements that could be built, so it cannot make energy, and a change of direction makes
 * no tension jump. The compliance of a half is tanh(a/2)/a dx/EA (dx/(2 EA) for a = 0): with it a
 * slipping segment obeys eq. (2) exactly, both ways. A cable at uniform tension is then a^2/12 too
 * stiff (0.05 % at 20 segments of Table I); the start keeps the stretch T0 L/EA, not the tension,
 * because that is what the tensions of a moving pair follow from.
 *
 * The state. Each end owns the *moving nodes* from itself to the "last moving node"; they follow
 * from its own tension. Between the two regions lies the memory: the tensions and slider positions
 * that the last motion left there. A slider at the front breaks away, eq. (4), when its two
 * tensions differ by the static ratio; the node behind it then moves too. When an end changes
 * direction it writes its nodes to the memory and starts again from its first node: the profile is
 * the memory, nothing else is. When the fronts meet, opposite motions leave one slider stuck
 * between them; equal ones make the whole cable slide. A cable whose stretch is used up is slack:
 * no tension anywhere.
 *
 * Coordinates. Everything at an end is seen from that end: *inward* is displacement into the
 * conduit, u at the proximal (motor) end and -u at the distal (load) end. An end *pulls* while it
 * moves outward (its tension is the highest there) and *releases* while it moves inward. One code
 * serves both ends.
 *
 * Cost: a step is O(nodes that start or stop to move), at most N + 2 pieces; no division.
 */
#ifndef BOWDEN_CORE_CABLE_H
#define BOWDEN_CORE_CABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"

#define CABLE_SEGMENTS_MAX 40

/* Most pieces that one end can pass in one motion: N nodes, slack and taut again. */
#define CABLE_PIECES_MAX (CABLE_SEGMENTS_MAX + 3)

/* Largest wrap exponent, the sum of mu dx/R over the cable: a tension ratio of 2981. */
#define CABLE_WRAP_MAX_Q24 (8u * FIXED_Q24_ONE)

/* What a cable is made of; the units of the object dictionary. */
typedef struct {
    uint32_t axial_stiffness_mn;                               /* EA; > 0 */
    int32_t pretension_un;                                     /* >= 0 */
    uint8_t segments;                                          /* 1 .. CABLE_SEGMENTS_MAX */
    uint32_t segment_length_um[CABLE_SEGMENTS_MAX];            /* > 0; first the one at the motor */
    uint32_t segment_curvature_per_1000km[CABLE_SEGMENTS_MAX]; /* 1/R; 0 is straight */
    uint32_t friction_dynamic_ppm;                             /* mu_d */
    uint32_t friction_static_ppm; /* mu_s >= mu_d; acts in the breakaway test only */
    uint32_t stiction_length_um;  /* length over which mu_s - mu_d acts ahead of a front */
} cable_settings_t;

typedef enum { CABLE_PROXIMAL, CABLE_DISTAL } cable_side_t;
typedef enum { CABLE_PULL, CABLE_RELEASE } cable_direction_t;

/* Constants of a front at node k, counted from the end that moves; tension ratios to that end. */
typedef struct {
    ratio_t tension; /* node k : end */
    ratio_t
        compliance;    /* displacement of the end against slider k, nm per uN; k = N: whole cable */
    ratio_t stiffness; /* 1 / compliance */
    ratio_t breakaway; /* that displacement when slider k breaks : tension of node k + 1 */
} cable_front_t;

/* The configured cable: constants only. Both cables of a pair share one. About 7 KB. */
typedef struct {
    uint8_t segments;
    int32_t pretension_stretch_nm;                     /* T0 L/EA */
    int32_t start_tension_un;                          /* of the nodes at that stretch */
    int32_t slider_start_nm[CABLE_SEGMENTS_MAX];       /* u of each slider at the start */
    cable_front_t front[2][2][CABLE_SEGMENTS_MAX + 1]; /* [side][direction][k] */
} cable_path_t;

typedef enum {
    CABLE_PARTIAL, /* a part of the cable, or none of it, moves */
    CABLE_MASS,    /* the whole cable slides */
    CABLE_SLACK,
} cable_motion_t;

/* One end. While CABLE_PARTIAL it owns nodes 0 .. moving_nodes - 1, counted from itself. */
typedef struct {
    int32_t inward_nm;
    int32_t tension_un;
    uint8_t moving_nodes; /* 0: its node is part of the memory */
    cable_direction_t direction;
} cable_end_t;

/* The state of one cable. */
typedef struct {
    cable_motion_t motion;
    cable_end_t end[2];                              /* [cable_side_t] */
    int32_t node_tension_un[CABLE_SEGMENTS_MAX + 1]; /* memory; from the proximal end */
    int32_t slider_nm[CABLE_SEGMENTS_MAX];           /* memory: u of each slider */
    uint32_t saturations;                            /* sticky count since cable_start() */
} cable_t;

/* Why settings cannot run. */
typedef enum {
    CABLE_FINE,
    CABLE_BAD_STIFFNESS,       /* EA is 0 */
    CABLE_BAD_PRETENSION,      /* negative, or its stretch is over 2.1 m */
    CABLE_BAD_SEGMENTS,        /* none or too many */
    CABLE_BAD_LENGTH,          /* of a segment: 0 */
    CABLE_BAD_WRAP,            /* at this segment the wrap exponent passes CABLE_WRAP_MAX_Q24 */
    CABLE_BAD_STATIC_FRICTION, /* mu_s < mu_d */
    CABLE_BAD_STICTION_LENGTH, /* at this segment the breakaway exponent passes the limit */
} cable_defect_t;

/* Checks the settings; the first defect, and the segment it is in (0 when it is in none). */
cable_defect_t cable_check(const cable_settings_t *settings, uint8_t *segment);

/* Computes the constants from settings that cable_check() found fine; else *path is not changed and
 * the result is false. Slow, for the configuration only: some thousand instructions a segment. */
bool cable_configure(cable_path_t *path, const cable_settings_t *settings);

/* A virgin cable: uniform pretension, u = T0 x/EA, so u = 0 at the motor. */
void cable_start(cable_t *cable, const cable_path_t *path);

/* Moves one end to `inward_nm`; the other stays where it is. */
void cable_move(cable_t *cable, const cable_path_t *path, cable_side_t side, int32_t inward_nm);

/* ---- The same step in pieces, for a motor end whose torque is given and position sought ---- */

/* Makes an end ready to move in a direction: a reversal writes the memory. */
void cable_turn(cable_t *cable, const cable_path_t *path, cable_side_t side,
                cable_direction_t direction);

/* The present linear piece: tension = (anchor - inward) * stiffness, as long as the end moves in
 * its direction and has not reached `limit_nm`, where cable_pass() must be called. Without a limit
 * it is -INT32_MAX (pull) or INT32_MAX (release). */
typedef struct {
    int32_t anchor_nm;
    int32_t limit_nm;
    ratio_t stiffness; /* 0 while slack */
} cable_piece_t;

cable_piece_t cable_piece(cable_t *cable, const cable_path_t *path, cable_side_t side);

/* Tension of the end on a piece. */
int32_t cable_tension_un(const cable_piece_t *piece, int32_t inward_nm, uint32_t *saturations);

/* Enters the next piece: a node joins, the cable begins to slide as a whole, goes slack or taut. */
void cable_pass(cable_t *cable, const cable_path_t *path, cable_side_t side);

/* Puts an end at a place within its present piece and updates the tensions. */
void cable_place(cable_t *cable, const cable_path_t *path, cable_side_t side, int32_t inward_nm);

/* Is the whole cable slack? */
bool cable_is_slack(const cable_t *cable);

#endif
