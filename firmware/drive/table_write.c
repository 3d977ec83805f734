/* table_write.c: see table_write.h. */
#include "table_write.h"

#include <stddef.h>

#include "../canopen/sdo_block.h"
#include "configuration.h"
#include "parameters.h"
#include "parameters_tables.h"

/* Where the CRC stands, over all bytes but its own two. */
#define CRC_AT 6u
#define CRC_SIZE 2u

#define TABLE_BYTES (4u * PARAMETERS_TABLE_WORDS)

_Static_assert(TABLE_BYTES <= SDO_BUFFER_SIZE, "a table fits into a transfer");

static bool crc_fits(const uint8_t *bytes) {
    const uint16_t head = sdo_block_crc(0, bytes, CRC_AT);
    const uint32_t rest = CRC_AT + CRC_SIZE;
    const uint16_t crc = sdo_block_crc(head, &bytes[rest], TABLE_BYTES - rest);
    return crc == (bytes[CRC_AT] | bytes[CRC_AT + 1u] << 8);
}

static table_defect_t judge(const dictionary_t *dictionary, bool entries_run,
                            const uint8_t *bytes) {
    if (!crc_fits(bytes)) {
        return TABLE_DEFECT_CHECKSUM;
    }
    uint32_t words[PARAMETERS_TABLE_WORDS];
    for (uint32_t i = 0; i < PARAMETERS_TABLE_WORDS; i++) {
        words[i] = od_word_of(&bytes[4u * i]);
    }
    const transmission_settings_t settings = parameters_transmission(dictionary);
    return parameters_table_defect(dictionary, entries_run ? &settings.cable : NULL, words);
}

bool table_write_step(node_t *node, dictionary_t *dictionary, bool entries_run) {
    uint16_t index;
    uint8_t sub;
    const uint8_t *bytes = node_offered(node, &index, &sub);
    if (bytes == NULL || index != PARAMETERS_TABLE_INDEX) {
        return false;
    }
    const table_defect_t defect = judge(dictionary, entries_run, bytes);
    const bool refused = defect != TABLE_DEFECT_NONE;
    dictionary->table_refused_table = refused ? sub : 0;
    dictionary->table_refused_defect = (uint8_t)defect;
    node_answer_offer(node, refused ? OD_ABORT_VALUE : OD_DONE);
    if (!refused) { /* with all others, from the next tick on */
        dictionary->configuration_error = CONFIGURATION_UNDER_CHECK;
    }
    return true;
}
