/* parameters.c: see parameters.h. */
#include "parameters.h"

#include "../board/board.h"
#include "../core/encoder.h"

/* A motor torque that swings by less is noise of the current measurement (1 mA at 0.06 N m/A is
 * 60 uN m, so this is 8 sigma), not a reversal. */
#define MOTOR_DEAD_BAND_UNM 500

/* An encoder at standstill between two counts dithers by one. */
#define DEAD_BAND_COUNTS 1

/* What a control tick has time for besides everything else: with all tables on the worst one takes
 * 12 500 instructions, of 14 000; twice as many pieces render no better (docs/compensation.md). */
#define PIECES_PER_TICK 8

#define TICKS_PER_SECOND (1000000u / BOARD_CONTROL_PERIOD_US)

_Static_assert((int)HALT_OPTION_BY_SLEW == (int)QUICK_STOP_OPTION_BY_SLEW,
               "one meaning of both option codes of CiA 402");

static torque_course_t stop_course(int16_t option) {
    return option == QUICK_STOP_OPTION_BY_SLEW ? TORQUE_STOPS_BY_SLEW : TORQUE_STOPS;
}

parameters_t parameters_of(const dictionary_t *dictionary) {
    const int32_t gain = dictionary->load_cell_gain_nnm_per_count;
    const uint32_t gain_magnitude = (uint32_t)(gain < 0 ? -gain : gain);
    const ratio_t torque_per_current = ratio_of(dictionary->torque_constant_unm_per_a, 1000000);
    return (parameters_t){
        .motor_urad_per_count =
            encoder_urad_per_count(dictionary->motor_encoder_resolution_counts_per_turn),
        .load_urad_per_count =
            encoder_urad_per_count(dictionary->load_encoder_resolution_counts_per_turn),
        .motor_arc_nm_per_count =
            encoder_arc_nm_per_count(dictionary->motor_pulley_radius_nm,
                                     dictionary->motor_encoder_resolution_counts_per_turn),
        .load_arc_nm_per_count = encoder_arc_nm_per_count(
            dictionary->load_pulley_radius_nm, dictionary->load_encoder_resolution_counts_per_turn),
        .torque_per_current = torque_per_current,
        .current_per_torque = ratio_reciprocal(torque_per_current),
        .load_cell_magnitude = ratio_of(gain_magnitude, 1000),
        .load_cell_inverted = gain < 0,
        .load_cell_zero_counts = dictionary->load_cell_zero_counts,
        .load_per_motor_angle =
            ratio_of(dictionary->motor_pulley_radius_nm, dictionary->load_pulley_radius_nm),
        .torque =
            {
                .limit_unm = (int32_t)dictionary->motor_torque_limit_unm,
                .slew_unm_per_s = dictionary->motor_torque_slew_unm_per_s,
                .stop_ticks = dictionary->quick_stop_time_ms * TORQUE_COMMAND_TICKS_PER_MS,
            },
        .ramps =
            {
                .quick_stop = dictionary->quick_stop_option != QUICK_STOP_OPTION_AT_ONCE,
                .shutdown = dictionary->shutdown_option != SHUTDOWN_OPTION_AT_ONCE,
                .disable_operation =
                    dictionary->disable_operation_option != DISABLE_OPERATION_OPTION_AT_ONCE,
            },
        .quick_stop = stop_course(dictionary->quick_stop_option),
        .halt = stop_course(dictionary->halt_option),
        .tunnel_angle_source = dictionary->tunnel_angle_source,
        .tunnel =
            tunnel_of(dictionary->tunnel_half_width_urad, dictionary->tunnel_stiffness_unm_per_rad,
                      dictionary->tunnel_torque_limit_unm),
    };
}

/* Arc of whole counts of an encoder, rounded. */
static int32_t arc_nm(int32_t counts, uint32_t radius_nm, uint32_t counts_per_turn) {
    uint32_t saturations = 0;
    return fixed_scale(counts, encoder_arc_nm_per_count(radius_nm, counts_per_turn), &saturations);
}

transmission_settings_t parameters_transmission(const dictionary_t *dictionary) {
    transmission_settings_t settings = {
        .motor_pulley_radius_nm = dictionary->motor_pulley_radius_nm,
        .load_pulley_radius_nm = dictionary->load_pulley_radius_nm,
        .cable =
            {
                .axial_stiffness_mn = dictionary->cable_axial_stiffness_mn,
                .pretension_un = (int32_t)dictionary->cable_pretension_un,
                .segments = dictionary->cable_segments,
                .friction_dynamic_ppm = dictionary->friction_dynamic_ppm,
                .friction_static_ppm = dictionary->friction_static_ppm,
                .stiction_length_um = dictionary->stiction_length_um,
            },
        .pieces_per_step = PIECES_PER_TICK,
        .motor_dead_band_unm = MOTOR_DEAD_BAND_UNM,
        /* one nanometre more, for the rounding of two positions a count apart */
        .motor_dead_band_nm = arc_nm(DEAD_BAND_COUNTS, dictionary->motor_pulley_radius_nm,
                                     dictionary->motor_encoder_resolution_counts_per_turn) +
                              1,
        .load_dead_band_nm = arc_nm(DEAD_BAND_COUNTS, dictionary->load_pulley_radius_nm,
                                    dictionary->load_encoder_resolution_counts_per_turn) +
                             1,
    };
    for (uint32_t i = 0; i < CABLE_SEGMENTS_MAX; i++) {
        settings.cable.segment_length_um[i] = dictionary->segment_length_um[i];
        settings.cable.segment_curvature_per_1000km[i] =
            dictionary->segment_curvature_per_1000km[i];
    }
    return settings;
}

compensation_settings_t parameters_compensation(const dictionary_t *dictionary) {
    return (compensation_settings_t){
        .ticks_per_s = TICKS_PER_SECOND,
        .torque_limit_unm = (int32_t)dictionary->motor_torque_limit_unm,
        .motor_inertia_gmm2 = dictionary->motor_inertia_gmm2,
        .motor_count_nm = arc_nm(1, dictionary->motor_pulley_radius_nm,
                                 dictionary->motor_encoder_resolution_counts_per_turn),
        .load_count_nm = arc_nm(1, dictionary->load_pulley_radius_nm,
                                dictionary->load_encoder_resolution_counts_per_turn),
        .friction_share_ppm = dictionary->compensation_friction_share_ppm,
        .friction_deviation_ppm = dictionary->friction_deviation_ppm,
        .standstill_band_unm = (int32_t)dictionary->compensation_standstill_band_unm,
        .integral_gain_mhz = dictionary->compensation_integral_gain_mhz,
        .slack_floor_un = (int32_t)dictionary->compensation_slack_floor_un,
        .adapt = dictionary->adaptation_enabled != 0,
    };
}

fallback_settings_t parameters_fallback(const dictionary_t *dictionary, bool model_refused) {
    const bool law_reads_cell = dictionary->compensation_law != COMPENSATION_LAW_COULOMB;
    return (fallback_settings_t){
        .use_load_cell = dictionary->compensation_use_load_cell != 0 && law_reads_cell,
        .model_refused = model_refused,
        .step_unm = (int32_t)dictionary->compensation_fallback_step_unm,
        .clean_ticks = dictionary->compensation_clean_time_ms * (TICKS_PER_SECOND / 1000u),
        .tolerance_unm = (int32_t)dictionary->compensation_tolerance_unm,
        .slip_limit_nm = (int32_t)dictionary->compensation_slip_limit_nm,
    };
}

static uint32_t culprit(uint16_t index, uint8_t sub) {
    return (uint32_t)index << 8 | sub;
}

uint32_t parameters_defect(const dictionary_t *dictionary) {
    if (dictionary->load_cell_gain_nnm_per_count == 0) {
        return culprit(0x2105, 0);
    }
    const transmission_settings_t settings = parameters_transmission(dictionary);
    uint8_t segment;
    switch (cable_check(&settings.cable, &segment)) {
    case CABLE_FINE:
        return 0;
    case CABLE_BAD_STIFFNESS:
        return culprit(0x2110, 0);
    case CABLE_BAD_PRETENSION:
        return culprit(0x2111, 0);
    case CABLE_BAD_SEGMENTS:
        return culprit(0x2112, 0);
    case CABLE_BAD_LENGTH:
        return culprit(0x2113, (uint8_t)(segment + 1u));
    case CABLE_BAD_WRAP:
        return culprit(0x2114, (uint8_t)(segment + 1u));
    case CABLE_BAD_STATIC_FRICTION:
        return culprit(0x2116, 0);
    case CABLE_BAD_STICTION_LENGTH:
    default:
        return culprit(0x2117, 0);
    }
}
