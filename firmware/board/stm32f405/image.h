/* image.h: is the program in the flash the one that was built?
 *
 * The build puts the image's length in words behind the vector table and its CRC-32 behind its last
 * word (image_crc.py), the same that zlib.crc32 computes over all bytes before it. A boot loader or
 * a debugger finds both without the ELF: length at 0x08000188.
 */
#ifndef BOWDEN_STM32F405_IMAGE_H
#define BOWDEN_STM32F405_IMAGE_H

#include <stdbool.h>

/* Computes the CRC of the whole image with the chip's unit: about ten cycles a word, 1.4 ms for
 * 90 KiB. Once, at start, before anything can switch the bridge on. */
bool image_is_whole(void);

#endif
