/* fixed.h: the integer arithmetic that everything else in core is written in.
 *
 * Two kinds of number. A *quantity* is an int32_t in the unit that its name ends in (tension_un).
 * A *ratio* is a positive constant of the configuration with 31 significant bits and its own binary
 * point, so that a stiffness of 0.1 N/m and one of 1 GN/m are equally exact.
 *
 * One rounding rule: to the nearest, half away from zero. It is odd, round(-x) = -round(x), so that
 * a mirrored motion gives mirrored results to the last bit. One saturation rule: to +-INT32_MAX
 * (INT32_MIN is never a result), and each saturated result counts up the caller's counter.
 *
 * Pure functions, no state. Those named ratio_* and fixed_exp_* are for the configuration; the tick
 * uses the others and one ratio_reciprocal(), the only division in a tick.
 */
#ifndef BOWDEN_CORE_FIXED_H
#define BOWDEN_CORE_FIXED_H

#include <stdint.h>

/* value = mantissa * 2^-shift; mantissa is 0 (the ratio 0) or in [2^30, 2^31). */
typedef struct {
    uint32_t mantissa;
    int32_t shift;
} ratio_t;

/* One in the results of fixed_exp_minus() and fixed_exp_minus_mean(). */
#define FIXED_Q31_ONE UINT32_C(0x80000000)

/* One in the argument of fixed_exp_minus() and fixed_exp_minus_mean(). */
#define FIXED_Q24_ONE (UINT32_C(1) << 24)

/* `wide` limited to +-INT32_MAX; counts when it had to be. */
inline int32_t fixed_saturate(int64_t wide, uint32_t *saturations);

/* a + b, a - b, saturated. */
inline int32_t fixed_add(int32_t a, int32_t b, uint32_t *saturations);
inline int32_t fixed_subtract(int32_t a, int32_t b, uint32_t *saturations);

/* quantity * ratio, rounded, saturated. A ratio of 2^30 or more saturates whatever is not 0. */
inline int32_t fixed_scale(int32_t quantity, ratio_t ratio, uint32_t *saturations);

/* `value` limited to [low, high]; does not count. low <= high. */
inline int32_t fixed_clamp(int32_t value, int32_t low, int32_t high);

/* numerator / denominator to 31 significant bits, relative error at most 1.5 * 2^-31.
 * denominator > 0. */
ratio_t ratio_of(uint64_t numerator, uint64_t denominator);

/* Sum, product and reciprocal, relative error at most 2^-30. The reciprocal of 0 is 0: callers that
 * may have a zero stiffness want no contribution from it. */
ratio_t ratio_add(ratio_t a, ratio_t b);
ratio_t ratio_multiply(ratio_t a, ratio_t b);
ratio_t ratio_reciprocal(ratio_t a);

/* exp(-x), x in Q24 from 0 to 255, result in Q31. exp(0) is exactly one and no result is larger: a
 * cable must never gain tension from rounding. Falls monotonically. Absolute error <= 2 units. */
uint32_t fixed_exp_minus(uint32_t x_q24);

/* The mean of exp(-y) over 0 <= y <= x, (1 - exp(-x)) / x, in Q31; exactly one at 0. Absolute
 * error <= 4 units. */
uint32_t fixed_exp_minus_mean(uint32_t x_q24);

/* Square root, rounded down; below 2^bits, 1 <= bits <= 32, so that a small one costs little: of a
 * larger number it is 2^bits - 1. */
uint32_t fixed_root(uint64_t square, uint32_t bits);

#ifndef DECLARATIONS_ONLY /* for readers of the interface that know no function bodies */
#include "fixed_inline.h"
#endif

#endif
