/* fast_loop.c: see fast_loop.h. */
#include "fast_loop.h"

#include <stddef.h>

#include "analog.h"
#include "current_loop.h"
#include "handlers.h"
#include "pwm.h"
#include "registers.h"
#include "watchdog.h"
#include "winding.h"

_Static_assert(CURRENT_LOOP_TOP == PWM_TOP, "the controller's output is the timer's input");

static fast_loop_report_t report;
static volatile bool at_work;
static int32_t last_load_cell;

static volatile int32_t commanded_ua;
static volatile bool commanded_on;

static current_loop_t controller;
static current_loop_gains_t gains;
static current_monitor_t monitor;
static current_monitor_motor_t motor;
static bool tripped;
static winding_t winding;
static volatile bool traces;

/* With the bridge off: samples until the current has died, then those of the mean. */
#define ZERO_SETTLES 20u
#define ZERO_SAMPLES 256u
static uint32_t zero_count;
static int32_t zero_sum;
static volatile int32_t zero_ua;

bool fast_loop_take(fast_loop_report_t *taken) {
    if (at_work) {
        return false;
    }
    *taken = report;
    report = (fast_loop_report_t){0};
    return true;
}

int32_t fast_loop_zero_ua(void) {
    return zero_ua;
}

/* Field by field, each at once: the loop may come in between. */
void fast_loop_motor(const current_monitor_motor_t *now) {
    motor.per_uv_q16 = now->per_uv_q16;
    motor.per_ua_q16 = now->per_ua_q16;
    motor.back_emf_uv = now->back_emf_uv;
    motor.uncertain_ua = now->uncertain_ua;
}

void fast_loop_tune(current_loop_gains_t of_winding) {
    gains = of_winding;
}

void fast_loop_trace_winding(bool wanted) {
    if (wanted && !traces) {
        winding.count = 0;
        winding.since = 0;
    }
    core_order();
    traces = wanted;
}

const int32_t *fast_loop_winding_ua(void) {
    return winding_is_done(&winding) ? winding.trace_ua : NULL;
}

void fast_loop_command(int32_t current_ua, bool bridge_on) {
    commanded_ua = current_ua;
    commanded_on = bridge_on;
    if (!bridge_on) {
        pwm_off();
    }
}

static void add_to_report(const analog_sample_t *sample) {
    scaling_window_t *window = &report.window;
    if (window->count < SCALING_WINDOW_MAX) {
        window->count++;
        window->current += sample->current;
        window->load_cell += sample->load_cell;
        window->bus_voltage += sample->bus_voltage;
        window->temperature += sample->temperature;
    }
    report.inputs_differ |= sample->current != sample->load_cell ||
                            sample->current != sample->bus_voltage ||
                            sample->current != sample->temperature;
    report.load_cell_at_rail |= sample->load_cell <= FAST_LOOP_RAIL_CODES ||
                                sample->load_cell >= 4095 - FAST_LOOP_RAIL_CODES;
    report.load_cell_moved |= sample->load_cell != last_load_cell;
    last_load_cell = sample->load_cell;
}

/* The bridge is off. */
static void measure_zero(int32_t code) {
    if (zero_count >= ZERO_SETTLES) {
        zero_sum += code - SCALING_CURRENT_ZERO_CODE;
    }
    zero_count++;
    if (zero_count == ZERO_SETTLES + ZERO_SAMPLES) {
        zero_ua = zero_sum * (SCALING_CURRENT_UA_PER_CODE / 32) / ((int32_t)ZERO_SAMPLES / 32);
        zero_sum = 0;
        zero_count = ZERO_SETTLES;
    }
}

static void control(int32_t current_ua, int32_t bus_mv) {
    if (!commanded_on) {
        tripped = false;
        controller = (current_loop_t){0};
        monitor = (current_monitor_t){0};
        pwm_off();
        pwm_set(0);
    } else if (tripped) {
        pwm_off();
    } else if (traces) {
        pwm_set(winding_step(&winding, current_ua));
        pwm_on();
    } else {
        const int32_t duty =
            current_loop_step(&controller, &gains, commanded_ua, current_ua, bus_mv);
        current_monitor_note(&monitor, duty, bus_mv);
        pwm_set(duty);
        pwm_on();
    }
}

void adc_handler(void) {
    const analog_sample_t sample = analog_take();
    const int32_t current_ua = scaling_current_ua(sample.current) - zero_ua;
    const int32_t bus_mv = scaling_bus_mv(sample.bus_voltage);
    const bool runs = commanded_on && !tripped && !traces;
    const bool strange = runs && current_monitor_step(&monitor, &motor, current_ua, bus_mv);
    const bool over =
        current_ua > FAST_LOOP_CURRENT_MAX_UA || current_ua < -FAST_LOOP_CURRENT_MAX_UA;
    at_work = true;
    core_order();
    add_to_report(&sample);
    if (pwm_take_break() || over) {
        tripped = true;
        report.overcurrent = true;
    }
    if (strange) {
        tripped = true;
        report.current_model = true;
    }
    core_order();
    at_work = false;
    if (commanded_on) {
        zero_count = 0;
        zero_sum = 0;
    } else {
        measure_zero(sample.current);
    }
    control(current_ua, bus_mv);
    watchdog_report(LOOP_CURRENT);
}
