/* corrected.c: see corrected.h. */
#include "corrected.h"

#include "../board/board.h"

#define TICKS_PER_SECOND (1000000u / BOARD_CONTROL_PERIOD_US)

corrected_t corrected_by_nothing(const dictionary_t *dictionary, int32_t load_arc_nm,
                                 int32_t motor_arc_nm) {
    return (corrected_t){
        .load_angle_urad = dictionary->load_angle_urad,
        .motor_angle_urad = dictionary->motor_angle_urad,
        .load_arc_nm = load_arc_nm,
        .motor_arc_nm = motor_arc_nm,
        .load_cell_unm = dictionary->load_torque_unm,
        .motor_torque_unm = dictionary->motor_torque_unm,
    };
}

/* reading (1 + g) + offset */
static int32_t true_of(int32_t reading, int32_t gain_q20, int32_t offset) {
    uint32_t saturations = 0; /* torques are far from the range */
    const int64_t gained = (int64_t)reading * gain_q20 / TABLES_GAIN_ONE;
    return fixed_add(fixed_saturate(gained, &saturations), offset, &saturations);
}

static int32_t moved_nm(int32_t arc_nm, int32_t angle_urad, ratio_t nm_per_urad) {
    uint32_t saturations = 0; /* half a radian of half a metre at most */
    return fixed_add(arc_nm, fixed_scale(angle_urad, nm_per_urad, &saturations), &saturations);
}

corrected_t corrected_step(tables_t *tables, const corrected_start_t *start,
                           const dictionary_t *dictionary, int32_t load_arc_nm,
                           int32_t motor_arc_nm) {
    tables_step(tables, &(tables_inputs_t){
                            .load_reading_urad = dictionary->load_angle_urad,
                            .motor_reading_urad = dictionary->motor_angle_urad,
                            .conduit_mdegc = dictionary->conduit_temperature_mdegc,
                            .ticks_per_s = TICKS_PER_SECOND,
                        });
    const tables_sums_t *now = &tables->now;
    uint32_t saturations = 0; /* an angle at the end of its range is far from every tunnel */
    return (corrected_t){
        .load_angle_urad =
            fixed_add(dictionary->load_angle_urad, now->load_angle_urad, &saturations),
        .motor_angle_urad =
            fixed_add(dictionary->motor_angle_urad, now->motor_angle_urad, &saturations),
        .load_arc_nm = moved_nm(load_arc_nm, now->load_angle_urad - start->sums.load_angle_urad,
                                start->load_nm_per_urad),
        .motor_arc_nm = moved_nm(motor_arc_nm, now->motor_angle_urad - start->sums.motor_angle_urad,
                                 start->motor_nm_per_urad),
        .load_cell_unm =
            true_of(dictionary->load_torque_unm, tables->load_cell_gain_q20, now->load_cell_unm),
        .motor_torque_unm = true_of(dictionary->motor_torque_unm, tables->motor_gain_q20, 0),
    };
}
