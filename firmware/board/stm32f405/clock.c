/* clock.c: see clock.h. RM0090 7.2 and 7.3; wait states: table 10 (2.7 .. 3.6 V, 168 MHz: 5). */
#include "clock.h"

#include <stdint.h>

#include "registers.h"

/* Turns of a waiting loop of at least 4 cycles of the internal 16 MHz: 10 ms or a little more. The
 * crystal needs 2 ms (datasheet, typical), the PLL 0.3 ms (maximum). */
#define WAIT_TURNS 40000u

#define WAIT_STATES 5u

static bool wait_for(volatile const uint32_t *reg, uint32_t mask, uint32_t value) {
    for (uint32_t turn = 0; turn < WAIT_TURNS; turn++) {
        if ((*reg & mask) == value) {
            return true;
        }
    }
    return false;
}

clock_source_t clock_start(void) {
    RCC->APB1ENR |= RCC_APB1ENR_PWREN;
    core_barrier();        /* the clock needs two cycles to arrive (ES0182) */
    PWR->CR |= PWR_CR_VOS; /* scale 1, needed above 144 MHz */
    FLASH->ACR =
        FLASH_ACR_LATENCY(WAIT_STATES) | FLASH_ACR_PRFTEN | FLASH_ACR_ICEN | FLASH_ACR_DCEN;
    if (!wait_for(&FLASH->ACR, FLASH_ACR_LATENCY_MASK, FLASH_ACR_LATENCY(WAIT_STATES))) {
        return CLOCK_FAILED; /* 3.5.1: no faster clock before they are taken over */
    }
    RCC->CFGR = RCC_CFGR_PPRE1_DIV4 | RCC_CFGR_PPRE2_DIV2;
    RCC->CR |= RCC_CR_HSEON;
    const bool crystal = wait_for(&RCC->CR, RCC_CR_HSERDY, RCC_CR_HSERDY);
    if (!crystal) {
        RCC->CR &= ~RCC_CR_HSEON;
    }
    /* Input 1 MHz, VCO 336 MHz, system 168 MHz; Q as for 48 MHz. */
    const uint32_t input =
        crystal ? RCC_PLLCFGR_PLLM(8u) | RCC_PLLCFGR_PLLSRC_HSE : RCC_PLLCFGR_PLLM(16u);
    RCC->PLLCFGR = input | RCC_PLLCFGR_PLLN(336u) | RCC_PLLCFGR_PLLP_2 | RCC_PLLCFGR_PLLQ(7u);
    RCC->CR |= RCC_CR_PLLON;
    if (!wait_for(&RCC->CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY)) {
        return CLOCK_FAILED;
    }
    RCC->CFGR |= RCC_CFGR_SW_PLL;
    if (!wait_for(&RCC->CFGR, RCC_CFGR_SWS, RCC_CFGR_SWS_PLL)) {
        return CLOCK_FAILED;
    }
    if (crystal) {
        RCC->CR |= RCC_CR_CSSON;
    }
    return crystal ? CLOCK_CRYSTAL : CLOCK_INTERNAL;
}
