/* quadrature.c: see quadrature.h. */
#include "quadrature.h"

/* later - earlier of 16-bit counts; the shortest way round. */
static int32_t difference(uint16_t later, uint16_t earlier) {
    return (int16_t)(uint16_t)(later - earlier);
}

/* Sums and differences of counts wrap like the counter; the compilers used define the casts. */
static int32_t add(int32_t counts, int32_t step) {
    return (int32_t)((uint32_t)counts + (uint32_t)step);
}

static uint32_t distance(int32_t a, int32_t b) {
    const uint32_t forwards = (uint32_t)a - (uint32_t)b;
    return forwards <= INT32_MAX ? forwards : 0u - forwards;
}

static bool is_whole_turns(uint32_t counts, uint32_t counts_per_turn) {
    const uint32_t past = counts % counts_per_turn;
    return past <= QUADRATURE_INDEX_TOLERANCE ||
           counts_per_turn - past <= QUADRATURE_INDEX_TOLERANCE;
}

bool quadrature_step(quadrature_t *quadrature, const quadrature_input_t *input,
                     uint32_t counts_per_turn) {
    const int32_t step = difference(input->timer, quadrature->timer);
    bool plausible = step >= -QUADRATURE_STEP_MAX && step <= QUADRATURE_STEP_MAX;
    quadrature->passed = false;
    if (input->index) {
        /* From the counter of the last step, not to that of this: the pulse may be later than it.
         */
        const int32_t way = difference(input->at_index, quadrature->timer);
        const int32_t at = add(quadrature->counts, way);
        quadrature->passed = way > 0;
        plausible &= !quadrature->indexed ||
                     is_whole_turns(distance(at, quadrature->at_index), counts_per_turn);
        quadrature->indexed = true;
        quadrature->at_index = at;
    }
    quadrature->counts = add(quadrature->counts, step);
    quadrature->timer = input->timer;
    const uint32_t since_index = distance(quadrature->counts, quadrature->at_index);
    plausible &= !quadrature->indexed || since_index <= 2u * counts_per_turn;
    return plausible;
}
