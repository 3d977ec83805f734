/* encoders.c: see encoders.h. RM0090 18.3.12 (encoder interface), 12.2 (EXTI), 9.2.3 (its ports).
 */
#include "encoders.h"

#include "handlers.h"
#include "registers.h"

#define MOTOR_INDEX (1u << 8) /* PC8 */
#define LOAD_INDEX (1u << 5)  /* PB5 */
#define PORT_B 1u
#define PORT_C 2u

/* Input filter 3: 8 samples at 84 MHz, 95 ns: shorter than any true pulse, longer than a spike. */
#define FILTER 3u

/* Written by the interrupt, which masks its line until the next control tick: a chattering index
 * costs one interrupt a tick. */
static volatile bool motor_indexed, load_indexed;
static volatile uint16_t motor_at_index, load_at_index;

static void start_timer(volatile tim_registers_t *timer) {
    timer->CCMR1 =
        TIM_CCMR1_CC1S_TI1 | TIM_CCMR1_IC1F(FILTER) | TIM_CCMR1_CC2S_TI2 | TIM_CCMR1_IC2F(FILTER);
    timer->SMCR = TIM_SMCR_SMS_ENCODER_3;
    timer->ARR = 0xFFFF;
    timer->CR1 = TIM_CR1_CEN;
}

void encoders_start(void) {
    RCC->APB1ENR |= RCC_APB1ENR_TIM3EN | RCC_APB1ENR_TIM4EN;
    RCC->APB2ENR |= RCC_APB2ENR_SYSCFGEN;
    core_barrier();
    start_timer(TIM3);
    start_timer(TIM4);
    SYSCFG->EXTICR[1] = PORT_B << 4; /* EXTI5 */
    SYSCFG->EXTICR[2] = PORT_C << 0; /* EXTI8 */
    EXTI->RTSR |= MOTOR_INDEX | LOAD_INDEX;
    EXTI->PR = MOTOR_INDEX | LOAD_INDEX;
    EXTI->IMR |= MOTOR_INDEX | LOAD_INDEX;
}

void exti9_5_handler(void) {
    const uint16_t motor = (uint16_t)TIM3->CNT;
    const uint16_t load = (uint16_t)TIM4->CNT;
    const uint32_t pending = EXTI->PR & EXTI->IMR & (MOTOR_INDEX | LOAD_INDEX);
    EXTI->IMR &= ~pending;
    EXTI->PR = pending;
    if ((pending & MOTOR_INDEX) != 0) {
        motor_at_index = motor;
        motor_indexed = true;
    }
    if ((pending & LOAD_INDEX) != 0) {
        load_at_index = load;
        load_indexed = true;
    }
}

encoders_latch_t encoders_latch(void) {
    return (encoders_latch_t){(uint16_t)TIM3->CNT, (uint16_t)TIM4->CNT};
}

bool encoders_step(encoders_t *encoders, const encoders_latch_t *latch,
                   uint32_t motor_counts_per_turn, uint32_t load_counts_per_turn) {
    const quadrature_input_t motor = {latch->motor, motor_indexed, motor_at_index};
    const quadrature_input_t load = {latch->load, load_indexed, load_at_index};
    if (motor.index) {
        motor_indexed = false;
    }
    if (load.index) {
        load_indexed = false;
    }
    /* Edges that came while a line was masked are dropped with it. */
    EXTI->PR = ~EXTI->IMR & (MOTOR_INDEX | LOAD_INDEX);
    EXTI->IMR |= MOTOR_INDEX | LOAD_INDEX;
    const bool motor_plausible = quadrature_step(&encoders->motor, &motor, motor_counts_per_turn);
    const bool load_plausible = quadrature_step(&encoders->load, &load, load_counts_per_turn);
    return motor_plausible && load_plausible;
}
