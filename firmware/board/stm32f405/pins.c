/* pins.c: see pins.h. Alternate functions: datasheet STM32F405 table 9; registers: RM0090 8.4. */
#include "pins.h"

#include <stdint.h>

#include "registers.h"

enum { INPUT, OUTPUT, ALTERNATE, ANALOG };
enum { FLOATING, PULL_UP, PULL_DOWN };

#define LAMP_PIN 13u /* PC13, on when low */

typedef struct {
    volatile gpio_registers_t *port;
    uint8_t pin, mode, alternate, pull;
} pin_t;

/* The pulls choose what a cut wire looks like: a fault of the bridge, gates off, no index pulses.
 */
static const pin_t PINS[] = {
    {GPIOA, 8, ALTERNATE, 1, PULL_DOWN},  /* bridge leg A high, TIM1_CH1 */
    {GPIOB, 13, ALTERNATE, 1, PULL_DOWN}, /* bridge leg A low, TIM1_CH1N */
    {GPIOA, 9, ALTERNATE, 1, PULL_DOWN},  /* bridge leg B high, TIM1_CH2 */
    {GPIOB, 14, ALTERNATE, 1, PULL_DOWN}, /* bridge leg B low, TIM1_CH2N */
    {GPIOB, 12, ALTERNATE, 1, PULL_DOWN}, /* bridge fault, TIM1_BKIN, active low */
    {GPIOC, 6, ALTERNATE, 2, PULL_UP},    /* motor encoder A, TIM3_CH1 */
    {GPIOC, 7, ALTERNATE, 2, PULL_UP},    /* motor encoder B, TIM3_CH2 */
    {GPIOC, 8, INPUT, 0, PULL_DOWN},      /* motor encoder index, EXTI8 */
    {GPIOB, 6, ALTERNATE, 2, PULL_UP},    /* load encoder A, TIM4_CH1 */
    {GPIOB, 7, ALTERNATE, 2, PULL_UP},    /* load encoder B, TIM4_CH2 */
    {GPIOB, 5, INPUT, 0, PULL_DOWN},      /* load encoder index, EXTI5 */
    {GPIOC, 0, ANALOG, 0, FLOATING},      /* motor current, ADC1 IN10 */
    {GPIOC, 1, ANALOG, 0, FLOATING},      /* load cell, ADC1 IN11 */
    {GPIOC, 2, ANALOG, 0, FLOATING},      /* bus voltage, ADC1 IN12 */
    {GPIOC, 3, ANALOG, 0, FLOATING},      /* conduit temperature, ADC1 IN13 */
    {GPIOB, 8, ALTERNATE, 9, PULL_UP},    /* CAN1_RX */
    {GPIOB, 9, ALTERNATE, 9, PULL_UP},    /* CAN1_TX */
    {GPIOC, LAMP_PIN, OUTPUT, 0, FLOATING},
};

static void set_field(volatile uint32_t *reg, uint32_t index, uint32_t width, uint32_t value) {
    const uint32_t mask = (1u << width) - 1u;
    *reg = (*reg & ~(mask << (index * width))) | value << (index * width);
}

void pins_start(void) {
    RCC->AHB1ENR |= RCC_AHB1ENR_GPIOAEN | RCC_AHB1ENR_GPIOBEN | RCC_AHB1ENR_GPIOCEN;
    core_barrier(); /* the clock needs two cycles to arrive (ES0182, delay after clock enabling) */
    pins_lamp(false);
    for (uint32_t i = 0; i < sizeof PINS / sizeof PINS[0]; i++) {
        const pin_t *p = &PINS[i];
        set_field(&p->port->AFR[p->pin / 8u], p->pin % 8u, 4, p->alternate);
        set_field(&p->port->PUPDR, p->pin, 2, p->pull);
        set_field(&p->port->OSPEEDR, p->pin, 2, 1); /* medium: 25 MHz is plenty */
        set_field(&p->port->MODER, p->pin, 2, p->mode);
    }
}

void pins_lamp(bool on) {
    GPIOC->BSRR = on ? 1u << (LAMP_PIN + 16u) : 1u << LAMP_PIN;
}
