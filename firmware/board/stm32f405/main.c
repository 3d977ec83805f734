/* main.c: the STM32F405 board: order of the start, interrupt priorities, and the idle loop.
 *
 *   priority  interrupt         work
 *   0         SysTick    4 kHz  checks that all loops live, latches sensors, asks for the tick
 *   1         ADC       20 kHz  samples, overcurrent, current loop        (fast_loop.c)
 *   2         CAN1_RX0          received frame into the ring               (can.c)
 *   3         EXTI9_5           index pulses                               (encoders.c)
 *   15        PendSV     4 kHz  the control tick with all of the drive     (control.c)
 *   -         main              sleeps; lamp
 */
#include "analog.h"
#include "can.h"
#include "clock.h"
#include "control.h"
#include "crash.h"
#include "current_loop.h"
#include "encoders.h"
#include "handlers.h"
#include "image.h"
#include "keep_reference.h"
#include "pins.h"
#include "protection.h"
#include "pwm.h"
#include "registers.h"
#include "reset.h"
#include "watchdog.h"

#define NODE_ID 16

/* Priorities are the high four bits. */
static void set_priorities(void) {
    SCB->SHPR[EXCEPTION_SYSTICK - 4u] = 0 << 4;
    NVIC_IPR[IRQ_ADC] = 1 << 4;
    NVIC_IPR[IRQ_CAN1_RX0] = 2 << 4;
    NVIC_IPR[IRQ_EXTI9_5] = 3 << 4;
    SCB->SHPR[EXCEPTION_PENDSV - 4u] = 15 << 4;
    NVIC_ISER[0] = 1u << IRQ_ADC | 1u << IRQ_CAN1_RX0 | 1u << IRQ_EXTI9_5;
}

/* The id's three words differ in wafer, lot and position: all of them count. */
static uint32_t serial_number(void) {
    return UNIQUE_ID[0] ^ UNIQUE_ID[1] ^ UNIQUE_ID[2];
}

/* Wake-ups between two updates of the lamp, about 2 ms: faster changes are not visible. */
#define LAMP_WAKE_UPS 64u

/* Steady: the bridge is on. Slow blinking: ready. Fast: fault. */
static bool lamp(uint32_t wake_ups) {
    const drive_state_t state = control_state();
    if (state_bridge_on(state)) {
        return true;
    }
    /* The 20 kHz loop wakes the core, so 2^14 wake-ups are about a second. */
    return (wake_ups >> (state == STATE_FAULT ? 11 : 14) & 1u) != 0;
}

int main(void) {
    protection_start_memory();
    const reset_cause_t reset = reset_cause();
    const bool ended_badly = crash_is_news() || reset == RESET_CAUSE_WATCHDOG;
    const clock_source_t source = clock_start();
    if (source == CLOCK_FAILED) {
        crash_restart();
    }
    protection_start_supply();
    watchdog_start();
    uint32_t standing_faults = source == CLOCK_INTERNAL ? (uint32_t)BOARD_FAULT_CLOCK : 0u;
    if (!image_is_whole()) { /* its effect on the bridge is undefined */
        pwm_lock();
        standing_faults |= BOARD_FAULT_IMAGE;
    }
    control_recall();
    pins_start();
    encoders_start();
    analog_start(); /* needs 3 us to wake; the drive's start takes longer */
    const board_identity_t identity = {
        .node_id = NODE_ID,
        .serial_number = serial_number(),
        .current_max_ua = CURRENT_LOOP_REFERENCE_MAX_UA,
        .reset = reset,
        .crash = crash_report(),
        .reference = kept_reference(reset),
    };
    control_start(&identity, standing_faults, ended_badly ? (uint32_t)BOARD_FAULT_RESTARTED : 0u);
    can_start(control_node_id(), control_bit_rate_kbit());
    set_priorities();
    pwm_start();
    control_run();
    for (uint32_t wake_ups = 0;; wake_ups++) {
        core_sleep();
        if (wake_ups % LAMP_WAKE_UPS == 0) {
            pins_lamp(lamp(wake_ups));
        }
        watchdog_report(LOOP_MAIN);
    }
}
