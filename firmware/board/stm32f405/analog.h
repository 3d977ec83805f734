/* analog.h: the four analogue inputs, converted together 20 000 times a second.
 *
 * ADC1's injected group is started by TIM1's update and ends with the interrupt that fast_loop.c
 * handles. 12 bits; what a code means is scaling.h's business.
 */
#ifndef BOWDEN_STM32F405_ANALOG_H
#define BOWDEN_STM32F405_ANALOG_H

#include <stdint.h>

/* Codes of one group, 0 .. 4095. */
typedef struct {
    int32_t current, load_cell, bus_voltage, temperature;
} analog_sample_t;

/* Starts the converter. Call it before pwm_start() and wait 3 us in between. */
void analog_start(void);

/* Takes the group that has just ended and re-arms the interrupt. */
analog_sample_t analog_take(void);

#endif
