/* encoder.c: quadrature encoders wired to timers in encoder mode (RM0090 18.3.12).
 *
 * The plant sets a position in counts; the lines A and B step through their four states to it,
 * one quarter period at a time, and the timer decodes edges and levels with the manual's table,
 * so a broken wire, swapped pins or a wrong input polarity show as they would on the board. One
 * turn has counts_per_turn such counts; the index line is high in the state that begins a turn.
 */
#include "board.h"

static int level_at(const encoder_t *e, int line, int64_t position) {
    if (e->broken[line] >= 0) {
        return e->broken[line];
    }
    unsigned quarter = (unsigned)(position & 3); /* A leads B for increasing positions */
    if (line == 2) {
        return position % e->counts_per_turn == 0;
    }
    return line == 0 ? quarter == 1 || quarter == 2 : quarter >= 2;
}

/* Pins that may carry channel 1 and 2 of TIM1 .. TIM5 and TIM8: the alternate function number. */
static unsigned alternate_of(int timer) {
    return timer <= 2 ? 1 : timer <= 5 ? 2 : 3;
}

static bool lines_reach_timer(const machine_t *m, int timer) {
    const encoder_t *e = &m->encoder[timer];
    unsigned function = alternate_of(timer);
    return gpio_is_alternate(m, e->port[0], e->pin[0], function) &&
           gpio_is_alternate(m, e->port[1], e->pin[1], function);
}

/* Table "Counting direction versus encoder signals", for one edge of TI1 or TI2. */
static int count_of_edge(const tim_t *t, int line, bool rising, bool other_high) {
    uint32_t mode = t->smcr & 7u;
    bool counted = line == 0 ? mode == 2 || mode == 3 : mode == 1 || mode == 3;
    if (!counted) {
        return 0;
    }
    bool inverted_1 = t->ccer >> 1 & 1u; /* CC1P */
    bool inverted_2 = t->ccer >> 5 & 1u;
    rising ^= line == 0 ? inverted_1 : inverted_2;
    other_high ^= line == 0 ? inverted_2 : inverted_1;
    bool up = line == 0 ? rising != other_high : rising == other_high;
    return up ? 1 : -1;
}

static void count(machine_t *m, int timer, int step) {
    tim_t *t = &m->tim[timer];
    uint32_t now = t->base_count;
    t->down = step < 0;
    t->cr1 = step < 0 ? t->cr1 | 1u << 4 : t->cr1 & ~(1u << 4);
    if (step > 0 && now == t->arr_now) {
        t->base_count = 0;
    } else if (step < 0 && now == 0) {
        t->base_count = t->arr_now;
    } else {
        t->base_count = now + (uint32_t)step;
        return;
    }
    if (!(t->cr1 & 2u)) { /* a wrap is an update event unless UDIS */
        t->sr |= 1u;
        tim_update_irq(m, timer);
    }
}

static void move_line(machine_t *m, int timer, int line, int level) {
    encoder_t *e = &m->encoder[timer];
    if (m->gpio[e->port[line]].driven[e->pin[line]] == level) {
        return;
    }
    gpio_drive(m, e->port[line], e->pin[line], level);
    tim_t *t = &m->tim[timer];
    if (line < 2 && tim_is_encoder(t) && (t->cr1 & 1u) && lines_reach_timer(m, timer)) {
        bool other = gpio_level(m, e->port[1 - line], e->pin[1 - line]) != 0;
        int step = count_of_edge(t, line, level != 0, other);
        if (step != 0) {
            count(m, timer, step);
        }
    }
}

static void encoder_lines(machine_t *m, int timer) {
    encoder_t *e = &m->encoder[timer];
    for (int line = 0; line < 3; line++) {
        if (e->port[line] >= 0) {
            move_line(m, timer, line, level_at(e, line, e->position));
        }
    }
}

void machine_wire_encoder(machine_t *m, int timer, int port_a, int pin_a, int port_b, int pin_b,
                          int index_port, int index_pin, int counts_per_turn) {
    m->encoder[timer] = (encoder_t){.port = {port_a, port_b, index_port},
                                    .pin = {pin_a, pin_b, index_pin},
                                    .broken = {-1, -1, -1},
                                    .counts_per_turn = counts_per_turn,
                                    .wired = true};
    encoder_lines(m, timer);
}

void machine_set_encoder(machine_t *m, int timer, int64_t counts) {
    encoder_t *e = &m->encoder[timer];
    while (e->wired && e->position != counts) {
        e->position += counts > e->position ? 1 : -1;
        encoder_lines(m, timer);
    }
}

void machine_break_encoder_wire(machine_t *m, int timer, int line, int level) {
    m->encoder[timer].broken[line] = level;
    if (m->encoder[timer].wired) {
        encoder_lines(m, timer);
    }
}
