/* ticks.h: virtual time.
 *
 * `now` counts ticks since power-on; a tick is 1/65536 of a period of 336 MHz, the least common
 * multiple of the usual 16 MHz and 168 MHz core clocks, so both are exact. Each executed
 * instruction moves it by one core cycle (times the option); WFI moves it to the next event.
 */
#ifndef EMULATED_TICKS_H
#define EMULATED_TICKS_H

#include <stdint.h>

typedef uint64_t tick_t;
#define TICKS_PER_SECOND (336000000ull << 16)
#define TICKS_PER_US (336ull << 16)
#define NEVER UINT64_MAX

#endif
