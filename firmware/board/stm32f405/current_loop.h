/* current_loop.h: the 20 kHz current controller: proportional and integral, in integers. Pure.
 *
 * Gains from the winding (motor_resistance, motor_inductance) by pole cancellation, bandwidth 1 kHz
 * (Kp = 2 pi f L, Ki = 2 pi f R): 63 degrees of phase margin with the one and a half periods of
 * delay of sampled PWM. Dividing by the measured supply keeps the loop's gain when the supply sags.
 * While the output is at its limit the integral follows what the output can do (anti-windup).
 */
#ifndef BOWDEN_STM32F405_CURRENT_LOOP_H
#define BOWDEN_STM32F405_CURRENT_LOOP_H

#include <stdbool.h>
#include <stdint.h>

/* Output range, counts of a full scale of 4200 (PWM_TOP): 95 %, so that the high sides' bootstrap
 * capacitors are recharged in every period. */
#define CURRENT_LOOP_TOP 4200
#define CURRENT_LOOP_DUTY_MAX 3990

/* Beyond it the reference is cut: 12 A leaves room to the converter's 16.4 A. */
#define CURRENT_LOOP_REFERENCE_MAX_UA 12000000

/* Below it, 6 V, nothing is controlled: the output is 0. */
#define CURRENT_LOOP_BUS_MIN_MV 6000

typedef struct {
    int32_t integral_uv; /* start with 0 */
} current_loop_t;

typedef struct {
    int32_t kp_q16, ki_q16; /* volt per ampere in 2^-16; the second in each period */
    int32_t ki_per_kp_q16;
} current_loop_gains_t;

/* For a winding of 10 mohm .. 20 ohm and 50 uH .. 20 mH. One whose time constant L/R is below
 * 0.1 ms gets a slower integral. */
current_loop_gains_t current_loop_gains(uint32_t resistance_uohm, uint32_t inductance_nh);

/* One step. reference_ua any; current_ua +-16.4e6; bus_mv 0 .. 41000. Returns the duty difference
 * of the legs, -CURRENT_LOOP_DUTY_MAX .. CURRENT_LOOP_DUTY_MAX. */
int32_t current_loop_step(current_loop_t *loop, const current_loop_gains_t *gains,
                          int32_t reference_ua, int32_t current_ua, int32_t bus_mv);

#endif
