/* quadrature.h: a 16-bit encoder counter followed over any number of turns, and checked. Pure.
 *
 * What can be seen of a broken wire: between two index pulses lies a whole number of turns. When A
 * or B breaks, counting stops in mid-turn and the next index comes too early; when the index breaks
 * it fails to come. What cannot be seen here: an encoder that stands still because all of it is
 * dead, before the first two index pulses anything at all, and a wire that broke at the index.
 */
#ifndef BOWDEN_STM32F405_QUADRATURE_H
#define BOWDEN_STM32F405_QUADRATURE_H

#include <stdbool.h>
#include <stdint.h>

/* Counts that an index pulse may lie off a whole turn: its width from the other side, and the
 * latency of its interrupt. */
#define QUADRATURE_INDEX_TOLERANCE 8

/* Most counts in one control period: 8 million a second, beyond any encoder's output. */
#define QUADRATURE_STEP_MAX 2000

/* What the hardware has seen since the last step. */
typedef struct {
    uint16_t timer;    /* the counter now */
    bool index;        /* an index pulse has come, ... */
    uint16_t at_index; /* ... at this count of the timer */
} quadrature_input_t;

typedef struct {
    int32_t counts; /* since start, modulo 2^32 */
    uint16_t timer;
    bool indexed;
    int32_t at_index;
    bool passed; /* the index, in this step, in positive direction */
} quadrature_t;

/* One control period. counts_per_turn 16 .. 1048576. Returns false for impossible input. */
bool quadrature_step(quadrature_t *quadrature, const quadrature_input_t *input,
                     uint32_t counts_per_turn);

#endif
