/* watchdog.c: see watchdog.h. RM0090 chapter 21. */
#include "watchdog.h"

#include <stdint.h>

#include "registers.h"

/* 160 periods of 4 / 32 kHz = 20 ms. */
#define RELOAD 160u

/* The registers are taken over within five periods of the slowest oscillator, 1.2 ms. */
#define WAIT_TURNS 40000u

/* Latest age of a report, in periods of 250 us, with the bridge off and on: 0.5, 10 or 2, 12 ms.
 * The main loop runs when the control tick does not. */
static const uint32_t LATEST[2][LOOPS] = {
    {[LOOP_CURRENT] = 2, [LOOP_CONTROL] = 40, [LOOP_MAIN] = 48},
    {[LOOP_CURRENT] = 2, [LOOP_CONTROL] = 8, [LOOP_MAIN] = 48},
};

static volatile bool reported[LOOPS];
static volatile uint32_t age[LOOPS];
static bool fed_since[LOOPS];
static bool late;

void watchdog_start(void) {
    IWDG->KR = IWDG_KR_START;
    IWDG->KR = IWDG_KR_ACCESS;
    IWDG->PR = IWDG_PR_DIV4;
    IWDG->RLR = RELOAD;
    for (uint32_t turn = 0; turn < WAIT_TURNS && IWDG->SR != 0; turn++) {
    }
    IWDG->KR = IWDG_KR_RELOAD;
}

void watchdog_report(loop_t loop) {
    reported[loop] = true;
}

bool watchdog_current_loop_dead(void) {
    return age[LOOP_CURRENT] > LATEST[0][LOOP_CURRENT];
}

/* Written each time: a debugger that connects sets the bit, too. */
static void follow_debugger(bool bridge_on) {
    const uint32_t others = DBGMCU->APB1_FZ & ~DBGMCU_APB1_FZ_IWDG_STOP;
    DBGMCU->APB1_FZ = others | (bridge_on ? 0u : DBGMCU_APB1_FZ_IWDG_STOP);
}

bool watchdog_check(bool bridge_on) {
    follow_debugger(bridge_on);
    const uint32_t *latest = LATEST[bridge_on ? 1 : 0];
    bool complete = true;
    for (uint32_t loop = 0; loop < LOOPS; loop++) {
        if (reported[loop]) {
            reported[loop] = false;
            fed_since[loop] = true;
            age[loop] = 0;
        } else if (age[loop] <= latest[loop]) {
            age[loop]++;
        }
        const bool overdue = age[loop] > latest[loop];
        late |= overdue && loop != LOOP_CURRENT;
        complete &= fed_since[loop] || (overdue && loop == LOOP_CURRENT);
    }
    if (complete && !late) {
        IWDG->KR = IWDG_KR_RELOAD;
        for (uint32_t loop = 0; loop < LOOPS; loop++) {
            fed_since[loop] = false;
        }
    }
    return !late;
}
