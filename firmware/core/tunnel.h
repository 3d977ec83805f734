/* tunnel.h: the error-reduction tunnel, eq. (7): no torque within a half width around zero, a
 * spring back to it outside, saturating. Exactly odd in the angle: torque(-angle) = -torque(angle).
 * Pure; the constants are computed once from the settings.
 */
#ifndef BOWDEN_CORE_TUNNEL_H
#define BOWDEN_CORE_TUNNEL_H

#include <stdint.h>

#include "fixed.h"

typedef struct {
    int32_t half_width_urad;
    int32_t limit_unm;
    ratio_t stiffness; /* uN m per urad */
} tunnel_t;

/* half_width_urad and limit_unm 0 .. INT32_MAX. */
tunnel_t tunnel_of(uint32_t half_width_urad, uint32_t stiffness_unm_per_rad, uint32_t limit_unm);

/* Torque on the motor for a displacement: restoring, at most limit_unm. */
int32_t tunnel_torque_unm(const tunnel_t *tunnel, int32_t angle_urad);

#endif
