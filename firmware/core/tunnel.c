/* tunnel.c: see tunnel.h. */
#include "tunnel.h"

tunnel_t tunnel_of(uint32_t half_width_urad, uint32_t stiffness_unm_per_rad, uint32_t limit_unm) {
    return (tunnel_t){
        .half_width_urad = (int32_t)half_width_urad,
        .limit_unm = (int32_t)limit_unm,
        .stiffness = ratio_of(stiffness_unm_per_rad, 1000000),
    };
}

int32_t tunnel_torque_unm(const tunnel_t *tunnel, int32_t angle_urad) {
    uint32_t saturations = 0; /* beyond the range of int32_t the torque limit holds anyway */
    const int32_t inside_urad =
        fixed_clamp(angle_urad, -tunnel->half_width_urad, tunnel->half_width_urad);
    const int32_t outside_urad = fixed_subtract(angle_urad, inside_urad, &saturations);
    const int32_t spring_unm = fixed_scale(outside_urad, tunnel->stiffness, &saturations);
    return -fixed_clamp(spring_unm, -tunnel->limit_unm, tunnel->limit_unm);
}
