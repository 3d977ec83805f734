/* supervision.c: see supervision.h. */
#include "supervision.h"

#include "../../board/board.h"

#define TICKS_PER_MS (1000u / BOARD_CONTROL_PERIOD_US)

/* A tick within its limit takes back half of what one beyond it has counted: a signal that is
 * beyond more than a third of the time is found, too. */
#define UP 2u
#define DOWN 1u

/* 2 pi times 4000 ticks a second times 1000 mrad in a rad. */
#define MRAD_PER_S_PER_TURN_A_TICK 25132741u

_Static_assert((int)SUPERVISION_OVERCURRENT == (int)BOARD_FAULT_OVERCURRENT &&
                   (int)SUPERVISION_ENCODER == (int)BOARD_FAULT_ENCODER &&
                   (int)SUPERVISION_LOAD_CELL == (int)BOARD_FAULT_LOAD_CELL &&
                   (int)SUPERVISION_CLOCK == (int)BOARD_FAULT_CLOCK &&
                   (int)SUPERVISION_BUS_OFF == (int)BOARD_FAULT_CAN_BUS_OFF &&
                   (int)SUPERVISION_TICK_OVERRUN == (int)BOARD_FAULT_TICK_OVERRUN &&
                   (int)SUPERVISION_RX_OVERRUN == (int)BOARD_FAULT_RX_OVERRUN &&
                   (int)SUPERVISION_CONVERTER == (int)BOARD_FAULT_CONVERTER &&
                   (int)SUPERVISION_RESTARTED == (int)BOARD_FAULT_RESTARTED &&
                   (int)SUPERVISION_CAN_PASSIVE == (int)BOARD_FAULT_CAN_PASSIVE &&
                   (int)SUPERVISION_CURRENT_MODEL == (int)BOARD_FAULT_CURRENT_MODEL &&
                   (int)SUPERVISION_CURRENT_ZERO == (int)BOARD_FAULT_CURRENT_ZERO &&
                   (int)SUPERVISION_IMAGE == (int)BOARD_FAULT_IMAGE,
               "the board's faults are bits of the table");

/* One count more for where within a count it was, one for the rounding. */
static int32_t counts_a_tick(uint32_t speed_mrad_per_s, uint32_t counts_per_turn) {
    const uint64_t counts =
        (uint64_t)speed_mrad_per_s * counts_per_turn / MRAD_PER_S_PER_TURN_A_TICK;
    return (int32_t)(counts + 2u);
}

void supervision_configure(supervision_t *supervision, const dictionary_t *dictionary,
                           const cable_settings_t *cable, int32_t board_ua) {
    supervision->settings = (supervision_settings_t){
        .deadline_ticks = dictionary->command_deadline_ms * TICKS_PER_MS,
        .bus_min_mv = (int32_t)dictionary->bus_voltage_min_mv,
        .bus_max_mv = (int32_t)dictionary->bus_voltage_max_mv,
        .motor_counts_a_tick = counts_a_tick(dictionary->motor_speed_limit_mrad_per_s,
                                             dictionary->motor_encoder_resolution_counts_per_turn),
        .load_counts_a_tick = counts_a_tick(dictionary->load_speed_limit_mrad_per_s,
                                            dictionary->load_encoder_resolution_counts_per_turn),
        .conduit_mdegc = (int32_t)dictionary->conduit_temperature_limit_mdegc,
        .angle_min_urad = dictionary->load_angle_min_urad,
        .angle_max_urad = dictionary->load_angle_max_urad,
    };
    ends_configure(&supervision->ends, cable, dictionary->motor_pulley_radius_nm,
                   (int32_t)dictionary->stretch_tolerance_nm);
    limits_configure(&supervision->limits, dictionary, board_ua);
    supervision->running = false; /* starts from where the ends are then */
}

static uint32_t when(bool holds, uint32_t check) {
    return holds ? check : 0u;
}

/* Is a counter, which may wrap, further than `most` from where it was? */
static bool jumped(int32_t now, int32_t before, int32_t most) {
    return (uint32_t)now - (uint32_t)before + (uint32_t)most > 2u * (uint32_t)most;
}

/* Motor and cables, while current may flow. */
static uint32_t look_at_motion(supervision_t *supervision, const supervision_inputs_t *inputs) {
    const supervision_settings_t *settings = &supervision->settings;
    if (!supervision->running) { /* the first tick of many */
        supervision->current_error = (current_error_t){0};
        ends_start(&supervision->ends, inputs->apart_nm);
        supervision->motor_counts = inputs->motor_counts;
        supervision->load_counts = inputs->load_counts;
    }
    const int32_t off_ua = current_error_step(&supervision->current_error, inputs->commanded_ua,
                                              inputs->motor_current_ua);
    const bool apart = ends_beyond(&supervision->ends, inputs->apart_nm, inputs->motor_torque_unm);
    const bool motor =
        jumped(inputs->motor_counts, supervision->motor_counts, settings->motor_counts_a_tick);
    const bool load =
        jumped(inputs->load_counts, supervision->load_counts, settings->load_counts_a_tick);
    supervision->motor_counts = inputs->motor_counts;
    supervision->load_counts = inputs->load_counts;
    return when(off_ua > SUPERVISION_CURRENT_ERROR_LIMIT_UA, SUPERVISION_CURRENT_ERROR) |
           when(apart, SUPERVISION_ENDS_APART) | when(motor, SUPERVISION_MOTOR_SPEED) |
           when(load, SUPERVISION_LOAD_SPEED);
}

/* What can be seen whether current flows or not. */
static uint32_t look_around(const supervision_t *supervision, const supervision_inputs_t *inputs) {
    const supervision_settings_t *settings = &supervision->settings;
    const bool late =
        settings->deadline_ticks != 0 && supervision->silent_ticks > settings->deadline_ticks;
    const bool outside = inputs->load_angle_urad < settings->angle_min_urad ||
                         inputs->load_angle_urad > settings->angle_max_urad;
    return inputs->board_faults |
           when(inputs->bus_voltage_mv < settings->bus_min_mv, SUPERVISION_UNDERVOLTAGE) |
           when(inputs->bus_voltage_mv > settings->bus_max_mv, SUPERVISION_OVERVOLTAGE) |
           when(inputs->conduit_mdegc > settings->conduit_mdegc, SUPERVISION_CONDUIT_HEAT) |
           when(heat_is_excessive(&supervision->limits.motor), SUPERVISION_MOTOR_HEAT) |
           when(heat_is_excessive(&supervision->limits.bridge), SUPERVISION_BRIDGE_HEAT) |
           when(outside, SUPERVISION_LOAD_ANGLE) |
           when(inputs->heartbeat_lost, SUPERVISION_HEARTBEAT) |
           when(inputs->host_restarted, SUPERVISION_HOST_RESTARTED) |
           when(late, SUPERVISION_COMMAND_LATE) |
           when(inputs->rpdo_late != 0, SUPERVISION_RPDO_LATE) |
           when(inputs->namesake, SUPERVISION_NODE_ID_TAKEN) |
           when(inputs->reference_lost, SUPERVISION_REFERENCE) |
           when(inputs->configuration_refused, SUPERVISION_CONFIGURATION);
}

/* Of what is beyond its limit now, what has been so for its time. */
static uint32_t lasting(supervision_t *supervision, uint32_t found) {
    uint32_t present = 0;
    uint32_t left = found | supervision->counting;
    for (uint32_t i = 0; left != 0 && i < SUPERVISION_BITS; i++) {
        const uint32_t check = UINT32_C(1) << i;
        if ((left & check) == 0) {
            continue;
        }
        left &= ~check;
        const uint16_t most = (uint16_t)(UP * SUPERVISION[i].ticks);
        uint16_t *beyond = &supervision->beyond[i];
        if ((found & check) == 0) {
            *beyond = (uint16_t)(*beyond - DOWN);
        } else if (*beyond < most) {
            *beyond = (uint16_t)(*beyond + UP < most ? *beyond + UP : most);
        }
        present |= when((found & check) != 0 && *beyond == most, check);
        supervision->counting = (supervision->counting & ~check) | when(*beyond != 0, check);
    }
    return present;
}

void supervision_step(supervision_t *supervision, const supervision_inputs_t *inputs) {
    if (inputs->host_commanded) {
        supervision->silent_ticks = 0;
    } else if (supervision->silent_ticks < UINT32_MAX) {
        supervision->silent_ticks++;
    }
    limits_step(&supervision->limits, inputs->motor_current_ua, inputs->conduit_mdegc);
    const uint32_t scope = SUPERVISION_ALWAYS | when(inputs->powered, SUPERVISION_POWERED) |
                           when(inputs->running, SUPERVISION_RUNNING) |
                           when(inputs->in_fault, supervision->latched);
    uint32_t found = look_around(supervision, inputs) & scope;
    if (inputs->running) {
        found |= look_at_motion(supervision, inputs);
    }
    supervision->running = inputs->running;
    supervision->present = (found | supervision->counting) != 0 ? lasting(supervision, found) : 0;
}

/* The detail of the EMCY frame: the value that was found. */
static uint32_t detail(uint32_t check, const supervision_t *supervision,
                       const supervision_inputs_t *inputs) {
    switch (check) {
    case SUPERVISION_CURRENT_ERROR:
        return (uint32_t)inputs->motor_current_ua;
    case SUPERVISION_ENDS_APART:
        return (uint32_t)inputs->apart_nm - (uint32_t)supervision->ends.zero_nm;
    case SUPERVISION_MOTOR_SPEED:
        return (uint32_t)inputs->motor_counts;
    case SUPERVISION_LOAD_SPEED:
        return (uint32_t)inputs->load_counts;
    case SUPERVISION_LOAD_ANGLE:
        return (uint32_t)inputs->load_angle_urad;
    case SUPERVISION_UNDERVOLTAGE:
    case SUPERVISION_OVERVOLTAGE:
        return (uint32_t)inputs->bus_voltage_mv;
    case SUPERVISION_CONDUIT_HEAT:
        return (uint32_t)inputs->conduit_mdegc;
    case SUPERVISION_COMMAND_LATE:
        return supervision->silent_ticks / TICKS_PER_MS;
    case SUPERVISION_RPDO_LATE:
        return inputs->rpdo_late;
    default:
        return inputs->board_faults;
    }
}

uint32_t supervision_latch(supervision_t *supervision, node_t *node,
                           const supervision_inputs_t *inputs) {
    const uint32_t fresh = supervision->present & ~supervision->latched;
    uint32_t left = fresh;
    supervision->latched |= fresh;
    for (uint32_t i = 0; left != 0 && i < SUPERVISION_BITS; i++) {
        const uint32_t check = UINT32_C(1) << i;
        if ((left & check) != 0) {
            const supervision_row_t *row = &SUPERVISION[i];
            node_error_set(node, row->code, row->register_bits, detail(check, supervision, inputs));
        }
        left &= ~check;
    }
    return fresh;
}

uint16_t supervision_code(uint32_t checks) {
    for (uint32_t i = 0; i < SUPERVISION_BITS; i++) {
        if ((checks >> i & 1u) != 0) {
            return SUPERVISION[i].code;
        }
    }
    return EMCY_NO_ERROR;
}

void supervision_reset(supervision_t *supervision, node_t *node, bool taken) {
    supervision->refused = taken ? 0 : supervision->present;
    if (!taken) {
        return;
    }
    supervision->latched = 0;
    for (uint32_t i = 0; i < SUPERVISION_BITS; i++) {
        node_error_clear(node, SUPERVISION[i].code);
    }
}

void supervision_tell_fallback(node_t *node, uint16_t causes, uint8_t level) {
    node_error_clear(node, EMCY_COMPENSATION_FALLBACK);
    if (causes != 0) {
        node_error_set(node, EMCY_COMPENSATION_FALLBACK, EMCY_COMPENSATION_FALLBACK_REGISTER,
                       (uint32_t)level << 16 | causes);
    }
}
