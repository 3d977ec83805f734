/* supervision.h: what must not go on. It looks at one tick and names the first thing that is
 * wrong; the state machine takes it from there. No state of its own.
 */
#ifndef BOWDEN_DRIVE_SUPERVISION_H
#define BOWDEN_DRIVE_SUPERVISION_H

#include <stdbool.h>
#include <stdint.h>

#include "../board/board.h"
#include "../canopen/node.h"

/* Below it the bridge's drivers are not sure to switch. Asked for only while current may flow or is
 * about to: a drive without motor supply is no fault. */
#define SUPERVISION_BUS_VOLTAGE_MIN_MV 10000

/* A fault as it goes into an EMCY frame; code 0 is none. */
typedef struct {
    uint16_t code;
    uint8_t register_bits;
    uint32_t detail;
} fault_t;

/* What is wrong now. `faults`: BOARD_FAULT_* bits; `powered`: switched on or further; `host_lost`:
 * while current may flow. */
fault_t supervision_check(uint32_t faults, int32_t bus_voltage_mv, bool powered, bool host_lost);

/* Tells the node that every fault which supervision_check() can name, and a refused configuration,
 * is gone. */
void supervision_clear(node_t *node);

/* Warns of a lesser compensation, which is no fault: the drive goes on. Detail: the causes (entry
 * compensation_fallback) in the low word, the rung in the high word. No causes: it is over. */
void supervision_tell_fallback(node_t *node, uint16_t causes, uint8_t rung);

/* The fault "configuration cannot run"; detail names the entry. */
fault_t supervision_configuration_refused(uint32_t culprit);

#endif
