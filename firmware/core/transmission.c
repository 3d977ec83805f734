/* transmission.c: see transmission.h. */
#include "transmission.h"

bool transmission_build_start(transmission_t *transmission,
                              const transmission_settings_t *settings) {
    transmission->settings = *settings;
    const ratio_t motor_radius_m = ratio_of(settings->motor_pulley_radius_nm, 1000000000);
    transmission->motor_torque_per_force = motor_radius_m;
    transmission->force_per_motor_torque = ratio_reciprocal(motor_radius_m);
    transmission->load_torque_per_force = ratio_of(settings->load_pulley_radius_nm, 1000000000);
    transmission->motor_angle_per_arc = ratio_of(1000000, settings->motor_pulley_radius_nm);
    uint8_t segment;
    if (cable_check(&settings->cable, &segment) != CABLE_FINE) {
        return false;
    }
    cable_build_start(&transmission->path, &transmission->build, &settings->cable);
    return true;
}

bool transmission_build_step(transmission_t *transmission) {
    const transmission_settings_t *settings = &transmission->settings;
    if (!cable_build_step(&transmission->path, &transmission->build, &settings->cable)) {
        return false;
    }
    /* Positions are whole nanometres; the answer to a torque is off by the force of one or two. */
    uint32_t saturations = 0;
    const ratio_t stiffest = transmission->path.front[CABLE_PROXIMAL][CABLE_PULL][0].stiffness;
    const int32_t rounding_un = fixed_scale(4, stiffest, &saturations);
    const int32_t dead_band_un = fixed_scale(settings->motor_dead_band_unm,
                                             transmission->force_per_motor_torque, &saturations);
    transmission->dead_band_un = dead_band_un > rounding_un ? dead_band_un : rounding_un;
    transmission_start(transmission);
    return true;
}

bool transmission_configure(transmission_t *transmission, const transmission_settings_t *settings) {
    bool done = !transmission_build_start(transmission, settings);
    const bool refused = done;
    for (uint32_t i = 0; !done && i < CABLE_BUILD_STEPS_MAX; i++) {
        done = transmission_build_step(transmission);
    }
    return !refused;
}

static void update_flags(transmission_t *transmission) {
    uint8_t flags = 0;
    if (cable_is_slack(&transmission->a)) {
        flags |= TRANSMISSION_SLACK_A;
    }
    if (cable_is_slack(&transmission->b)) {
        flags |= TRANSMISSION_SLACK_B;
    }
    if (flags == (TRANSMISSION_SLACK_A | TRANSMISSION_SLACK_B)) {
        flags |= TRANSMISSION_NO_TAUT_CABLE;
    }
    transmission->flags = flags;
}

void transmission_start(transmission_t *transmission) {
    cable_start(&transmission->a, &transmission->path);
    cable_start(&transmission->b, &transmission->path);
    transmission->motor = (pulley_t){0, 0};
    transmission->load = (pulley_t){0, 0};
    transmission->saturations = 0;
    update_flags(transmission);
}

/* Moves a pulley. False: it stays, because it has not moved or only shaken. */
static bool pulley_follow(pulley_t *pulley, int32_t arc_nm, int32_t dead_band_nm) {
    const int64_t step_nm = (int64_t)arc_nm - pulley->arc_nm;
    if (step_nm == 0) {
        return false;
    }
    const int32_t sign = step_nm > 0 ? 1 : -1;
    const int64_t size_nm = step_nm * sign;
    if (sign == -pulley->sign && size_nm <= dead_band_nm) {
        return false;
    }
    *pulley = (pulley_t){.arc_nm = arc_nm, .sign = sign};
    return true;
}

/* Moves the cables' load ends to where the load pulley is, through `most` pieces of each. True:
 * they have arrived. */
static bool follow_load(transmission_t *transmission, int32_t load_arc_nm, uint32_t most) {
    (void)pulley_follow(&transmission->load, load_arc_nm, transmission->settings.load_dead_band_nm);
    uint32_t *saturations = &transmission->saturations;
    const int32_t start_nm = -transmission->path.pretension_stretch_nm;
    const int32_t arc_nm = transmission->load.arc_nm;
    const bool a = cable_move_through(&transmission->a, &transmission->path, CABLE_DISTAL,
                                      fixed_add(start_nm, arc_nm, saturations), most);
    const bool b = cable_move_through(&transmission->b, &transmission->path, CABLE_DISTAL,
                                      fixed_subtract(start_nm, arc_nm, saturations), most);
    return a && b;
}

static void collect(transmission_t *transmission) {
    const uint32_t counts[] = {transmission->a.saturations, transmission->b.saturations};
    for (uint32_t i = 0; i < 2; i++) {
        const uint32_t room = UINT32_MAX - transmission->saturations;
        transmission->saturations += counts[i] < room ? counts[i] : room;
    }
    transmission->a.saturations = 0;
    transmission->b.saturations = 0;
    update_flags(transmission);
}

void transmission_step_position(transmission_t *transmission, int32_t motor_arc_nm,
                                int32_t load_arc_nm) {
    motor_arc_nm = fixed_clamp(motor_arc_nm, -INT32_MAX, INT32_MAX);
    load_arc_nm = fixed_clamp(load_arc_nm, -INT32_MAX, INT32_MAX);
    (void)follow_load(transmission, load_arc_nm, CABLE_PIECES_MAX);
    if (pulley_follow(&transmission->motor, motor_arc_nm,
                      transmission->settings.motor_dead_band_nm)) {
        cable_move(&transmission->a, &transmission->path, CABLE_PROXIMAL, -motor_arc_nm);
        cable_move(&transmission->b, &transmission->path, CABLE_PROXIMAL, motor_arc_nm);
    }
    collect(transmission);
}

/* T_motor_a - T_motor_b with the motor at arc_nm, on the given pieces. */
static int32_t force_un(transmission_t *transmission, const cable_piece_t *a,
                        const cable_piece_t *b, int32_t arc_nm) {
    uint32_t *saturations = &transmission->saturations;
    return fixed_subtract(cable_tension_un(a, -arc_nm, saturations),
                          cable_tension_un(b, arc_nm, saturations), saturations);
}

/* Winds the motor until the pair carries `force`. In the direction in which it must wind,
 * T_motor_a - T_motor_b changes monotonically, linear piece after piece (at a breakaway it may fall
 * back, never forth). So: walk from limit to limit until the piece that holds the answer, then
 * divide once. Each round passes one piece of one cable, hence the bound; with a lower one, `most`,
 * the motor stays at the end of the last piece, and the next step goes on from there. */
static void wind_motor(transmission_t *transmission, int32_t force, int32_t sign, uint32_t most) {
    cable_t *a = &transmission->a;
    cable_t *b = &transmission->b;
    const cable_path_t *path = &transmission->path;
    uint32_t *saturations = &transmission->saturations;
    cable_turn(a, path, CABLE_PROXIMAL, sign > 0 ? CABLE_PULL : CABLE_RELEASE);
    cable_turn(b, path, CABLE_PROXIMAL, sign > 0 ? CABLE_RELEASE : CABLE_PULL);
    cable_piece_t piece_a = cable_piece(a, path, CABLE_PROXIMAL);
    cable_piece_t piece_b = cable_piece(b, path, CABLE_PROXIMAL);
    int32_t arc_nm = transmission->motor.arc_nm;
    int32_t end_nm = arc_nm; /* of the piece, as far as both cables allow */
    for (uint32_t pieces = 0; pieces < most; pieces++) {
        const int32_t limit_a_nm = -piece_a.limit_nm;
        const int32_t limit_b_nm = piece_b.limit_nm;
        /* Of two limits at one place the pulling cable's comes first, whichever cable pulls. */
        const bool a_first = sign > 0 ? limit_a_nm <= limit_b_nm : limit_a_nm > limit_b_nm;
        end_nm = a_first ? limit_a_nm : limit_b_nm;
        if (sign > 0 ? end_nm < arc_nm : end_nm > arc_nm) { /* passed already */
            end_nm = arc_nm;
        }
        if (end_nm == INT32_MAX || end_nm == -INT32_MAX) {
            break;
        }
        const int64_t missing = (int64_t)force - force_un(transmission, &piece_a, &piece_b, end_nm);
        if (missing * sign <= 0) {
            break;
        }
        arc_nm = end_nm;
        if (a_first) {
            cable_pass(a, path, CABLE_PROXIMAL);
            piece_a = cable_piece(a, path, CABLE_PROXIMAL);
        } else {
            cable_pass(b, path, CABLE_PROXIMAL);
            piece_b = cable_piece(b, path, CABLE_PROXIMAL);
        }
    }
    const int32_t missing =
        fixed_subtract(force, force_un(transmission, &piece_a, &piece_b, arc_nm), saturations);
    const ratio_t compliance = ratio_reciprocal(ratio_add(piece_a.stiffness, piece_b.stiffness));
    const int32_t answer_nm =
        fixed_add(arc_nm, fixed_scale(missing, compliance, saturations), saturations);
    arc_nm =
        sign > 0 ? fixed_clamp(answer_nm, arc_nm, end_nm) : fixed_clamp(answer_nm, end_nm, arc_nm);
    transmission->motor = (pulley_t){.arc_nm = arc_nm, .sign = sign};
    cable_place(a, path, CABLE_PROXIMAL, -arc_nm);
    cable_place(b, path, CABLE_PROXIMAL, arc_nm);
}

void transmission_step_torque(transmission_t *transmission, int32_t motor_torque_unm,
                              int32_t load_arc_nm) {
    load_arc_nm = fixed_clamp(load_arc_nm, -INT32_MAX, INT32_MAX);
    const uint32_t wished = transmission->settings.pieces_per_step;
    const uint32_t most = wished > 0 && wished < CABLE_PIECES_MAX ? wished : 2 * CABLE_PIECES_MAX;
    /* The motor waits for a load that is still on its way: were it to turn now, it would undo that.
     */
    if (!follow_load(transmission, load_arc_nm, most / 2)) {
        collect(transmission);
        return;
    }
    uint32_t *saturations = &transmission->saturations;
    const int32_t force =
        fixed_scale(motor_torque_unm, transmission->force_per_motor_torque, saturations);
    const int32_t carried =
        fixed_subtract(transmission->a.end[CABLE_PROXIMAL].tension_un,
                       transmission->b.end[CABLE_PROXIMAL].tension_un, saturations);
    const int32_t missing = fixed_subtract(force, carried, saturations);
    const int32_t sign = missing > 0 ? 1 : -1;
    const bool shaking =
        sign == -transmission->motor.sign && missing * sign <= transmission->dead_band_un;
    if (missing != 0 && !shaking) {
        wind_motor(transmission, force, sign, most);
    }
    collect(transmission);
}

int32_t transmission_motor_angle_urad(transmission_t *transmission) {
    return fixed_scale(transmission->motor.arc_nm, transmission->motor_angle_per_arc,
                       &transmission->saturations);
}

/* r (T_a - T_b) at one side. */
static int32_t torque_unm(transmission_t *transmission, cable_side_t side, ratio_t radius_m) {
    const int32_t force =
        fixed_subtract(transmission->a.end[side].tension_un, transmission->b.end[side].tension_un,
                       &transmission->saturations);
    return fixed_scale(force, radius_m, &transmission->saturations);
}

int32_t transmission_motor_torque_unm(transmission_t *transmission) {
    return torque_unm(transmission, CABLE_PROXIMAL, transmission->motor_torque_per_force);
}

int32_t transmission_load_torque_unm(transmission_t *transmission) {
    return torque_unm(transmission, CABLE_DISTAL, transmission->load_torque_per_force);
}
