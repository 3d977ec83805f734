/* transmission.h: the pull-pull pair: two cables between the motor pulley and the load pulley.
 *
 * Two modes. Torque-position: motor torque and load angle are given, the motor angle is found at
 * which r_motor (T_motor_a - T_motor_b) is the torque. Position-position: both angles are given.
 *
 * Signs: a positive motor angle winds cable a; a positive load angle is the motion that cable a
 * produces; motor torque is applied by the motor on its pulley, load torque by the cables on the
 * load. Positions are arc lengths on the pulleys in nanometres, radius times angle, zero at the
 * start. Exchanging the cables mirrors everything to the last bit.
 *
 * Cost of a step: at most 2 CABLE_PIECES_MAX pieces at the motor and as many at the load; one
 * division. No allocation; the state is the struct (about 9 KB).
 */
#ifndef BOWDEN_CORE_TRANSMISSION_H
#define BOWDEN_CORE_TRANSMISSION_H

#include <stdbool.h>
#include <stdint.h>

#include "cable.h"
#include "fixed.h"

typedef struct {
    uint32_t motor_pulley_radius_nm; /* > 0 */
    uint32_t load_pulley_radius_nm;  /* > 0 */
    cable_settings_t cable;
    /* A reversal counts once it is larger than this; until then the end is held where it turned,
     * and then follows in full. It keeps sensor noise and encoder dither from being taken for
     * motion. */
    int32_t motor_dead_band_nm;  /* position-position mode */
    int32_t motor_dead_band_unm; /* torque-position mode */
    int32_t load_dead_band_nm;
    /* Torque-position mode: a step moves the ends through no more pieces of the cables than this,
     * and the next step goes on; 0: through all. Profiles that turn over at once then take a few
     * steps, and no step takes longer than it may. */
    uint32_t pieces_per_step;
} transmission_settings_t;

/* Bits of transmission_t.flags. */
enum {
    TRANSMISSION_SLACK_A = 1 << 0,
    TRANSMISSION_SLACK_B = 1 << 1,
    TRANSMISSION_NO_TAUT_CABLE = 1 << 2, /* nothing carries torque; the motor angle is held */
};

/* One pulley: where it is, and which way it last moved (0: not yet). */
typedef struct {
    int32_t arc_nm;
    int32_t sign;
} pulley_t;

typedef struct {
    transmission_settings_t settings;
    ratio_t force_per_motor_torque; /* uN per uN m */
    ratio_t motor_torque_per_force;
    ratio_t load_torque_per_force;
    ratio_t motor_angle_per_arc; /* urad per nm */
    int32_t dead_band_un;        /* of T_motor_a - T_motor_b; at least what rounding makes */
    cable_path_t path;
    cable_build_t build; /* of path */
    cable_t a;
    cable_t b;
    pulley_t motor;
    pulley_t load;
    uint8_t flags;
    uint32_t saturations; /* sticky count, cables included, since transmission_start() */
} transmission_t;

/* Starts to compute the constants. False: cable_check() refuses the settings. */
bool transmission_build_start(transmission_t *transmission,
                              const transmission_settings_t *settings);

/* Goes on by a piece (cable_path.h). True: done, the pair is virgin; no other call before that. */
bool transmission_build_step(transmission_t *transmission);

/* All of it at once: 40 control ticks and more. False: refused. */
bool transmission_configure(transmission_t *transmission, const transmission_settings_t *settings);

/* A virgin pair: uniform pretension, both arcs zero. */
void transmission_start(transmission_t *transmission);

/* Torque-position mode: one step. */
void transmission_step_torque(transmission_t *transmission, int32_t motor_torque_unm,
                              int32_t load_arc_nm);

/* Position-position mode: one step. */
void transmission_step_position(transmission_t *transmission, int32_t motor_arc_nm,
                                int32_t load_arc_nm);

int32_t transmission_motor_angle_urad(transmission_t *transmission);
int32_t transmission_motor_torque_unm(transmission_t *transmission);
int32_t transmission_load_torque_unm(transmission_t *transmission);

#endif
