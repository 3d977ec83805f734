/* cable.h: the reduced-segment model of one cable in its conduit, both ends of which may move.
 *
 * What it is made of, a chain of springs and friction elements called sliders, is in cable_path.h.
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

#include "cable_path.h"

/* Most pieces that one end can pass in one motion: N nodes, slack and taut again. */
#define CABLE_PIECES_MAX (CABLE_SEGMENTS_MAX + 3)

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

/* A virgin cable: uniform pretension, u = T0 x/EA, so u = 0 at the motor. */
void cable_start(cable_t *cable, const cable_path_t *path);

/* Moves one end to `inward_nm`; the other stays where it is. */
void cable_move(cable_t *cable, const cable_path_t *path, cable_side_t side, int32_t inward_nm);

/* The same, but through `most` pieces only, >= 1; where they are not enough, the end stays at the
 * end of the last one. True: it has arrived. */
bool cable_move_through(cable_t *cable, const cable_path_t *path, cable_side_t side,
                        int32_t inward_nm, uint32_t most);

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

/* Tension of a node, 0 .. path->segments, counted from the proximal end. */
int32_t cable_node_tension_un(const cable_t *cable, const cable_path_t *path, uint8_t node);

/* Is the whole cable slack? */
bool cable_is_slack(const cable_t *cable);

#endif
