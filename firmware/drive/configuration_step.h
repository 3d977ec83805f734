/* configuration_step.h: see configuration.h. Apart from it because it needs drive_t, which holds
 * configuration_t. Called by drive.c only.
 */
#ifndef BOWDEN_DRIVE_CONFIGURATION_STEP_H
#define BOWDEN_DRIVE_CONFIGURATION_STEP_H

#include "drive.h"

/* Does the configuration that runs agree with the dictionary? The bridge must not go on before. */
bool configuration_stands(const drive_t *drive);

/* One tick; with the bridge on nothing can have changed. `now`: the host asks for the next state
 * up. Done when drive->configuration.stage is CONFIGURATION_STANDS; the model starts from a virgin
 * rig at the angles of then. */
void configuration_step(drive_t *drive, const board_sensors_t *sensors, bool now);

#endif
