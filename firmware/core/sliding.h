/* sliding.h: the pair while all of it slides, in closed form: which motor torque belongs to which
 * load torque.
 *
 * Take motion for positive angles: cable a is pulled by the motor, cable b released. Each slides as
 * a whole, so its stretch and its tension at the motor are proportional, by the compliances C_p
 * (pull) and C_r (release) of cable_path.h, and its tension at the load is exp(-m) or exp(m) times
 * that at the motor, m the wrap exponent. The stretches of the two sum to 2 S, S = T0 L/EA. With
 * f = T_motor_a - T_motor_b and g = T_load_a - T_load_b:
 *
 *   (S1)  both taut     f = (g + beta) / alpha, alpha = (exp(-m) C_r + exp(m) C_p) / (C_p + C_r),
 *                       beta = 2 S (exp(m) - exp(-m)) / (C_p + C_r);
 *                       for one radius all the way: f = g + 2 T0 m
 *   (S2)  b slack       f = exp(m) g      above g = exp(-m) 2 S / C_p
 *   (S3)  a slack       f = exp(-m) g     below g = -exp(m) 2 S / C_r
 *
 * With a factor on the friction beta and m are multiplied by it. No slack points are needed then:
 * f is the largest of the three, since (S2) is the steepest and (S3) the flattest line.
 *
 * Motion for negative angles is the mirror image. Three segments of one broken line: no model step
 * is needed to invert it. Pure.
 */
#ifndef BOWDEN_CORE_SLIDING_H
#define BOWDEN_CORE_SLIDING_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"
#include "transmission.h"

/* Friction that is other than the pair's by a factor, in one direction. */
typedef struct {
    uint32_t q14;               /* 16384: it is the pair's own */
    uint32_t base_q14;          /* the factor near it that `fall` and `rise` are of */
    ratio_t fall, rise;         /* exp(-m), exp(m) with that */
    int32_t fall_q24, rise_q24; /* from there to this factor */
} sliding_factor_t;

typedef struct {
    sliding_factor_t factor[2];    /* [1] towards positive angles */
    ratio_t force_per_load_torque; /* uN per uN m */
    ratio_t motor_torque_per_force;
    ratio_t fall, rise;        /* exp(-m), exp(m) */
    ratio_t inverse_alpha;     /* of (S1) */
    int32_t friction_un;       /* beta / alpha */
    int32_t slack_b_above_un;  /* load force at which (S1) meets (S2); >= 0 */
    int32_t slack_a_below_un;  /* load force at which (S1) meets (S3); <= 0 */
    int32_t taut_most_unm;     /* motor torque that leaves b the floor tension */
    int32_t taut_least_unm;    /* motor torque that leaves a the floor tension */
    uint32_t wrap_q24;         /* m */
    int32_t motor_unm_per_rad; /* stiffness that acts on the motor, load at standstill */
} sliding_t;

/* Constants of a configured transmission. `slack_floor_un`: tension below which no cable is brought
 * on purpose; 0: the wanted torque may take one slack. */
sliding_t sliding_of(const transmission_t *transmission, int32_t slack_floor_un);

/* The motor torque at which `load_torque_unm` arrives while the pair slides; `sign` 1 or -1: for
 * positive or negative angles. Odd: (-load, -sign) gives exactly minus. */
int32_t sliding_motor_torque_unm(const sliding_t *sliding, int32_t load_torque_unm, int32_t sign);

/* Sets the factor on the friction for one direction, 1 or -1; 16384 is one. */
void sliding_set_factor(sliding_t *sliding, int32_t sign, uint32_t factor_q14);

/* The same pair with other levels of friction and pretension, factors on the given ones' in Q16,
 * 1/2 .. 3/2; with both one it is the same to the bit. The slack floor stays where it is. */
sliding_t sliding_adapted(const sliding_t *sliding, uint32_t friction_q16, uint32_t pretension_q16);

/* Load torque in halves of the one at which a cable goes slack: 0, 1, 2, and 3 for all beyond. */
int32_t sliding_slack_halves(const sliding_t *sliding, int32_t load_torque_unm, int32_t sign);

/* Motor torque at which the released cable goes slack while the pair slides. */
int32_t sliding_slack_motor_unm(const sliding_t *sliding);

/* Is this motor torque one that the slack floor has cut? */
bool sliding_holds_taut(const sliding_t *sliding, int32_t motor_torque_unm, int32_t sign);

#endif
