/* supervision.c: see supervision.h. */
#include "supervision.h"

#include "dictionary.h"

typedef struct {
    uint32_t board_fault;
    uint16_t code;
    uint8_t register_bits;
} board_fault_t;

/* The most dangerous first: of several only the first is reported. */
static const board_fault_t BOARD_FAULTS[] = {
    {BOARD_FAULT_OVERCURRENT, EMCY_OVERCURRENT, EMCY_OVERCURRENT_REGISTER},
    {BOARD_FAULT_ENCODER, EMCY_ENCODER_FAULT, EMCY_ENCODER_FAULT_REGISTER},
    {BOARD_FAULT_LOAD_CELL, EMCY_LOAD_CELL_FAULT, EMCY_LOAD_CELL_FAULT_REGISTER},
    {BOARD_FAULT_CONVERTER, EMCY_CONVERTER_FAULT, EMCY_CONVERTER_FAULT_REGISTER},
    {BOARD_FAULT_CLOCK, EMCY_CLOCK_FAULT, EMCY_CLOCK_FAULT_REGISTER},
    {BOARD_FAULT_RESTARTED, EMCY_RESTARTED, EMCY_RESTARTED_REGISTER},
    {BOARD_FAULT_CAN_BUS_OFF, EMCY_BUS_OFF_RECOVERED, EMCY_BUS_OFF_RECOVERED_REGISTER},
    {BOARD_FAULT_CAN_PASSIVE, EMCY_CAN_PASSIVE, EMCY_CAN_PASSIVE_REGISTER},
    {BOARD_FAULT_TICK_OVERRUN, EMCY_TICK_OVERRUN, EMCY_TICK_OVERRUN_REGISTER},
    {BOARD_FAULT_RX_OVERRUN, EMCY_CAN_OVERRUN, EMCY_CAN_OVERRUN_REGISTER},
};

#define BOARD_FAULT_COUNT (sizeof BOARD_FAULTS / sizeof BOARD_FAULTS[0])

fault_t supervision_check(uint32_t faults, int32_t bus_voltage_mv, bool powered, bool host_lost) {
    for (uint32_t i = 0; i < BOARD_FAULT_COUNT; i++) {
        if ((faults & BOARD_FAULTS[i].board_fault) != 0) {
            return (fault_t){BOARD_FAULTS[i].code, BOARD_FAULTS[i].register_bits, faults};
        }
    }
    if (powered && bus_voltage_mv < SUPERVISION_BUS_VOLTAGE_MIN_MV) {
        return (fault_t){EMCY_UNDERVOLTAGE, EMCY_UNDERVOLTAGE_REGISTER, (uint32_t)bus_voltage_mv};
    }
    if (host_lost) {
        return (fault_t){EMCY_HEARTBEAT_LOST, EMCY_HEARTBEAT_LOST_REGISTER, 0};
    }
    return (fault_t){EMCY_NO_ERROR, 0, 0};
}

void supervision_clear(node_t *node) {
    for (uint32_t i = 0; i < BOARD_FAULT_COUNT; i++) {
        node_error_clear(node, BOARD_FAULTS[i].code);
    }
    node_error_clear(node, EMCY_UNDERVOLTAGE);
    node_error_clear(node, EMCY_HEARTBEAT_LOST);
    node_error_clear(node, EMCY_CONFIGURATION_REFUSED);
}

fault_t supervision_configuration_refused(uint32_t culprit) {
    return (fault_t){EMCY_CONFIGURATION_REFUSED, EMCY_CONFIGURATION_REFUSED_REGISTER, culprit};
}

void supervision_tell_fallback(node_t *node, uint16_t causes, uint8_t rung) {
    node_error_clear(node, EMCY_COMPENSATION_FALLBACK);
    if (causes != 0) {
        node_error_set(node, EMCY_COMPENSATION_FALLBACK, EMCY_COMPENSATION_FALLBACK_REGISTER,
                       (uint32_t)rung << 16 | causes);
    }
}
