/* cable_path.h: what a cable and its conduit are made of, and the constants that follow from it.
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
 * Everything exponential and every division is done here, once, a piece at a time; cable.h steps
 * with multiplications.
 */
#ifndef BOWDEN_CORE_CABLE_PATH_H
#define BOWDEN_CORE_CABLE_PATH_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"

#define CABLE_SEGMENTS_MAX 40

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
    ratio_t tension;    /* node k : end */
    ratio_t compliance; /* end against slider k, nm per uN; k = N: of the whole cable */
    ratio_t stiffness;  /* 1 / compliance */
    ratio_t breakaway;  /* end against slider k when that breaks : tension of node k + 1 */
} cable_front_t;

/* The configured cable: constants only. Both cables of a pair share one. About 7 KB. */
typedef struct {
    uint8_t segments;
    uint32_t wrap_q24;                                 /* m, the wrap exponent of the whole cable */
    int32_t pretension_stretch_nm;                     /* T0 L/EA */
    int32_t start_tension_un;                          /* of the nodes at that stretch */
    int32_t slider_start_nm[CABLE_SEGMENTS_MAX];       /* u of each slider at the start */
    cable_front_t front[2][2][CABLE_SEGMENTS_MAX + 1]; /* [side][direction][k] */
} cable_path_t;

/* What one segment contributes. */
typedef struct {
    ratio_t half_compliance; /* tanh(a/2)/a dx/EA, nm per uN */
    uint32_t wrap_q24;       /* mu_d dx/R: capstan exponent when it slips */
    uint32_t stiction_q24;   /* (mu_s - mu_d) l_s/R: what breakaway takes on top */
} cable_segment_t;

/* Stages of the computation, each a walk from an end to the other: all segments, the sliders'
 * start, then the fronts of each side and direction. */
enum {
    CABLE_BUILD_SEGMENTS,
    CABLE_BUILD_SLIDERS,
    CABLE_BUILD_FRONTS,
    CABLE_BUILD_DONE = CABLE_BUILD_FRONTS + 4,
};

/* How far the computation of a path has come. About 700 bytes. */
typedef struct {
    uint8_t stage;                               /* CABLE_BUILD_SEGMENTS .. CABLE_BUILD_DONE */
    uint8_t next;                                /* segment or node of the stage */
    cable_segment_t segment[CABLE_SEGMENTS_MAX]; /* from the motor */
    ratio_t mesh_compliance;                     /* of the nodes, at equal tension */
    ratio_t whole_compliance;                    /* L/EA */
    ratio_t tension, compliance;                 /* where the walk is, to its end */
    uint32_t wrap_q24;
} cable_build_t;

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

/* Checks the settings; the first defect, and the segment it is in (0 when it is in none). Some 50
 * instructions a segment. */
cable_defect_t cable_check(const cable_settings_t *settings, uint8_t *segment);

/* The wrap exponent, sum of mu dx/R, at most CABLE_WRAP_MAX_Q24. Any settings. */
uint32_t cable_wrap_q24(const cable_settings_t *cable);

/* Starts to compute the constants from settings that cable_check() found fine; they stay the same
 * until it is done. Meanwhile *path is of no use. */
void cable_build_start(cable_path_t *path, cable_build_t *build, const cable_settings_t *settings);

/* Computes the next of CABLE_BUILD_STEPS_MAX pieces, each at most 2000 instructions; true: done. */
bool cable_build_step(cable_path_t *path, cable_build_t *build, const cable_settings_t *settings);

#define CABLE_BUILD_STEPS_MAX (6u * CABLE_SEGMENTS_MAX + 4u)

#endif
