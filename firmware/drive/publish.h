/* publish.h: what a tick has measured, estimated and decided, into the entries of the dictionary
 * and from there to the bus. Reads the drive, decides nothing.
 */
#ifndef BOWDEN_DRIVE_PUBLISH_H
#define BOWDEN_DRIVE_PUBLISH_H

#include "drive.h"

/* Largest value of an entry of three bytes. */
#define PUBLISH_I24_MAX 8388607

/* Scales the sensors' readings, also into the arcs of the drive. First in a tick. */
void publish_sensors(drive_t *drive, const board_sensors_t *sensors);

/* After the model's step. */
void publish_model(drive_t *drive);

/* After everything else. */
void publish_state(drive_t *drive, const board_sensors_t *sensors);

/* Counts a sample where process data will be sent in this tick. */
void publish_sample(drive_t *drive, const board_sensors_t *sensors);

/* The winding's trace, once it is no longer asked for. `traces`: it is, in this tick. */
void publish_winding(drive_t *drive, const board_winding_t *winding, bool traces);

#endif
