/* torque_command.c: see torque_command.h. */
#include "torque_command.h"

#include "../core/fixed.h"

#define TICKS_PER_SECOND (1000u * TORQUE_COMMAND_TICKS_PER_MS)

void torque_command_idle(torque_command_t *command) {
    *command = (torque_command_t){0};
}

/* What the slew limit allows in this tick; divisions leave no torque behind. */
static int32_t slew_step_unm(torque_command_t *command, uint32_t slew_unm_per_s) {
    const uint32_t allowance = slew_unm_per_s + command->slew_remainder;
    command->slew_remainder = allowance % TICKS_PER_SECOND;
    return (int32_t)(allowance / TICKS_PER_SECOND);
}

/* The step of a line that reaches 0 in `ticks`. */
static int32_t stop_step_unm(int32_t torque_unm, uint32_t ticks) {
    const uint32_t magnitude = (uint32_t)(torque_unm < 0 ? -torque_unm : torque_unm);
    return (int32_t)((magnitude + ticks - 1u) / ticks);
}

void torque_command_step(torque_command_t *command, const torque_command_settings_t *settings,
                         torque_course_t course, int32_t wanted_unm) {
    int32_t step_unm = slew_step_unm(command, settings->slew_unm_per_s);
    int32_t target_unm = 0;
    if (course == TORQUE_FOLLOWS) {
        target_unm = fixed_clamp(wanted_unm, -settings->limit_unm, settings->limit_unm);
        command->limited = target_unm != wanted_unm;
    } else {
        const bool by_slew = course == TORQUE_STOPS_BY_SLEW;
        if (course != command->course) {
            command->stop_step_unm =
                stop_step_unm(command->torque_unm,
                              by_slew ? TORQUE_COMMAND_STOP_MAX_TICKS : settings->stop_ticks);
        }
        command->limited = false;
        const bool slew_is_sooner = by_slew && step_unm > command->stop_step_unm;
        step_unm = slew_is_sooner ? step_unm : command->stop_step_unm;
    }
    command->course = course;
    command->torque_unm =
        fixed_clamp(target_unm, command->torque_unm - step_unm, command->torque_unm + step_unm);
}
