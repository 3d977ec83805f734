/* control.c: see control.h.
 *
 * SysTick and TIM1 count the same 168 MHz: 42000 cycles are exactly five periods of the PWM, so
 * that each tick sees five samples, and the phase set at start stays.
 */
#include "control.h"

#include <stddef.h>

#include "can.h"
#include "clock.h"
#include "crash.h"
#include "encoders.h"
#include "erase.h"
#include "fast_loop.h"
#include "handlers.h"
#include "keep_reference.h"
#include "motor_speed.h"
#include "pwm.h"
#include "registers.h"
#include "store.h"
#include "watchdog.h"
#include "winding.h"

#define TICK_CYCLES (CLOCK_CORE_HZ / 1000000u * BOARD_CONTROL_PERIOD_US)

/* Frames passed to the drive in one tick; the rest wait. At 1 Mbit/s six can come. */
#define FRAMES_PER_TICK 8

/* A live load cell amplifier is never quiet: half a code of noise. The same code for 250 ms, 5000
 * samples, is a stuck converter or a cut wire. */
#define LOAD_CELL_QUIET_TICKS (250000u / BOARD_CONTROL_PERIOD_US)

/* Latched by SysTick for the tick. */
static struct {
    uint32_t time_us;
    encoders_latch_t encoders;
    fast_loop_report_t fast;
} latched;
static uint32_t ticks;
static volatile bool running, overrun;

static drive_t drive;
static board_sensors_t sensors; /* analogue values stay while the converter is dead */
static board_actuators_t actuators;
static encoders_t encoders;
static uint32_t always, once; /* BOARD_FAULT_* */
static uint32_t load_cell_quiet;
static motor_speed_t motor_speed;
static current_monitor_motor_t motor;
static uint32_t motor_revision = UINT32_MAX; /* of the configuration that *motor is of */
static store_t store;
static bool room_wanted; /* a sector is to be erased for the next save */
static uint32_t saved[BOARD_STORE_WORDS], saved_words;
static volatile drive_state_t state;

void control_recall(void) {
    saved_words = store_open(&store, saved);
}

void control_start(const board_identity_t *identity, uint32_t standing_faults,
                   uint32_t first_faults) {
    board_identity_t known = *identity;
    known.saved = saved;
    known.saved_words = saved_words;
    known.saved_state = store.damaged ? BOARD_SAVED_DAMAGED : BOARD_SAVED_FINE;
    always = standing_faults;
    once = first_faults;
    drive_init(&drive, &known);
}

uint8_t control_node_id(void) {
    return drive.node.od.node_id;
}

uint16_t control_bit_rate_kbit(void) {
    return drive.dictionary.bit_rate;
}

void control_run(void) {
    SYSTICK->LOAD = TICK_CYCLES - 1u;
    SYSTICK->VAL = 0;
    SYSTICK->CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_CLKSOURCE;
}

drive_state_t control_state(void) {
    return state;
}

/* While a tick still runs its inputs stay, and the samples go into the next. */
void systick_handler(void) {
    const bool alive = watchdog_check(pwm_is_on());
    if (!alive) {
        pwm_lock();
    }
    ticks++;
    crash_note_tick(ticks);
    const encoders_latch_t now = encoders_latch();
    if (running) {
        overrun = true;
        watch_reference(now, !alive);
        return;
    }
    if (ticks > 1) { /* there is a tick to keep of */
        keep_reference(actuators.reference, latched.encoders);
        watch_reference(now, !alive);
    }
    running = true;
    latched.time_us = ticks * BOARD_CONTROL_PERIOD_US;
    latched.encoders = now;
    if (!fast_loop_take(&latched.fast)) {
        latched.fast = (fast_loop_report_t){0};
    }
    SCB->ICSR = SCB_ICSR_PENDSVSET;
}

static uint32_t load_cell_faults(void) {
    if (latched.fast.load_cell_moved) {
        load_cell_quiet = 0;
    } else if (load_cell_quiet < LOAD_CELL_QUIET_TICKS) {
        load_cell_quiet++;
    }
    return latched.fast.load_cell_at_rail || load_cell_quiet == LOAD_CELL_QUIET_TICKS
               ? (uint32_t)BOARD_FAULT_LOAD_CELL
               : 0u;
}

static uint32_t take_overrun(void) {
    const bool seen = overrun;
    if (seen) {
        overrun = false;
    }
    return seen ? (uint32_t)BOARD_FAULT_TICK_OVERRUN : 0u;
}

static uint32_t find_faults(void) {
    uint32_t faults = always | once | load_cell_faults() | take_overrun();
    once = 0;
    if (latched.fast.overcurrent) {
        faults |= BOARD_FAULT_OVERCURRENT;
    }
    if (latched.fast.current_model) {
        faults |= BOARD_FAULT_CURRENT_MODEL;
    }
    const int32_t zero_ua = fast_loop_zero_ua();
    if (zero_ua > SUPERVISION_CURRENT_ZERO_LIMIT_UA ||
        zero_ua < -SUPERVISION_CURRENT_ZERO_LIMIT_UA) {
        faults |= BOARD_FAULT_CURRENT_ZERO;
    }
    /* Four inputs with one code all the time: it is the converter that is stuck. */
    const bool stuck = latched.fast.window.count > 0 && !latched.fast.inputs_differ;
    if (stuck || watchdog_current_loop_dead()) {
        faults |= BOARD_FAULT_CONVERTER;
    }
    /* A node that is alone on the bus is error-passive, too; it matters while current flows. */
    const uint32_t ignored = actuators.bridge_enabled ? 0u : (uint32_t)BOARD_FAULT_CAN_PASSIVE;
    const uint32_t bus = can_tick();
    sensors.bus = can_bus((bus & BOARD_FAULT_CAN_BUS_OFF) != 0);
    return faults | (bus & ~ignored);
}

static void read_sensors(void) {
    scaling_result_t analogue;
    sensors.time_us = latched.time_us;
    sensors.faults = find_faults();
    if (!encoders_step(&encoders, &latched.encoders,
                       drive.dictionary.motor_encoder_resolution_counts_per_turn,
                       drive.dictionary.load_encoder_resolution_counts_per_turn)) {
        sensors.faults |= BOARD_FAULT_ENCODER;
    }
    sensors.motor_encoder_counts = encoders.motor.counts;
    sensors.load_encoder_counts = encoders.load.counts;
    sensors.motor_index = (board_index_t){encoders.motor.passed, encoders.motor.at_index};
    sensors.load_index = (board_index_t){encoders.load.passed, encoders.load.at_index};
    if (scaling_window(&latched.fast.window, &analogue)) {
        sensors.motor_current_ua = analogue.motor_current_ua - fast_loop_zero_ua();
        sensors.load_cell_counts = analogue.load_cell_counts;
        sensors.bus_voltage_mv = analogue.bus_voltage_mv;
        sensors.conduit_temperature_mdegc = analogue.conduit_temperature_mdegc;
    }
    sensors.winding = (board_winding_t){
        .trace_ua = fast_loop_winding_ua(),
        .voltage_uv = sensors.bus_voltage_mv * (1000 * WINDING_DUTY / PWM_TOP),
    };
}

/* Gives the 20 kHz loop the motor's data. */
static void describe_motor(void) {
    const dictionary_t *dictionary = &drive.dictionary;
    if (motor_revision != drive.configuration.taken) {
        motor_revision = drive.configuration.taken;
        motor = current_monitor_motor(dictionary->motor_resistance_uohm,
                                      dictionary->motor_inductance_nh);
        fast_loop_tune(
            current_loop_gains(dictionary->motor_resistance_uohm, dictionary->motor_inductance_nh));
    }
    motor_speed_step(&motor_speed, sensors.motor_encoder_counts,
                     dictionary->torque_constant_unm_per_a,
                     dictionary->motor_encoder_resolution_counts_per_turn, &motor);
    fast_loop_motor(&motor);
}

static void receive_frames(void) {
    can_frame_t frame;
    for (uint32_t i = 0; i < FRAMES_PER_TICK && can_take(&frame); i++) {
        drive_receive(&drive, &frame);
    }
    uint16_t cob_ids[CAN_RPDOS] = {0};
    for (uint32_t i = 0; i < CAN_RPDOS && i < PDO_RX_MAX; i++) {
        const pdo_map_t *map = &drive.node.pdo.rpdo[i].map;
        cob_ids[i] = map->exists ? map->cob_id : 0;
    }
    can_listen(cob_ids);
}

static void send_frames(void) {
    can_frame_t frame;
    while (can_ready() && drive_transmit(&drive, &frame)) {
        can_send(&frame);
    }
}

/* No slot is blank: erases those of older images once the answer that says so has left. Frames
 * received meanwhile are lost; the host was asked to send none. */
static void make_room(void) {
    const can_frame_t heartbeat = node_heartbeat(&drive.node);
    if (!can_is_idle()) {
        return;
    }
    room_wanted = false;
    const uint32_t periods = erase_sector(store_sector_to_erase(&store), &heartbeat);
    ticks += periods > 0 ? periods - 1u : 0u; /* SysTick itself comes for the last */
    overrun = false;
    store_erased(&store);
    can_forget_overrun();
}

static void ask_for_room(void) {
    sensors.store = BOARD_STORE_FULL;
    room_wanted = true;
}

static void step_store(void) {
    const store_progress_t progress = store_step(&store);
    if (progress == STORE_DONE) {
        sensors.store = BOARD_STORE_DONE;
    } else if (progress == STORE_FAILED && store_is_full(&store)) {
        ask_for_room(); /* its last slots looked blank and were not */
    } else if (progress == STORE_FAILED) {
        sensors.store = BOARD_STORE_FAILED;
    }
}

/* Keeps what the drive gives, a word a tick. Each holds up the core for 16 us, so the bridge is
 * off.
 */
static void keep(void) {
    room_wanted = room_wanted && !actuators.bridge_enabled;
    if (actuators.store == NULL) {
        sensors.store = BOARD_STORE_IDLE;
        if (room_wanted) {
            make_room();
        }
    } else if (sensors.store == BOARD_STORE_IDLE && store_is_full(&store)) {
        ask_for_room();
    } else if (sensors.store == BOARD_STORE_IDLE) {
        sensors.store =
            store_begin(&store, actuators.store, actuators.store_words, actuators.store_is_log)
                ? BOARD_STORE_BUSY
                : BOARD_STORE_FAILED;
    } else if (sensors.store == BOARD_STORE_BUSY && !actuators.bridge_enabled) {
        step_store();
    }
}

void pendsv_handler(void) {
    read_sensors();
    receive_frames();
    drive_tick(&drive, &sensors, &actuators);
    describe_motor();
    fast_loop_trace_winding(actuators.winding_test);
    fast_loop_command(actuators.motor_current_ua, actuators.bridge_enabled);
    if (actuators.reset_requested) {
        crash_restart();
    }
    send_frames();
    keep();
    state = drive.state;
    watchdog_report(LOOP_CONTROL);
    running = false;
}
