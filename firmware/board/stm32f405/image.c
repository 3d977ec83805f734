/* image.c: see image.h. RM0090 chapter 4: the unit takes words, highest bit first; CRC-32 as the
 * world computes it takes the lowest bit first, so words go in and the result comes out reversed.
 */
#include "image.h"

#include "registers.h"

extern const uint32_t _image_start[], _image_crc[];

bool image_is_whole(void) {
    RCC->AHB1ENR |= RCC_AHB1ENR_CRCEN;
    core_barrier();
    CRC->CR = CRC_CR_RESET;
    for (const uint32_t *word = _image_start; word < _image_crc; word++) {
        CRC->DR = core_reversed(*word);
    }
    return core_reversed(~CRC->DR) == *_image_crc;
}
