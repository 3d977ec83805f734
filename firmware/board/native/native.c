/* native.c: see native.h. */
#include "native.h"

#define COLUMNS 7

size_t native_drive_size(void) {
    return sizeof(drive_t);
}

static void note(transmission_t *transmission, int32_t first, int32_t *row) {
    const transmission_t *t = transmission;
    row[0] = first;
    row[1] = transmission_load_torque_unm(transmission);
    row[2] = t->a.end[CABLE_PROXIMAL].tension_un;
    row[3] = t->a.end[CABLE_DISTAL].tension_un;
    row[4] = t->b.end[CABLE_PROXIMAL].tension_un;
    row[5] = t->b.end[CABLE_DISTAL].tension_un;
    row[6] = t->flags;
}

void native_run_torque(transmission_t *transmission, const int32_t *motor_torque_unm,
                       const int32_t *load_arc_nm, int32_t *results, size_t count) {
    for (size_t i = 0; i < count; i++) {
        transmission_step_torque(transmission, motor_torque_unm[i], load_arc_nm[i]);
        note(transmission, transmission_motor_angle_urad(transmission), &results[COLUMNS * i]);
    }
}

void native_run_position(transmission_t *transmission, const int32_t *motor_arc_nm,
                         const int32_t *load_arc_nm, int32_t *results, size_t count) {
    for (size_t i = 0; i < count; i++) {
        transmission_step_position(transmission, motor_arc_nm[i], load_arc_nm[i]);
        note(transmission, transmission_motor_torque_unm(transmission), &results[COLUMNS * i]);
    }
}
