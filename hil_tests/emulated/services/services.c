/* services.c: what any part of the machine may ask for: a note, a later event, a reset.
 *
 * Each peripheral owns one slot of events or a few and puts the time of its next change there;
 * there are so few that the earliest is found by looking at all.
 */
#include "services.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static void add_note(machine_t *m, bool is_unmodelled, const char *format, va_list arguments) {
    char text[sizeof m->notes[0].text];
    vsnprintf(text, sizeof text, format, arguments);
    for (int i = 0; i < m->note_count; i++) {
        if (strcmp(m->notes[i].text, text) == 0) {
            return;
        }
    }
    if (m->note_count < (int)(sizeof m->notes / sizeof m->notes[0])) {
        memcpy(m->notes[m->note_count].text, text, sizeof text);
        m->notes[m->note_count++].is_unmodelled = is_unmodelled;
    }
}

void note(machine_t *m, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    add_note(m, false, format, arguments);
    va_end(arguments);
}

void unmodelled(machine_t *m, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    add_note(m, true, format, arguments);
    va_end(arguments);
}

void schedule_next(machine_t *m) {
    m->next_event = NEVER;
    for (int i = 0; i < EVENT_COUNT; i++) {
        if (m->event_at[i] < m->next_event) {
            m->next_event = m->event_at[i];
        }
    }
    m->wake_at = m->next_event < m->until ? m->next_event : m->until;
}

void schedule(machine_t *m, int event, tick_t at) {
    m->event_at[event] = at;
    schedule_next(m);
}

void request_reset(machine_t *m, uint32_t cause) {
    m->reset_cause |= cause;
    m->attention |= ATTENTION_STOP;
}

uint64_t ticks_to_ns(tick_t ticks) {
    return ticks / TICKS_PER_US * 1000 + ticks % TICKS_PER_US * 1000 / TICKS_PER_US;
}
