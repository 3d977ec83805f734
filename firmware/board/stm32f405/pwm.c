/* pwm.c: see pwm.h. RM0090 chapter 17. */
#include "pwm.h"

#include "registers.h"

/* Dead time 84 / 168 MHz = 0.5 us: longer than the bridge's switches need to turn off. */
#define DEAD_TIME 84u

/* BDTR with the bridge off. Off-state: outputs are driven to their idle level, low (OSSI, OIS = 0).
 * Break active low, no automatic restart; dead time and break are locked until reset (LOCK 1).
 * Written whole, never read and changed: pwm_off() may interrupt anything. */
#define BDTR_OFF                                                                                   \
    (TIM_BDTR_DTG(DEAD_TIME) | TIM_BDTR_LOCK_1 | TIM_BDTR_OSSI | TIM_BDTR_OSSR | TIM_BDTR_BKE)

static volatile bool locked;

void pwm_start(void) {
    DBGMCU->APB2_FZ |= DBGMCU_APB2_FZ_TIM1_STOP;
    RCC->APB2ENR |= RCC_APB2ENR_TIM1EN;
    core_barrier();
    TIM1->CR1 = TIM_CR1_CMS_1 | TIM_CR1_ARPE;
    TIM1->CR2 = TIM_CR2_MMS_UPDATE;
    TIM1->CCMR1 = TIM_CCMR1_OC1M_PWM1 | TIM_CCMR1_OC1PE | TIM_CCMR1_OC2M_PWM1 | TIM_CCMR1_OC2PE;
    TIM1->ARR = PWM_TOP;
    /* An update each second turn of the counter, once a period. UG below loads the repetition
     * counter, so the first overflow only counts it down: all updates are underflows, at the middle
     * of the time in which the high sides conduct (17.3.3). */
    TIM1->RCR = 1;
    pwm_set(0);
    TIM1->BDTR = BDTR_OFF;
    TIM1->CCER = TIM_CCER_CC1E | TIM_CCER_CC1NE | TIM_CCER_CC2E | TIM_CCER_CC2NE;
    TIM1->EGR = TIM_EGR_UG;
    TIM1->SR = 0;
    TIM1->CR1 |= TIM_CR1_CEN;
}

void pwm_set(int32_t duty) {
    const int32_t half = duty / 2;
    TIM1->CCR1 = (uint32_t)(PWM_TOP / 2 + half);
    TIM1->CCR2 = (uint32_t)(PWM_TOP / 2 - (duty - half));
}

/* SysTick may lock the bridge between the test and the write. */
void pwm_on(void) {
    core_mask();
    if (!locked) {
        TIM1->BDTR = BDTR_OFF | TIM_BDTR_MOE;
    }
    core_unmask();
}

void pwm_off(void) {
    TIM1->BDTR = BDTR_OFF;
}

void pwm_lock(void) {
    locked = true;
    pwm_off();
}

bool pwm_is_on(void) {
    return (TIM1->BDTR & TIM_BDTR_MOE) != 0;
}

bool pwm_take_break(void) {
    const bool seen = (TIM1->SR & TIM_SR_BIF) != 0;
    if (seen) {
        TIM1->SR = ~TIM_SR_BIF;
    }
    return seen;
}
