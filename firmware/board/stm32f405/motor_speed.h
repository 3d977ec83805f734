/* motor_speed.h: the motor's back-EMF for the current monitor, from the encoder at 4 kHz. Pure.
 *
 * The mean speed over the last 2 ms, and how much it differs from that over the 2 ms before: what
 * it may have changed by since.
 */
#ifndef BOWDEN_STM32F405_MOTOR_SPEED_H
#define BOWDEN_STM32F405_MOTOR_SPEED_H

#include <stdint.h>

#include "current_monitor.h"

#define MOTOR_SPEED_TICKS 8u

typedef struct {
    int32_t counts[2u * MOTOR_SPEED_TICKS]; /* a ring */
    uint32_t next;
    int32_t uv_per_count;                         /* back-EMF of a count in MOTOR_SPEED_TICKS */
    uint32_t constant_unm_per_a, counts_per_turn; /* that this follows from */
} motor_speed_t;

/* One tick: brings the speed in *motor up to date. */
void motor_speed_step(motor_speed_t *speed, int32_t counts, uint32_t constant_unm_per_a,
                      uint32_t counts_per_turn, current_monitor_motor_t *motor);

#endif
