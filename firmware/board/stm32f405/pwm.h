/* pwm.h: the H-bridge on TIM1: two complementary legs, centre-aligned, 20 kHz.
 *
 * TIM1's update, once a period, also starts the converter (analog.h). "Off" is MOE = 0: all four
 * gates low, so that the motor current dies through the diodes. The bridge's own fault line (break
 * input) and a failing crystal do the same in hardware, without the core.
 */
#ifndef BOWDEN_STM32F405_PWM_H
#define BOWDEN_STM32F405_PWM_H

#include <stdbool.h>
#include <stdint.h>

#define PWM_TOP 4200 /* timer counts of half a period: 168 MHz / (2 * 4200) = 20 kHz */

/* Starts the timer with the bridge off. A debugger that halts the core stops the timer, too, and
 * its outputs open as after a break; see also watchdog.h. */
void pwm_start(void);

/* Mean voltage on the motor as a fraction of the supply: duty of leg A minus that of leg B,
 * -PWM_TOP .. PWM_TOP. Takes effect at the next update. */
void pwm_set(int32_t duty);

/* Switches the bridge on; not when it is locked. */
void pwm_on(void);

/* Switches the bridge off at once. Also allowed from any interrupt. */
void pwm_off(void);

/* Switches the bridge off until the next reset of the chip. */
void pwm_lock(void);

/* Is the bridge on? */
bool pwm_is_on(void);

/* Has the fault line opened the bridge since the last call? Stays true while it is active. */
bool pwm_take_break(void);

#endif
