/* native.h: the drive as a shared library for this machine, for the bench and the tests.
 *
 * Everything that is not static in core, drive and canopen is exported; this header gathers it and
 * adds the sizes that a caller needs to bring the memory. `gcc -E -P native.h` is the cffi
 * declaration text (the Makefile writes it to native.cdef), so that nothing is declared twice.
 */
#ifndef BOWDEN_BOARD_NATIVE_H
#define BOWDEN_BOARD_NATIVE_H

#include <stddef.h>

#include "../../core/cable.h"
#include "../../core/compensation.h"
#include "../../core/encoder.h"
#include "../../core/fixed.h"
#include "../../core/transmission.h"
#include "../../core/tunnel.h"
#include "../../drive/drive.h"
#include "../board.h"

/* Bytes of a drive_t. */
size_t native_drive_size(void);

/* Runs `count` torque-position steps of a transmission and notes, per step, motor angle (urad),
 * load torque (uN m), tensions motor a, load a, motor b, load b (uN) and flags in seven columns of
 * `results`. One call a trajectory keeps tests fast. */
void native_run_torque(transmission_t *transmission, const int32_t *motor_torque_unm,
                       const int32_t *load_arc_nm, int32_t *results, size_t count);

/* The same in position-position mode; the first column is the motor torque (uN m). */
void native_run_position(transmission_t *transmission, const int32_t *motor_arc_nm,
                         const int32_t *load_arc_nm, int32_t *results, size_t count);

#endif
