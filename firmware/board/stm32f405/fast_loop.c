/* fast_loop.c: see fast_loop.h. */
#include "fast_loop.h"

#include "analog.h"
#include "current_loop.h"
#include "handlers.h"
#include "pwm.h"
#include "registers.h"
#include "watchdog.h"

_Static_assert(CURRENT_LOOP_TOP == PWM_TOP, "the controller's output is the timer's input");

static fast_loop_report_t report;
static volatile bool at_work;
static int32_t last_load_cell;

static volatile int32_t commanded_ua;
static volatile bool commanded_on;

static current_loop_t controller;
static bool tripped;

bool fast_loop_take(fast_loop_report_t *taken) {
    if (at_work) {
        return false;
    }
    *taken = report;
    report = (fast_loop_report_t){0};
    return true;
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

static void control(int32_t current_ua, int32_t bus_mv) {
    if (!commanded_on) {
        tripped = false;
        controller = (current_loop_t){0};
        pwm_off();
        pwm_set(0);
    } else if (tripped) {
        pwm_off();
    } else {
        pwm_set(current_loop_step(&controller, commanded_ua, current_ua, bus_mv));
        pwm_on();
    }
}

void adc_handler(void) {
    const analog_sample_t sample = analog_take();
    const int32_t current_ua = scaling_current_ua(sample.current);
    const bool over =
        current_ua > FAST_LOOP_CURRENT_MAX_UA || current_ua < -FAST_LOOP_CURRENT_MAX_UA;
    at_work = true;
    core_order();
    add_to_report(&sample);
    if (pwm_take_break() || over) {
        tripped = true;
        report.overcurrent = true;
    }
    core_order();
    at_work = false;
    control(current_ua, scaling_bus_mv(sample.bus_voltage));
    watchdog_report(LOOP_CURRENT);
}
