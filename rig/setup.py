"""Builds the wheel of the simulated rig: compiles the firmware for this machine and packs it in."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path
from typing import Any

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

FIRMWARE = Path(__file__).resolve().parents[1] / "firmware"
PACKED = ("libbowden_native.so", "native.cdef")


class BuildWithFirmware(build_py):
    """Copies the native firmware beside the modules; an editable install reads build/native."""

    def run(self) -> None:
        """Build the package."""
        super().run()
        if self.editable_mode:
            return
        folder = Path(self.build_lib) / "bowden_rig" / "firmware"
        build = Path(self.build_lib).resolve().parent / "firmware"
        subprocess.run(["make", "-C", FIRMWARE, "native", f"BUILD={build}"], check=True)
        folder.mkdir(parents=True, exist_ok=True)
        for name in PACKED:
            (folder / name).write_bytes((build / "native" / name).read_bytes())


class PlatformWheel(bdist_wheel):
    """Any Python 3, this platform: the library is plain C and is loaded through cffi."""

    def get_tag(self) -> tuple[Any, Any, Any]:
        """Return the wheel's tags."""
        return "py3", "none", sysconfig.get_platform().replace("-", "_").replace(".", "_")


setup(cmdclass={"build_py": BuildWithFirmware, "bdist_wheel": PlatformWheel})
