/* bridge.c: the H-bridge and the motor winding: mean voltage of the switching period, R, L and
 * back-EMF, integrated exactly between changes. Parameters: hil_tests/emulated/bridge.py.
 *
 * Left out: the ripple within a period, of which a centre-aligned bridge sampled at the centre
 * shows the mean anyway. With all switches open the current returns through the diodes into the
 * supply and stops at zero.
 */
#include "board.h"

#include <math.h>

static double uniform(line_t *line) {
    line->random ^= line->random >> 12;
    line->random ^= line->random << 25;
    line->random ^= line->random >> 27;
    return (double)(line->random * 2685821657736338717ull >> 11) / 9007199254740992.0;
}

/* What arrives over a line for the next value. */
static double arriving(line_t *line, double value) {
    const unsigned places = sizeof line->past / sizeof line->past[0];
    if (line->fault == LINE_SOUND) {
        return value;
    }
    if (!line->holds) {
        line->held = value;
        line->holds = true;
    }
    unsigned late = (unsigned)line->size;
    line->past[line->count % places] = value;
    line->count++;
    switch (line->fault) {
    case LINE_STUCK:
        return line->size;
    case LINE_FROZEN:
        return line->held;
    case LINE_OFFSET:
        return value + line->size;
    case LINE_GAIN:
        return value * line->size;
    case LINE_SIGN:
        return -value;
    case LINE_NOISE:
        return value + line->size * sqrt(12.0) * (uniform(line) - 0.5);
    case LINE_DROPOUT:
        return uniform(line) < 0.5 ? value : 0;
    case LINE_LATE:
        return line->count > late ? line->past[(line->count - 1 - late) % places] : line->held;
    case LINE_SOUND:
    default:
        return value;
    }
}

static void break_line(line_t *line, line_fault_t fault, double size) {
    *line = (line_t){.fault = fault, .size = size, .random = 88172645463325252ull};
}

void machine_break_current_sense(machine_t *m, line_fault_t fault, double size) {
    break_line(&m->bridge.sense, fault, size);
}

void machine_break_bridge_voltage(machine_t *m, line_fault_t fault, double size) {
    bridge_advance(m, m->now);
    break_line(&m->bridge.voltage, fault, size);
}

double bridge_sensed_a(machine_t *m) {
    return arriving(&m->bridge.sense, m->bridge.current_a);
}

static bool enabled(const machine_t *m) {
    return pwm_leg_switched(m, 1) && pwm_leg_switched(m, 2);
}

/* Dead time costs each leg its length once a period, against the current. */
static double switched_voltage(machine_t *m) {
    bridge_t *b = &m->bridge;
    double mean = arriving(&b->voltage, b->bus_voltage_v * (pwm_duty(m, 1) - pwm_duty(m, 2)));
    double lost = 2 * b->bus_voltage_v * pwm_dead_time_s(m) * pwm_frequency_hz(m);
    if (fabs(b->current_a) < 1e-3) {
        return mean;
    }
    return b->current_a > 0 ? mean - lost : mean + lost;
}

static void integrate(bridge_t *b, double voltage, double duration_s) {
    double tau = b->parameters.inductance_h / b->parameters.resistance_ohm;
    double settled = (voltage - b->parameters.back_emf_v_s_per_rad * b->speed_rad_per_s) /
                     b->parameters.resistance_ohm;
    double gone = -expm1(-duration_s / tau);
    b->charge_c += settled * duration_s + (b->current_a - settled) * tau * gone;
    b->current_a += (settled - b->current_a) * gone;
}

/* Freewheeling: the diodes oppose the current with the supply until it is zero. */
static void freewheel(bridge_t *b, double duration_s) {
    double before = b->current_a;
    double against = b->bus_voltage_v + 2 * b->parameters.diode_drop_v;
    if (before == 0) {
        return;
    }
    double charge = b->charge_c;
    integrate(b, before > 0 ? -against : against, duration_s);
    if (before * b->current_a <= 0) { /* stopped on the way: the tail's charge is negligible */
        b->current_a = 0;
        b->charge_c =
            charge +
            before * 0.5 * fmin(duration_s, fabs(before) * b->parameters.inductance_h / against);
    }
}

void bridge_advance(machine_t *m, tick_t at) {
    bridge_t *b = &m->bridge;
    if (!b->connected || at <= b->time) {
        return;
    }
    double duration_s = (double)(at - b->time) / (double)TICKS_PER_SECOND;
    b->time = at;
    if (enabled(m)) {
        integrate(b, switched_voltage(m), duration_s);
    } else {
        freewheel(b, duration_s);
    }
}

void bridge_check_enabled(machine_t *m) {
    bool now = enabled(m);
    if (m->bridge.was_enabled && !now) {
        m->bridge.off_at = m->now;
    }
    if (now && !m->bridge.was_enabled && pwm_dead_time_s(m) <= 0) {
        note(m, "TIM1: the bridge is on without dead time");
    }
    m->bridge.was_enabled = now;
}

void machine_connect_bridge(machine_t *m, int adc_channel, const bridge_parameters_t *parameters) {
    m->bridge.parameters = *parameters;
    m->bridge.adc_channel = adc_channel;
    m->bridge.connected = true;
    m->bridge.time = m->now;
    m->bridge.window_start = m->now;
}

void machine_set_motor(machine_t *m, double speed_rad_per_s, double bus_voltage_v) {
    bridge_advance(m, m->now);
    m->bridge.speed_rad_per_s = speed_rad_per_s;
    m->bridge.bus_voltage_v = bus_voltage_v;
}

bridge_state_t machine_bridge(machine_t *m) {
    bridge_t *b = &m->bridge;
    bridge_advance(m, m->now);
    double window_s = (double)(m->now - b->window_start) / (double)TICKS_PER_SECOND;
    bridge_state_t state = {.enabled = enabled(m),
                            .duty_a = pwm_duty(m, 1),
                            .duty_b = pwm_duty(m, 2),
                            .current_a = b->current_a,
                            .mean_a = window_s > 0 ? b->charge_c / window_s : b->current_a,
                            .frequency_hz = pwm_frequency_hz(m),
                            .dead_time_s = pwm_dead_time_s(m)};
    b->charge_c = 0;
    b->window_start = m->now;
    return state;
}

uint64_t machine_bridge_off_ns(const machine_t *m) {
    return ticks_to_ns(m->bridge.off_at);
}
