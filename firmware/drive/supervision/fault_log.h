/* fault_log.h: the last faults of the drive, newest first: what, in which start, how long after it.
 *
 * Lives in the dictionary's entries fault_log and fault_log_uptime, which are kept across power-off
 * (../saving.h).
 */
#ifndef BOWDEN_DRIVE_SUPERVISION_FAULT_LOG_H
#define BOWDEN_DRIVE_SUPERVISION_FAULT_LOG_H

#include <stdint.h>

#include "../dictionary.h"

/* Adds some checks that have failed in one tick, SUPERVISION_* bits; the oldest faults fall out. */
void fault_log_add(dictionary_t *dictionary, uint32_t checks, uint32_t uptime_s);

#endif
