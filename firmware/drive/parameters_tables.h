/* parameters_tables.h: the tables (core/tables.h) from the object dictionary, and which of them
 * cannot run. Apart from parameters.h, which it belongs to, because tables are many entries.
 */
#ifndef BOWDEN_DRIVE_PARAMETERS_TABLES_H
#define BOWDEN_DRIVE_PARAMETERS_TABLES_H

#include "../core/cable_path.h"
#include "../core/tables.h"
#include "dictionary.h"

/* Table `number`, 0 .. TABLES - 1. */
table_settings_t parameters_table(const dictionary_t *dictionary, uint32_t number);

/* The first table that tables_check() refuses: its entry table_place as index << 8 | sub-index; 0:
 * none. Says why in *defect. `cable`: one that cable_check() found fine. */
uint32_t parameters_table_defect(const dictionary_t *dictionary, const cable_settings_t *cable,
                                 table_defect_t *defect);

#endif
