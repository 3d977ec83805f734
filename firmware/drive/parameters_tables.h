/* parameters_tables.h: the tables (core/tables.h) from their words in the object dictionary, and
 * which of them cannot run. Apart from parameters.h, which it belongs to, because a table has a
 * layout of its own: that of the entry `table`.
 */
#ifndef BOWDEN_DRIVE_PARAMETERS_TABLES_H
#define BOWDEN_DRIVE_PARAMETERS_TABLES_H

#include "../core/cable_path.h"
#include "../core/tables.h"
#include "dictionary.h"

#define PARAMETERS_TABLE_INDEX 0x2162u
#define PARAMETERS_TABLE_WORDS 37u

/* The table in these words, which parameters_table_words_defect() has found fine. */
table_settings_t parameters_table(const uint32_t words[PARAMETERS_TABLE_WORDS]);

/* What is wrong with the words themselves; that their CRC fits was checked when they came. */
table_defect_t parameters_table_words_defect(const uint32_t words[PARAMETERS_TABLE_WORDS]);

/* What is wrong with one table under the dictionary's configuration. `cable`: one that
 * cable_check() found fine, or NULL: bounds that follow from the cables are not checked. */
table_defect_t parameters_table_defect(const dictionary_t *dictionary,
                                       const cable_settings_t *cable,
                                       const uint32_t words[PARAMETERS_TABLE_WORDS]);

#endif
