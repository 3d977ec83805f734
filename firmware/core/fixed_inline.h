/* fixed_inline.h: the arithmetic of the tick, part of fixed.h. In a header because calls would cost
 * the control tick an eighth of its instructions.
 */
#ifndef BOWDEN_CORE_FIXED_INLINE_H
#define BOWDEN_CORE_FIXED_INLINE_H

#include <stdbool.h>
#include <stdint.h>

#include "fixed.h"

/* The result of what does not fit; counts it. */
inline int32_t fixed_saturated(bool negative, uint32_t *saturations) {
    if (*saturations < UINT32_MAX) {
        *saturations += 1;
    }
    return negative ? -INT32_MAX : INT32_MAX;
}

inline int32_t fixed_saturate(int64_t wide, uint32_t *saturations) {
    if (wide > INT32_MAX || wide < -INT32_MAX) {
        return fixed_saturated(wide < 0, saturations);
    }
    return (int32_t)wide;
}

inline int32_t fixed_add(int32_t a, int32_t b, uint32_t *saturations) {
    int32_t sum;
    if (__builtin_add_overflow(a, b, &sum) || sum == INT32_MIN) {
        return fixed_saturated(a < 0, saturations); /* both have the sign of a */
    }
    return sum;
}

inline int32_t fixed_subtract(int32_t a, int32_t b, uint32_t *saturations) {
    int32_t difference;
    if (__builtin_sub_overflow(a, b, &difference) || difference == INT32_MIN) {
        return fixed_saturated(a < 0, saturations);
    }
    return difference;
}

inline int32_t fixed_clamp(int32_t value, int32_t low, int32_t high) {
    if (value < low) {
        return low;
    }
    return value > high ? high : value;
}

inline int32_t fixed_scale(int32_t quantity, ratio_t ratio, uint32_t *saturations) {
    const bool negative = quantity < 0;
    const uint32_t magnitude = negative ? 0u - (uint32_t)quantity : (uint32_t)quantity;
    const uint64_t product = (uint64_t)magnitude * ratio.mantissa; /* < 2^62 */
    uint32_t doubled; /* twice the result, which rounds by its last bit */
    if (ratio.shift > 32) {
        const int32_t rest = ratio.shift - 33;
        doubled = rest > 31 ? 0 : (uint32_t)(product >> 32) >> rest;
    } else if (ratio.shift > 0) {
        const uint64_t wide = product >> (ratio.shift - 1);
        if (wide >= UINT32_MAX) { /* also UINT32_MAX itself, which would round up to 2^31 */
            return fixed_saturated(negative, saturations);
        }
        doubled = (uint32_t)wide;
    } else if (product == 0) {
        return 0;
    } else { /* the ratio is 2^30 or more */
        return fixed_saturated(negative, saturations);
    }
    const int32_t result = (int32_t)((doubled >> 1) + (doubled & 1u));
    return negative ? -result : result;
}

#endif
