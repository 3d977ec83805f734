/* configuration.h: a changed configuration, from the dictionary to what the tick computes with.
 *
 * Checks, then the constants of the cables, then all that follows from them: about a hundred pieces
 * of work, some of them in each tick, so that no tick takes longer than it may (docs/safety.md).
 * Until the last of them the bridge cannot be enabled. Only the first tick after a reset does all
 * of it: the start is not over before that.
 *
 * A host writes many entries in a row: the cables are computed 50 ms after the last write, or as
 * soon as the host asks for the next state up. The checks follow each write at once.
 */
#ifndef BOWDEN_DRIVE_CONFIGURATION_H
#define BOWDEN_DRIVE_CONFIGURATION_H

#include <stdbool.h>
#include <stdint.h>

/* Value of the entry configuration_error while tables are checked, one in a tick. */
#define CONFIGURATION_UNDER_CHECK 1u

typedef enum {
    CONFIGURATION_STANDS,
    CONFIGURATION_IS_CHECKED,
    CONFIGURATION_SETTLES,
    CONFIGURATION_IS_BUILT, /* the constants of the cables */
    CONFIGURATION_IS_TAKEN, /* what follows from them */
} configuration_stage_t;

typedef struct {
    configuration_stage_t stage;
    bool entries_run;       /* all but the tables can; they are the bounds of tables */
    uint8_t next;           /* table to be checked, or part to be taken */
    uint32_t revision;      /* of the dictionary's configuration, as it was last seen */
    uint32_t taken;         /* of the one that runs */
    uint32_t settled_ticks; /* since the last write */
} configuration_t;

#endif
