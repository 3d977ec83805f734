/* current_monitor.h: does the measured current follow from the voltage on the motor? 20 kHz. Pure.
 *
 * In a period T the current changes by T/L (u - R i - e), with the voltage u that the bridge has
 * put out (less what its dead time takes) and the back-EMF e. What the measured change differs by
 * is summed up, and forgotten over eight periods: a sensor that jumps by A is seen with A, one that
 * is wrong by A steadily with 8 R T/L A, and one that no longer moves within a few periods, because
 * the current loop then runs away with the voltage. Nothing is adapted, so nothing can drift.
 *
 * Off by more than 2 A, two fifths of the current (a resistance that is wrong by half: copper
 * gains 40 % in 100 K) and what the speed may have changed meanwhile, it is a fault.
 */
#ifndef BOWDEN_STM32F405_CURRENT_MONITOR_H
#define BOWDEN_STM32F405_CURRENT_MONITOR_H

#include <stdbool.h>
#include <stdint.h>

#include "../../drive/drive.h"

#define CURRENT_MONITOR_LIMIT_UA SUPERVISION_CURRENT_MODEL_LIMIT_UA

/* The motor, as it is now; written by the control tick. */
typedef struct {
    int32_t per_uv_q16;   /* T/L, uA per uV in a period */
    int32_t per_ua_q16;   /* R T/L */
    int32_t back_emf_uv;  /* from the encoder, mean of the last 2 ms */
    int32_t uncertain_ua; /* what the sum may be off by for the change of speed meanwhile */
} current_monitor_motor_t;

typedef struct {
    uint32_t samples;         /* since the bridge went on, up to those that it takes to begin */
    int32_t current_ua;       /* of the last sample */
    int32_t last_uv, next_uv; /* put out in the period that begins, and in the one after it */
    int32_t off_ua;           /* the sum */
} current_monitor_t;

/* What follows from the motor's data: uohm and nH of the winding; inductance >= 50 uH. */
current_monitor_motor_t current_monitor_motor(uint32_t resistance_uohm, uint32_t inductance_nh);

/* One sample with the bridge on, before the controller's step; true: the current does not follow.
 * Start with a monitor that is all 0. current_ua within +-32e6, bus_mv 0 .. 41000. */
bool current_monitor_step(current_monitor_t *monitor, const current_monitor_motor_t *motor,
                          int32_t current_ua, int32_t bus_mv);

/* What the controller has put out: the duty of current_loop_step(), which acts in the period after
 * the one that begins. */
void current_monitor_note(current_monitor_t *monitor, int32_t duty, int32_t bus_mv);

#endif
