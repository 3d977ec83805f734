/* table_write.h: judges a table that a host has written whole, and takes or refuses it.
 *
 * The transfer (canopen/sdo.h) leaves the bytes in its buffer; nothing of a table in the dictionary
 * changes before all of them are there and found fine. Refused by SDO abort 0609 0030h, with the
 * cause in table_refused. The CRC is the table's own: a segmented transfer has none, and two
 * masters' segments could mix.
 */
#ifndef BOWDEN_DRIVE_TABLE_WRITE_H
#define BOWDEN_DRIVE_TABLE_WRITE_H

#include <stdbool.h>

#include "../canopen/node.h"
#include "dictionary.h"

/* One tick. `entries_run`: the rest of the configuration can run. True when it has judged a table:
 * configuration_step() waits for the next, so that the tick is not too long. */
bool table_write_step(node_t *node, dictionary_t *dictionary, bool entries_run);

#endif
