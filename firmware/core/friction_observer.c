/* friction_observer.c: see friction_observer.h. */
#include "friction_observer.h"

#define ONE_Q24 (1 << 24)
#define WINDOWS_PER_S 64
#define MOST_NM 6000000       /* of a gap: 312 ticks of it fit in a sum */
#define LEAST_COUNTS 3        /* of the load in a window */
#define MOST_Q16 (24 << 16)   /* of what a sample says; more is a very stiff pair, or a slip */
#define SURPRISE_Q24 ONE_Q24  /* an error of a sample counts up to this */
#define CHANGE_X_Q30 8053064  /* 0.087^2: friction changes in use by 15 % at most, evenly */
#define PRIOR_E_Q30 10737418  /* 0.1^2 */
#define PRIOR_D_Q30 6333186   /* 0.0768^2: 1.2 ms */
#define PRIOR_O_Q30 42949673  /* 0.2^2, in units of B */
#define DRIFT_Q30 1074        /* 1e-6 a sample: a tenth in 160 s of sliding */
#define FADING_WINDOWS 128    /* tau of (O4): 2 s of sliding */
#define NOISE_Q24 41943       /* 0.05^2 of B: least variance of a sample, beside the counts' */
#define NOISE_WINDOWS 16      /* 1/4 s of sliding, over which the noise scale is estimated */
#define SURE_DEVIATIONS 2     /* at one, 14 of 150 rigs of the priors are pushed; at two, none */
#define LEAST_Q16 16384       /* 1/4 */
#define MOST_FACTOR_Q16 81920 /* 5/4 */

/* Where row i, column j of the covariance is kept. */
static const uint8_t AT[FRICTION_OBSERVER_NUMBERS][FRICTION_OBSERVER_NUMBERS] = {
    {0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}};

friction_observer_t friction_observer_of(int32_t stretch_nm, int32_t count_nm, uint32_t ticks_per_s,
                                         uint32_t deviation_ppm) {
    const int32_t deviation_q16 = (int32_t)((uint64_t)deviation_ppm * 65536u / 1000000u);
    uint32_t saturations = 0; /* not used: without stretch the noise is unbounded anyway */
    const uint32_t stretch = stretch_nm > 0 ? (uint32_t)stretch_nm : 1u;
    const ratio_t q16_per_nm = ratio_of(FRICTION_OBSERVER_ONE, stretch);
    const int32_t count_q16 =
        fixed_clamp(fixed_scale(count_nm, q16_per_nm, &saturations), 0, 1 << 19);
    const int32_t counts_q24 = (int32_t)((int64_t)count_q16 * count_q16 / 256 / 8);
    friction_observer_t observer = {
        .q16_per_nm = q16_per_nm,
        .least_noise_q24 = NOISE_Q24 + counts_q24,
        .window_ticks = ticks_per_s / WINDOWS_PER_S,
        .least_travel_nm = LEAST_COUNTS * count_nm,
        .most_q30 = {deviation_q16 * deviation_q16 / 4 + CHANGE_X_Q30, PRIOR_E_Q30, PRIOR_D_Q30,
                     PRIOR_O_Q30},
    };
    friction_observer_expect(&observer, FRICTION_OBSERVER_ONE);
    return observer;
}

/* Q16 of Q30, both below one. */
static int32_t root_q16(int32_t square_q30) {
    return (int32_t)fixed_root((uint64_t)(uint32_t)square_q30 * 4u, 16);
}

void friction_observer_expect(friction_observer_t *observer, uint32_t factor_q16) {
    for (uint32_t i = 0; i < FRICTION_OBSERVER_NUMBERS; i++) {
        observer->mean_q24[i] = 0;
        for (uint32_t j = i; j < FRICTION_OBSERVER_NUMBERS; j++) {
            observer->covariance_q30[AT[i][j]] = i == j ? observer->most_q30[i] : 0;
        }
    }
    observer->prior_q24 = ((int32_t)factor_q16 - FRICTION_OBSERVER_ONE) * 256;
    observer->mean_q24[0] = observer->prior_q24;
    observer->noise_q24 = observer->least_noise_q24;
    observer->deviation_q16 = root_q16(observer->covariance_q30[0]);
}

/* (O4) over a window of sliding. */
static void fade(friction_observer_t *observer) {
    int32_t *p = observer->covariance_q30;
    observer->mean_q24[0] += (observer->prior_q24 - observer->mean_q24[0]) / FADING_WINDOWS;
    p[0] += (observer->most_q30[0] - p[0]) / (FADING_WINDOWS / 2);
    for (uint32_t j = 1; j < FRICTION_OBSERVER_NUMBERS; j++) {
        p[AT[0][j]] -= p[AT[0][j]] / FADING_WINDOWS;
    }
    observer->deviation_q16 = root_q16(p[0]);
}

/* What of a sample's error is beyond the spread of the four numbers is noise. */
static void estimate_noise(friction_observer_t *observer, int32_t surprise_q24,
                           int32_t spread_q24) {
    const int32_t square_q24 = (int32_t)((int64_t)surprise_q24 * surprise_q24 / ONE_Q24);
    const int32_t seen_q24 = square_q24 > spread_q24 ? square_q24 - spread_q24 : 0;
    observer->noise_q24 += (seen_q24 - observer->noise_q24) / NOISE_WINDOWS;
    if (observer->noise_q24 < observer->least_noise_q24) {
        observer->noise_q24 = observer->least_noise_q24;
    }
}

/* One sample of (O2): `seen` is its left side, `h` what x, e, d and o go with; Q16. */
static void learn(friction_observer_t *observer, int32_t seen_q16,
                  const int32_t h_q16[FRICTION_OBSERVER_NUMBERS]) {
    int32_t *p = observer->covariance_q30;
    int32_t ph_q30[FRICTION_OBSERVER_NUMBERS];
    int64_t spread_q30 = 0; /* h P h; |h| is below 24, P below 0.1: all sums stay below 2^51 */
    int64_t expected_q24 = 0;
    uint32_t saturations = 0;
    for (uint32_t i = 0; i < FRICTION_OBSERVER_NUMBERS; i++) {
        int64_t sum = 0;
        for (uint32_t j = 0; j < FRICTION_OBSERVER_NUMBERS; j++) {
            sum += (int64_t)p[AT[i][j]] * h_q16[j];
        }
        ph_q30[i] = fixed_saturate(sum / 65536, &saturations);
        spread_q30 += (int64_t)ph_q30[i] * h_q16[i] / 65536;
        expected_q24 += (int64_t)observer->mean_q24[i] * h_q16[i] / 65536;
    }
    const int32_t surprise_q24 =
        fixed_clamp(fixed_saturate((int64_t)seen_q16 * 256 - expected_q24, &saturations),
                    -SURPRISE_Q24, SURPRISE_Q24);
    const int32_t spread_q24 = fixed_saturate(spread_q30 / 64, &saturations);
    estimate_noise(observer, surprise_q24, spread_q24);
    const int32_t variance_q24 = fixed_add(spread_q24, observer->noise_q24, &saturations);
    const ratio_t per_variance = ratio_of(1 << 18, variance_q24 > 0 ? (uint32_t)variance_q24 : 1u);
    for (uint32_t i = 0; i < FRICTION_OBSERVER_NUMBERS; i++) {
        const int32_t gain_q24 = fixed_scale(ph_q30[i], per_variance, &saturations);
        observer->mean_q24[i] += (int32_t)((int64_t)gain_q24 * surprise_q24 / ONE_Q24);
        for (uint32_t j = i; j < FRICTION_OBSERVER_NUMBERS; j++) {
            p[AT[i][j]] -= (int32_t)((int64_t)gain_q24 * ph_q30[j] / ONE_Q24);
        }
        p[AT[i][i]] = fixed_clamp(p[AT[i][i]], 0, observer->most_q30[i]) + DRIFT_Q30;
    }
    observer->deviation_q16 = root_q16(p[0]);
}

/* The window is over: its means are a sample, if the pair slid one way for most of it. */
static void close_window(friction_observer_t *observer, int32_t load_arc_nm) {
    uint32_t saturations = 0; /* beyond the range is beyond MOST */
    const int32_t ticks = (int32_t)observer->window_ticks;
    const int32_t side = observer->slid_ticks > 0 ? 1 : -1;
    const int32_t travel_nm = side * fixed_subtract(load_arc_nm, observer->mark_nm, &saturations);
    const int32_t gap_nm = side * (observer->gap_sum_nm / ticks);
    const int32_t innovation_nm = side * (observer->innovation_sum_nm / ticks);
    const bool slid = 2 * side * observer->slid_ticks > ticks;
    if (!slid || travel_nm < observer->least_travel_nm) {
        return;
    }
    fade(observer);
    if (observer->slack) {
        return;
    }
    const int32_t h_q16[FRICTION_OBSERVER_NUMBERS] = {
        -FRICTION_OBSERVER_ONE,
        fixed_scale(gap_nm, observer->q16_per_nm, &saturations),
        fixed_scale(travel_nm, observer->q16_per_nm, &saturations),
        side * FRICTION_OBSERVER_ONE,
    };
    const int32_t size_q16 = h_q16[1] < 0 ? -h_q16[1] : h_q16[1];
    if (size_q16 < MOST_Q16 && h_q16[2] < MOST_Q16) {
        const int32_t seen_q16 = fixed_scale(innovation_nm, observer->q16_per_nm, &saturations);
        learn(observer, fixed_clamp(seen_q16, -2 * MOST_Q16, 2 * MOST_Q16), h_q16);
    }
}

void friction_observer_step(friction_observer_t *observer, const friction_observed_t *seen) {
    if (!observer->started) {
        observer->started = true;
        observer->mark_nm = seen->load_arc_nm;
    }
    observer->slid_ticks += seen->side;
    observer->slack = observer->slack || seen->slack;
    observer->gap_sum_nm += fixed_clamp(seen->gap_nm, -MOST_NM, MOST_NM);
    observer->innovation_sum_nm += fixed_clamp(seen->innovation_nm, -MOST_NM, MOST_NM);
    if (++observer->ticks < observer->window_ticks) {
        return;
    }
    close_window(observer, seen->load_arc_nm);
    observer->ticks = 0;
    observer->slid_ticks = 0;
    observer->slack = false;
    observer->gap_sum_nm = 0;
    observer->innovation_sum_nm = 0;
    observer->mark_nm = seen->load_arc_nm;
}

static uint32_t bounded_q16(int32_t factor_q16) {
    return (uint32_t)fixed_clamp(factor_q16, LEAST_Q16, MOST_FACTOR_Q16);
}

uint32_t friction_observer_mean_q16(const friction_observer_t *observer) {
    return bounded_q16(FRICTION_OBSERVER_ONE + observer->mean_q24[0] / 256);
}

uint32_t friction_observer_sure_q16(const friction_observer_t *observer) {
    const int32_t x_q16 = observer->mean_q24[0] / 256;
    const int32_t believed_q16 = x_q16 > 0 ? x_q16 / 2 : x_q16;
    return bounded_q16(FRICTION_OBSERVER_ONE + believed_q16 -
                       SURE_DEVIATIONS * observer->deviation_q16);
}
