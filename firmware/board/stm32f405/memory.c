/* memory.c: the three functions that the compiler itself may call; there is no C library.
 *
 * By words where the addresses allow it, to clear by four: the drive does both in every tick.
 * Compiled with -fno-tree-loop-distribute-patterns, or they would be compiled into calls of
 * themselves.
 */
#include <stddef.h>
#include <stdint.h>

typedef uint32_t __attribute__((may_alias)) word_t;

void *memcpy(void *to, const void *from, size_t size);
void *memmove(void *to, const void *from, size_t size);
void *memset(void *to, int value, size_t size);

void *memcpy(void *to, const void *from, size_t size) {
    uint8_t *out = to;
    const uint8_t *in = from;
    if ((((uintptr_t)out | (uintptr_t)in) & 3u) == 0) {
        for (; size >= 4; size -= 4, out += 4, in += 4) {
            *(word_t *)(void *)out = *(const word_t *)(const void *)in;
        }
    }
    for (; size > 0; size--) {
        *out++ = *in++;
    }
    return to;
}

void *memmove(void *to, const void *from, size_t size) {
    uint8_t *out = to;
    const uint8_t *in = from;
    if ((uintptr_t)out - (uintptr_t)in >= size) { /* also when out is below in: it wraps */
        return memcpy(to, from, size);
    }
    while (size > 0) {
        size--;
        out[size] = in[size];
    }
    return to;
}

void *memset(void *to, int value, size_t size) {
    uint8_t *out = to;
    const uint8_t byte = (uint8_t)value;
    const uint32_t word = byte * 0x01010101u;
    for (; size > 0 && ((uintptr_t)out & 3u) != 0; size--) {
        *out++ = byte;
    }
    for (; size >= 16; size -= 16, out += 16) {
        word_t *four = (void *)out;
        four[0] = word;
        four[1] = word;
        four[2] = word;
        four[3] = word;
    }
    for (; size >= 4; size -= 4, out += 4) {
        *(word_t *)(void *)out = word;
    }
    for (; size > 0; size--) {
        *out++ = byte;
    }
    return to;
}
