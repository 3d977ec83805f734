/* events.c: the list of what happens next in virtual time.
 *
 * Each peripheral owns one slot or a few and puts the time of its next change there; there are
 * so few that the earliest is found by looking at all. Handlers run between blocks of
 * instructions, in order of time, and are told the time they were due at, so that what is
 * periodic does not drift by the length of a block.
 */
#include "system.h"

static void handle(machine_t *m, int event, tick_t at) {
    if (event >= EVENT_TIM && event < EVENT_TIM + TIMERS) {
        tim_event(m, event - EVENT_TIM, at);
    } else if (event >= EVENT_ADC && event < EVENT_ADC + 3) {
        adc_event(m, event - EVENT_ADC, at);
    } else if (event == EVENT_CAN) {
        can_bus_event(m, at);
    } else if (event == EVENT_TRIGGER) {
        tim_trigger_event(m, at);
    } else if (event == EVENT_SYSTICK) {
        systick_event(m, at);
    } else if (event == EVENT_RCC) {
        rcc_event(m, at);
    } else if (event == EVENT_FLASH) {
        flash_event(m, at);
    } else if (event == EVENT_IWDG) {
        iwdg_event(m, at);
    }
}

void events_run(machine_t *m) {
    while (m->next_event <= m->now) {
        tick_t at = m->next_event;
        int event = 0;
        while (m->event_at[event] != at) {
            event++;
        }
        m->event_at[event] = NEVER;
        handle(m, event, at);
        schedule_next(m);
    }
    schedule_next(m);
}
