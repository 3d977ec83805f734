/* startup.c: from reset to main(): vector table, initialised data, cleared memory.
 *
 * Every exception that is not ours ends in crash_handler(): an interrupt that is not enabled is
 * a fault like any other.
 */
#include <stdint.h>

#include "handlers.h"
#include "registers.h"

extern uint32_t _stack_top, _data_start, _data_end, _data_load, _bss_start, _bss_end;

#define INTERRUPTS 82 /* RM0090 table 62 */

typedef void (*handler_t)(void);

typedef struct {
    uint32_t *stack;
    handler_t core[15];
    handler_t interrupt[INTERRUPTS];
} vector_table_t;

/* The range initialiser and what follows it set some entries twice, on purpose. */
#pragma GCC diagnostic ignored "-Woverride-init"

__attribute__((section(".vectors"), used)) static const vector_table_t VECTORS = {
    .stack = &_stack_top,
    .core =
        {
            [0 ... 14] = crash_handler,
            [0] = reset_handler,
            [EXCEPTION_PENDSV - 1] = pendsv_handler,
            [EXCEPTION_SYSTICK - 1] = systick_handler,
        },
    .interrupt =
        {
            [0 ... INTERRUPTS - 1] = crash_handler,
            [IRQ_ADC] = adc_handler,
            [IRQ_CAN1_RX0] = can_rx0_handler,
            [IRQ_EXTI9_5] = exti9_5_handler,
        },
};

void reset_handler(void) {
    const uint32_t *from = &_data_load;
    for (uint32_t *to = &_data_start; to < &_data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = &_bss_start; to < &_bss_end; to++) {
        *to = 0;
    }
    SCB->VTOR = (uint32_t)(uintptr_t)&VECTORS;
    SCB->CCR |= SCB_CCR_DIV_0_TRP;
    core_barrier();
    main();
    crash_handler(); /* main() does not return */
}
