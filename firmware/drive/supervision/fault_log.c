/* fault_log.c: see fault_log.h. */
#include "fault_log.h"

#include "table.h"

#define PLACES (sizeof((dictionary_t *)0)->fault_log / sizeof((dictionary_t *)0)->fault_log[0])

static void add(dictionary_t *dictionary, uint16_t code, uint32_t uptime_s) {
    for (uint32_t place = PLACES - 1u; place > 0; place--) {
        dictionary->fault_log[place] = dictionary->fault_log[place - 1u];
        dictionary->fault_log_uptime_s[place] = dictionary->fault_log_uptime_s[place - 1u];
    }
    dictionary->fault_log[0] = (uint32_t)dictionary->reset_cause << 16 | code;
    dictionary->fault_log_uptime_s[0] = uptime_s;
}

void fault_log_add(dictionary_t *dictionary, uint32_t checks, uint32_t uptime_s) {
    for (uint32_t i = 0; i < SUPERVISION_BITS; i++) {
        if ((checks >> i & 1u) != 0) {
            add(dictionary, SUPERVISION[i].code, uptime_s);
        }
    }
}
