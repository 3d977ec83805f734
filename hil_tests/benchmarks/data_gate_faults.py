"""Faults that a recording may hold, as changes of a good one, and what the gate should say of each.

`data_gate` applies them to recordings of the independent solver. `Fault.named` is true where a
finding names the fault; no code of the gate is used here beyond its findings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from bowden.estimation.gate.finding import Finding
from bowden.recording.recording import Recording
from numpy.typing import NDArray

MOTOR, LOAD = "motor_angle_rad", "load_angle_rad"
MOTOR_NM, LOAD_NM = "motor_torque_nm", "load_torque_nm"
COUNTS: Final = {MOTOR: 2000, LOAD: 10000}
RADII_M: Final = {MOTOR_NM: 0.020, LOAD_NM: 0.104}
TORQUE_CONSTANT: Final = 0.0525  # N m/A
CELL_NOISE_NM: Final = 5e-4

Change = Callable[[Recording], Recording]


@dataclass(frozen=True)
class Fault:
    """One fault.

    Parameters
    ----------
    name : str
        For the table.
    change : callable
    what : str
        The finding's kind.
    words : str
        What its text must hold.
    """

    name: str
    change: Change
    what: str
    words: str = ""

    def named(self, found: Sequence[Finding]) -> bool:
        """Return whether the findings name it."""
        return any(one.what == self.what and self.words in one.text for one in found)


def smooth_angles(one: Recording) -> Recording:
    """Return a recording whose angles show no counts: dithered, averaged over 15 ms."""
    rng = np.random.default_rng(3)
    changed: dict[str, NDArray[np.float64]] = {}
    for name, counts in COUNTS.items():
        dithered = one[name] + rng.uniform(-0.5, 0.5, one.time_s.size) * 2.0 * np.pi / counts
        wide = np.pad(dithered, 7, mode="edge")
        changed[name] = np.convolve(wide, np.ones(15) / 15.0, "valid")
        changed[name] += rng.normal(0.0, 1e-5, one.time_s.size)
    return one.with_channels(changed)


def _scaled(factors: Mapping[str, float], *, smooth: bool = True) -> Change:
    def change(one: Recording) -> Recording:
        one = smooth_angles(one) if smooth else one
        return one.with_channels({name: f * one[name] for name, f in factors.items()})

    return change


def _swapped(first: str, second: str) -> Change:
    return lambda one: one.with_channels({first: one[second], second: one[first]})


def _stepped(size_nm: float) -> Change:
    def change(one: Recording) -> Recording:
        later = one.time_s >= 0.45 * one.time_s[-1]
        return one.with_channels({LOAD_NM: one[LOAD_NM] + size_nm * later})

    return change


def _clipped(share: float) -> Change:
    def change(one: Recording) -> Recording:
        noise = np.random.default_rng(9).normal(0.0, CELL_NOISE_NM, one.time_s.size)
        most = share * float(np.abs(one[LOAD_NM]).max())
        return one.with_channels({LOAD_NM: np.clip(one[LOAD_NM], -most, most) + noise})

    return change


def _clock(rate: float) -> Change:
    def change(one: Recording) -> Recording:
        at = one.time_s * (1.0 - rate)
        names = (MOTOR_NM, LOAD_NM)
        return one.with_channels({name: np.interp(at, one.time_s, one[name]) for name in names})

    return change


def _coarse(one: Recording) -> Recording:
    step = 2.0 * np.pi / 500.0
    return one.with_channels({MOTOR: np.round(one[MOTOR] / step) * step})


def _spiked(one: Recording) -> Recording:
    values = one[LOAD_NM].copy()
    values[[int(share * values.size) for share in (0.1, 0.3, 0.5, 0.7)]] += 3.0
    return one.with_channels({LOAD_NM: values})


def _dropped(one: Recording) -> Recording:
    values = one[LOAD_NM].copy()
    for start_s in (9.0, 15.0):
        values[(one.time_s >= start_s) & (one.time_s < start_s + 0.4)] = 0.0
    return one.with_channels({LOAD_NM: values})


def _stuck(one: Recording) -> Recording:
    return one.with_channels({LOAD_NM: np.full(one.time_s.size, float(one[LOAD_NM][0]))})


_DEGREES = 180.0 / np.pi
_TURNS = 0.5 / np.pi


def _faults() -> list[Fault]:
    found = []
    for unit, factor in (("degrees", _DEGREES), ("turns", _TURNS), ("mrad", 1e3)):
        for names, words in (
            ((MOTOR,), "motor angle seems"),
            ((LOAD,), "load angle seems"),
            ((MOTOR, LOAD), "motor angle and load angle seem"),
        ):
            title = " and ".join(name.rpartition("_")[0].replace("_", " ") for name in names)
            change = _scaled(dict.fromkeys(names, factor))
            text = f"{words} to be in {unit}"
            found.append(Fault(f"{title} in {unit}, no counts seen", change, "units", text))
    found.append(
        Fault(
            "load angle in degrees, counts seen",
            _scaled({LOAD: _DEGREES}, smooth=False),
            "units",
            "load angle seems to be in degrees",
        )
    )
    found.append(
        Fault(
            "motor angle in counts",
            _scaled({MOTOR: COUNTS[MOTOR] / (2.0 * np.pi)}, smooth=False),
            "units",
            "motor angle seems to be in encoder counts",
        )
    )
    for unit, each in (
        ("mN m", dict.fromkeys(RADII_M, 1e3)),
        ("N cm", dict.fromkeys(RADII_M, 1e2)),
        ("N at the pulley's radius", {name: 1.0 / radius for name, radius in RADII_M.items()}),
    ):
        for names, words in (
            ((MOTOR_NM,), "motor torque seems"),
            ((LOAD_NM,), "load torque seems"),
            ((MOTOR_NM, LOAD_NM), "motor torque and load torque seem"),
        ):
            title = " and ".join(name.rpartition("_")[0].replace("_", " ") for name in names)
            change = _scaled({name: each[name] for name in names}, smooth=False)
            found.append(Fault(f"{title} in {unit}", change, "units", f"{words} to be in {unit}"))
    found += [
        Fault(
            "motor torque in A (0.0525 N m/A)",
            _scaled({MOTOR_NM: 1.0 / TORQUE_CONSTANT}, smooth=False),
            "units",
            "in A, for a torque constant",
        ),
        *(
            Fault(
                f"sign of the {words}",
                _scaled({name: -1.0}, smooth=False),
                "sign",
                f"{words} has the wrong sign",
            )
            for name, words in (
                (MOTOR, "motor angle"),
                (LOAD, "load angle"),
                (MOTOR_NM, "motor torque"),
                (LOAD_NM, "load torque"),
            )
        ),
        Fault("torques swapped", _swapped(MOTOR_NM, LOAD_NM), "swapped", "motor and load torque"),
        Fault("angles swapped", _swapped(MOTOR, LOAD), "swapped", "motor and load angle"),
        Fault("zero of the cell steps by 0.2 N m", _stepped(0.2), "zero_step"),
        Fault("zero of the cell steps by 0.05 N m", _stepped(0.05), "zero_step"),
        Fault("cell clipped at 60 %, noise on top", _clipped(0.6), "clipped"),
        Fault("cell clipped at 80 %, noise on top", _clipped(0.8), "clipped"),
        Fault("clock of the torques 0.5 % off", _clock(0.005), "clock"),
        Fault("motor encoder of 500 counts, file says 2000", _coarse, "resolution", "500 counts"),
        Fault("spikes in the cell", _spiked, "spikes"),
        Fault("dropouts of the cell", _dropped, "held"),
        Fault("cell stuck", _stuck, "constant"),
    ]
    return found


FAULTS: Final = tuple(_faults())
"""Every fault of the table, in its order."""
