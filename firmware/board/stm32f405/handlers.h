/* handlers.h: the functions that the vector table names, and who defines them. */
#ifndef BOWDEN_STM32F405_HANDLERS_H
#define BOWDEN_STM32F405_HANDLERS_H

int main(void);             /* main.c */
void reset_handler(void);   /* startup.c */
void crash_handler(void);   /* crash.c: every fault, NMI and unexpected interrupt */
void systick_handler(void); /* control.c: 4 kHz, priority 0 */
void adc_handler(void);     /* fast_loop.c: 20 kHz */
void can_rx0_handler(void); /* can.c */
void exti9_5_handler(void); /* encoders.c: index pulses */
void pendsv_handler(void);  /* control.c: the control tick, lowest priority */

#endif
