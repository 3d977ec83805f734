"""Writes the CRC-32 of the linked image into it, where the program looks for it (image.h).

The image is what a programmer writes into the flash: everything up to the symbol `_image_crc`.
Needs only Python's own library and the arm-none-eabi binutils; exit status 1 with what is wrong.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path
from typing import Final

TOOLS: Final = "arm-none-eabi-"
FLASH: Final = 0x08000000
CRC_BYTES: Final = 4


def main() -> int:
    """Compute and write it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("elf", type=Path, help="is changed")
    elf: Path = parser.parse_args().elf
    with tempfile.TemporaryDirectory() as folder:
        binary, crc = Path(folder, "image"), Path(folder, "crc")
        subprocess.run([f"{TOOLS}objcopy", "-O", "binary", elf, binary], check=True)
        image = binary.read_bytes()[:-CRC_BYTES]
        place, end = _address(elf, "_image_crc"), FLASH + len(image)
        if place != end:
            sys.stderr.write(
                f"image_crc: found _image_crc at 0x{place:08X}; accepted: 0x{end:08X}, the end of "
                "an image without gaps\n"
            )
            return 1
        crc.write_bytes(zlib.crc32(image).to_bytes(CRC_BYTES, "little"))
        subprocess.run(
            [f"{TOOLS}objcopy", "--update-section", f".image_crc={crc}", elf], check=True
        )
    return 0


def _address(elf: Path, symbol: str) -> int:
    """Where the linker put a symbol; 0 when there is none."""
    listing = subprocess.run([f"{TOOLS}nm", elf], check=True, capture_output=True, text=True).stdout
    rows = [line.split() for line in listing.splitlines()]
    return next((int(row[0], 16) for row in rows if row[-1] == symbol and len(row) == 3), 0)


if __name__ == "__main__":
    sys.exit(main())
