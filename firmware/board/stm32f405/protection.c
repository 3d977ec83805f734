/* protection.c: see protection.h. PM0214 4.2 (MPU), RM0090 5.2.3 (programmable voltage detector).
 */
#include "protection.h"

#include <stdint.h>

#include "registers.h"

extern uint32_t _stack_guard, _sram_code;

#define NORMAL (MPU_RASR_CACHEABLE | MPU_RASR_SHAREABLE)
#define DEVICE (MPU_RASR_BUFFERABLE | MPU_RASR_SHAREABLE)

static void region(uint32_t number, uint32_t base, uint32_t attributes) {
    MPU->RNR = number;
    MPU->RBAR = base;
    MPU->RASR = attributes | MPU_RASR_ENABLE;
}

/* Higher numbers win. Without a default map (PRIVDEFENA = 0) what is not here is forbidden. In
 * HardFault and NMI the unit is off (HFNMIENA = 0), so that crash.c can read everything. */
void protection_start_memory(void) {
    region(0, 0x08000000u, MPU_RASR_SIZE(20u) | MPU_RASR_READ_ONLY | MPU_RASR_CACHEABLE);
    region(1, 0x1FFF0000u,
           MPU_RASR_SIZE(16u) | MPU_RASR_READ_ONLY | MPU_RASR_XN |
               MPU_RASR_CACHEABLE); /* unique id, option bytes */
    region(2, 0x20000000u, MPU_RASR_SIZE(17u) | MPU_RASR_READ_WRITE | MPU_RASR_XN | NORMAL);
    region(3, 0x40000000u, MPU_RASR_SIZE(29u) | MPU_RASR_READ_WRITE | MPU_RASR_XN | DEVICE);
    region(4, (uint32_t)(uintptr_t)&_stack_guard,
           MPU_RASR_SIZE(8u) | MPU_RASR_NO_ACCESS | MPU_RASR_XN | NORMAL);
    MPU->CTRL = MPU_CTRL_ENABLE;
    core_barrier();
}

void protection_open_storage(bool open) {
    if (open) {
        region(5, 0x080C0000u, MPU_RASR_SIZE(18u) | MPU_RASR_READ_WRITE | MPU_RASR_XN | NORMAL);
    } else {
        MPU->RNR = 5;
        MPU->RASR = 0;
    }
    core_barrier();
}

void protection_open_sram_code(bool open) {
    if (open) {
        region(6, (uint32_t)(uintptr_t)&_sram_code,
               MPU_RASR_SIZE(10u) | MPU_RASR_READ_ONLY | NORMAL);
    } else {
        MPU->RNR = 6;
        MPU->RASR = 0;
    }
    core_barrier();
}

void protection_start_supply(void) {
    PWR->CR |= PWR_CR_PLS_2V9 | PWR_CR_PVDE;
    while ((PWR->CSR & PWR_CSR_PVDO) != 0) { /* nothing has been switched on yet */
    }
    EXTI->RTSR |= EXTI_PVD; /* rising edge of PVDO: the supply falls */
    EXTI->PR = EXTI_PVD;
    EXTI->IMR |= EXTI_PVD;
    NVIC_IPR[IRQ_PVD] = 0;
    NVIC_ISER[IRQ_PVD / 32u] = 1u << (IRQ_PVD % 32u); /* its handler is crash_handler() */
}
