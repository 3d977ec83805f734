/* crc.c: the CRC calculation unit (RM0090 chapter 4): 0x04C11DB7, words, highest bit first. */
#include "chip.h"

enum { DR = 0x00, IDR = 0x04, CR = 0x08, POLYNOMIAL = 0x04C11DB7 };

static uint32_t with_word(uint32_t crc, uint32_t word) {
    crc ^= word;
    for (int bit = 0; bit < 32; bit++) {
        crc = crc >> 31 ? crc << 1 ^ POLYNOMIAL : crc << 1;
    }
    return crc;
}

uint32_t crc_read(const machine_t *m, uint32_t offset) {
    return offset == DR ? m->crc.dr : offset == IDR ? m->crc.idr : 0;
}

void crc_write(machine_t *m, uint32_t offset, uint32_t value) {
    if (offset == DR) {
        m->crc.dr = with_word(m->crc.dr, value);
    } else if (offset == IDR) {
        m->crc.idr = (uint8_t)value;
    } else if (offset == CR && (value & 1u)) {
        m->crc.dr = 0xFFFFFFFFu;
    }
}

void crc_reset(machine_t *m) {
    m->crc.dr = 0xFFFFFFFFu;
    m->crc.idr = 0;
}
