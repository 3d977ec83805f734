/* iwdg.c: the independent watchdog (RM0090 chapter 21).
 *
 * Counts the LSI oscillator in virtual time, in WFI as well and when the core stands still. The
 * real LSI may run at 17..47 kHz; the option lsi_hz tries the ends.
 */
#include "chip.h"

enum { KEY_RELOAD = 0xAAAA, KEY_ACCESS = 0x5555, KEY_START = 0xCCCC };

static void reload(machine_t *m) {
    iwdg_t *w = &m->iwdg;
    if (w->running) {
        uint64_t divider = 4ull << (w->pr > 6 ? 6 : w->pr);
        tick_t period = TICKS_PER_SECOND / m->options.lsi_hz * divider * (w->rlr + 1);
        schedule(m, EVENT_IWDG, m->now + period);
    }
}

void iwdg_event(machine_t *m, tick_t at) {
    (void)at;
    request_reset(m, RESET_IWDG);
}

uint32_t iwdg_read(machine_t *m, uint32_t offset) {
    switch (offset) {
    case 0x04:
        return m->iwdg.pr;
    case 0x08:
        return m->iwdg.rlr;
    case 0x0C:
        return m->now < m->iwdg.update_done ? 3u : 0u; /* PVU, RVU */
    default:
        return 0;
    }
}

void iwdg_write(machine_t *m, uint32_t offset, uint32_t value) {
    iwdg_t *w = &m->iwdg;
    if (offset == 0x00) {
        w->unlocked = (value & 0xFFFFu) == KEY_ACCESS;
        if ((value & 0xFFFFu) == KEY_START && !w->running) {
            rcc_start_lsi(m);
            w->running = true;
            reload(m);
        } else if ((value & 0xFFFFu) == KEY_RELOAD) {
            reload(m);
        }
    } else if (!w->unlocked) {
        note(m, "IWDG: written without the key 5555h");
    } else if (offset == 0x04) {
        w->pr = value & 7u;
        w->update_done = m->now + 5 * (TICKS_PER_SECOND / m->options.lsi_hz);
    } else if (offset == 0x08) {
        w->rlr = value & 0xFFFu;
        w->update_done = m->now + 5 * (TICKS_PER_SECOND / m->options.lsi_hz);
    }
}

void iwdg_freeze(machine_t *m, bool frozen) {
    iwdg_t *w = &m->iwdg;
    tick_t at = m->event_at[EVENT_IWDG];
    if (frozen && at != NEVER) {
        w->left = at - m->now;
        schedule(m, EVENT_IWDG, NEVER);
    } else if (!frozen && w->left != 0) {
        schedule(m, EVENT_IWDG, m->now + w->left);
        w->left = 0;
    }
}

void iwdg_reset(machine_t *m) {
    m->iwdg = (iwdg_t){.rlr = 0xFFF};
    schedule(m, EVENT_IWDG, NEVER);
}
