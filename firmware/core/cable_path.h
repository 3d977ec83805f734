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
 * Everything exponential and every division is done here, once; cable.h steps with multiplications.
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

/* The wrap exponent, sum of mu dx/R, at most CABLE_WRAP_MAX_Q24. Any settings. */
uint32_t cable_wrap_q24(const cable_settings_t *cable);

/* Computes the constants from settings that cable_check() found fine; else *path is not changed and
 * the result is false. Slow, for the configuration only: some thousand instructions a segment. */
bool cable_configure(cable_path_t *path, const cable_settings_t *settings);

#endif
