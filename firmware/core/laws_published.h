/* laws_published.h: four laws from the literature, each as its authors mean it, for comparison on
 * the same rigs. They share the naive torque, wanted / rho, and add to it:
 *
 *   Townsend & Salisbury 1987, Coulomb feed-forward   F sign(v), behind a short lag
 *   Townsend & Salisbury 1987, integral force control integral of the force error
 *   Agrawal, Peine & Yao 2010, smooth inverse         F chi: chi runs from -1 to 1 while the load
 *                                                     goes through the backlash B
 *   Do et al. 2014, adaptive hysteresis               A zeta: zeta' = (2/B) (v - abs(v) zeta), and
 *                                                     A' = gamma error zeta
 * F: friction of the sliding pair at the motor. The inverse of a backlash in position becomes a
 * torque here because the drive gives torques: half the backlash times the pair's stiffness is F/2,
 * and as much again is what friction takes at the other end.
 */
#ifndef BOWDEN_CORE_LAWS_PUBLISHED_H
#define BOWDEN_CORE_LAWS_PUBLISHED_H

#include <stdbool.h>
#include <stdint.h>

#include "estimator.h"
#include "fixed.h"
#include "sliding.h"

typedef struct {
    /* constants; torques at the motor */
    ratio_t motor_per_load_torque; /* 1 / rho */
    ratio_t chi_per_arc;           /* Q15 per nm of load arc: 2 / B */
    int32_t friction_unm;
    int32_t integral_ticks;
    int32_t smoothing_ticks;
    /* state */
    int32_t last_arc_nm;
    int32_t sign_q15;      /* of the load's speed, behind a lag */
    int32_t chi_q15;       /* Agrawal's, a play of the load's path */
    int32_t zeta_q15;      /* Do's */
    int32_t amplitude_unm; /* Do's */
    int64_t integral_q8;   /* of the force error, at the motor, in uN m */
    bool started;
} published_t;

/* Constants and a start at rest. */
published_t published_of(const transmission_t *transmission, const sliding_t *sliding,
                         uint32_t ticks_per_s, uint32_t integral_gain_mhz);

/* The states follow the load, whichever law runs. `error_unm`: wanted minus load torque, at the
 * load; `running`: this law's integrals may move. */
void published_step(published_t *published, const estimator_t *estimator, int32_t load_arc_nm,
                    int32_t error_unm, bool integral_runs, bool hysteresis_runs);

/* Motor torques that the laws add to the naive one. */
int32_t published_coulomb_unm(const published_t *published);
int32_t published_integral_unm(const published_t *published);
int32_t published_smooth_inverse_unm(const published_t *published);
int32_t published_hysteresis_unm(const published_t *published);

#endif
