/* homing.h: what a host's `homing` asks for: the zero of the angles "here", or by index pulses.
 *
 * The drive does not move the load for it: an operator holds it. So CiA 402's mode 6 does not
 * exist, the bridge is off, and of its methods there are 37 (here) and 34 (index pulse in positive
 * direction).
 */
#ifndef BOWDEN_DRIVE_HOMING_H
#define BOWDEN_DRIVE_HOMING_H

#include "drive.h"

/* One tick, before the sensors are published: follows the reference of the angles. */
void homing_step(drive_t *drive, const board_sensors_t *sensors);

#endif
