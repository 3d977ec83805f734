/* fixed.c: see fixed.h. */
#include "fixed.h"

#include <stdbool.h>

#define MANTISSA_BITS 31

/* The external copies of what fixed_inline.h defines. */
extern inline int32_t fixed_saturated(bool negative, uint32_t *saturations);
extern inline int32_t fixed_saturate(int64_t wide, uint32_t *saturations);
extern inline int32_t fixed_add(int32_t a, int32_t b, uint32_t *saturations);
extern inline int32_t fixed_subtract(int32_t a, int32_t b, uint32_t *saturations);
extern inline int32_t fixed_scale(int32_t quantity, ratio_t ratio, uint32_t *saturations);
extern inline int32_t fixed_clamp(int32_t value, int32_t low, int32_t high);

/* value / 2^shift, rounded half away from zero. value < 2^63, any shift >= 0. */
static uint64_t shifted_right(uint64_t value, int32_t shift) {
    if (shift == 0) {
        return value;
    }
    return shift > 63 ? 0 : (value + (UINT64_C(1) << (shift - 1))) >> shift;
}

/* The ratio value * 2^-shift, normalised and rounded. */
static ratio_t normalised(uint64_t value, int32_t shift) {
    if (value == 0) {
        return (ratio_t){.mantissa = 0, .shift = 0};
    }
    const int32_t excess = 64 - MANTISSA_BITS - __builtin_clzll(value);
    uint64_t mantissa;
    if (excess > 0) {
        mantissa = (value >> excess) + ((value >> (excess - 1)) & 1u);
    } else {
        mantissa = value << -excess;
    }
    int32_t normal_shift = shift - excess;
    if (mantissa >> MANTISSA_BITS != 0) { /* rounded up to the next power of two */
        mantissa >>= 1;
        normal_shift -= 1;
    }
    return (ratio_t){.mantissa = (uint32_t)mantissa, .shift = normal_shift};
}

ratio_t ratio_of(uint64_t numerator, uint64_t denominator) {
    if (numerator == 0) {
        return normalised(0, 0);
    }
    /* The numerator moved up to 64 bits and the denominator moved to 32, one division: a quotient
     * of 32 bits or more. A longer denominator loses its low bits, rounded. */
    const int32_t up = __builtin_clzll(numerator);
    const int32_t width = 64 - __builtin_clzll(denominator);
    const uint64_t divisor =
        width > 32 ? (denominator >> (width - 32)) + ((denominator >> (width - 33)) & 1u)
                   : denominator << (32 - width);
    return normalised((numerator << up) / divisor, up + width - 32);
}

ratio_t ratio_add(ratio_t a, ratio_t b) {
    if (a.mantissa == 0) {
        return b;
    }
    if (b.mantissa == 0) {
        return a;
    }
    const ratio_t large = a.shift <= b.shift ? a : b; /* the smaller shift is the larger value */
    const ratio_t small = a.shift <= b.shift ? b : a;
    const int32_t gap = small.shift - large.shift;
    /* 31 more bits below the larger mantissa, so that the sum is rounded once */
    const uint64_t sum = ((uint64_t)large.mantissa << MANTISSA_BITS) +
                         shifted_right((uint64_t)small.mantissa << MANTISSA_BITS, gap);
    return normalised(sum, large.shift + MANTISSA_BITS);
}

ratio_t ratio_multiply(ratio_t a, ratio_t b) {
    return normalised((uint64_t)a.mantissa * b.mantissa, a.shift + b.shift);
}

ratio_t ratio_reciprocal(ratio_t a) {
    if (a.mantissa == 0) {
        return a;
    }
    return normalised((UINT64_C(1) << 62) / a.mantissa, 62 - a.shift);
}

/* 1/n in Q32, n = 2 .. 16; [n - 2]. */
static const uint32_t INVERSE_Q32[] = {
    0x80000000u, 0x55555555u, 0x40000000u, 0x33333333u, 0x2AAAAAABu,
    0x24924925u, 0x20000000u, 0x1C71C71Cu, 0x1999999Au, 0x1745D174u,
    0x15555555u, 0x13B13B14u, 0x12492492u, 0x11111111u, 0x10000000u,
};

#define ONE_Q32 (UINT64_C(1) << 32)
#define SERIES_TERMS 14 /* 0.694^15 / 15! < 2^-48 */

/* 1 - x/f + x^2/(f (f+1)) - ... by Horner, x < 0.7, in Q32: exp(-x) for f = 1, and
 * (1 - exp(-x)) / x for f = 2. Starts and stays at or below one. */
static uint64_t alternating_series(uint32_t x_q32, uint32_t first) {
    uint64_t sum = ONE_Q32;
    for (uint32_t n = SERIES_TERMS; n > first; n--) {
        const uint32_t step =
            (uint32_t)(((uint64_t)x_q32 * INVERSE_Q32[n - 2] + (ONE_Q32 / 2)) >> 32);
        sum = ONE_Q32 - ((sum * step + (ONE_Q32 / 2)) >> 32);
    }
    const uint32_t step =
        first == 1 ? x_q32
                   : (uint32_t)(((uint64_t)x_q32 * INVERSE_Q32[first - 2] + (ONE_Q32 / 2)) >> 32);
    return ONE_Q32 - ((sum * step + (ONE_Q32 / 2)) >> 32);
}

#define LN2_Q32 UINT64_C(2977044472)
#define LOG2_E_Q30 UINT64_C(1549082004) /* rounded down, so that `rest` is never negative */

uint32_t fixed_exp_minus(uint32_t x_q24) {
    /* exp(-x) = 2^-whole exp(-rest), 0 <= rest < ln 2 (or a hair more when `whole` rounds down) */
    const uint32_t whole = (uint32_t)((x_q24 * LOG2_E_Q30) >> 54);
    const uint64_t rest_q32 = ((uint64_t)x_q24 << 8) - whole * LN2_Q32;
    if (whole > 32) {
        return 0;
    }
    const uint64_t exp_q32 = alternating_series((uint32_t)rest_q32, 1);
    return (uint32_t)((exp_q32 + (UINT64_C(1) << whole)) >> (whole + 1));
}

uint32_t fixed_exp_minus_mean(uint32_t x_q24) {
    if (x_q24 <= FIXED_Q24_ONE / 2) {
        return (uint32_t)((alternating_series(x_q24 << 8, 2) + 1) >> 1);
    }
    const uint64_t fall_q31 = FIXED_Q31_ONE - fixed_exp_minus(x_q24);
    return (uint32_t)(((fall_q31 << 24) + x_q24 / 2) / x_q24);
}

uint32_t fixed_root(uint64_t square, uint32_t bits) {
    uint32_t root = 0;
    for (uint32_t bit = UINT32_C(1) << (bits - 1); bit > 0; bit >>= 1) {
        const uint32_t larger = root | bit;
        if ((uint64_t)larger * larger <= square) {
            root = larger;
        }
    }
    return root;
}
