"""Resistance and inductance of the motor from its current under an alternating voltage.

The drive puts out a tenth of its supply, turned round at 0.8 A or after 2 ms, and keeps the current
of each 50 us for 10 ms. From sample to sample a winding's current goes i' = phi i + (1 - phi) u / R
with phi = exp(-R T / L): a straight line in i and u, of which R and L follow. The bridge's dead
time takes from u, against the current. The current changes its sign all the time, so the load may
be free or locked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.commission.measures import Measured
from bowden.drive.client import Drive
from bowden.drive.dictionary import lookup
from bowden.drive.meanings import ModeOfOperation, WindingTestState
from bowden.drive.power import Run, powered
from bowden.errors import BadInput

PERIOD_S = 50e-6
SAMPLES = 200
_LEAST_SAMPLES = 40
_TRACE_TAKES_S = 0.05  # 10 ms, and what enabling takes
#: Dead time, of the voltage: 0.5 us of each leg in 50 us are 2 % of the supply (current_monitor.c).
_LOST_SHARE = 0.2
#: Of the converter, 8 mA: a smaller current has no sure sign, and so no sure dead time.
_SURE_SIGN_A = 0.012
#: Wider intervals, as a share of the number itself, are refused: the gains bear half and double.
_MOST_SHARE = 0.2


@dataclass(frozen=True)
class Winding:
    """Resistance (Ohm) and inductance (H), with 95 % intervals."""

    resistance: Measured
    inductance: Measured


def read_trace(drive: Drive) -> tuple[NDArray[np.int64], float] | None:
    """Have the drive trace its winding; the bridge is on for 50 ms.

    Returns
    -------
    raw : ndarray of int64, shape (200,), and float, V
        `winding_trace` as it comes, and the voltage; None where the board has no such measurement.

    Raises
    ------
    DriveFailed
        A fault, or a step that the drive does not take.
    """
    with powered(drive, Run(ModeOfOperation.WINDING)):
        drive.connection.listen(_TRACE_TAKES_S)
    if drive.read_raw("winding_test.state") != WindingTestState.DONE:
        return None
    raw = [drive.read_raw(f"winding_trace.{place}") for place in range(1, SAMPLES + 1)]
    return np.array(raw, dtype=np.int64), drive.read("winding_test.voltage")


def winding_of(raw: NDArray[np.int64], voltage_v: float) -> Winding:
    """Find resistance and inductance from a trace.

    Parameters
    ----------
    raw : ndarray of int64, shape (n,)
        Current in uA every 50 us; lowest bit: the sign of the voltage put out from then on.
    voltage_v : float, V
        Its magnitude.

    Raises
    ------
    BadInput
        What no winding within the drive's ranges does, or what is not known well enough.
    """
    current_a = 1e-6 * (raw & ~1)
    sign = np.where(raw & 1, 1.0, -1.0)
    here, after = current_a[1:-1], current_a[2:]
    lost = _LOST_SHARE * np.sign(here)
    # A voltage acts a period later than its sample, but for the moment between sample and update.
    now, before = sign[1:-1] - lost, sign[:-2] - lost
    columns = np.stack([here, voltage_v * now, voltage_v * before, np.ones(here.size)], axis=1)
    sure = (np.minimum(abs(here), abs(after)) > _SURE_SIGN_A) & (here * after > 0.0)
    columns, after = columns[sure], after[sure]
    if len(after) < _LEAST_SAMPLES or np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise BadInput("winding", "no current under the voltage", "a motor that is connected")
    found = np.linalg.lstsq(columns, after, rcond=None)[0]
    phi, gain = float(found[0]), float(found[1] + found[2])
    if not 0.0 < phi < 1.0 or gain <= 0.0:
        text = f"a current that does not follow the voltage (decay {phi:.3f}, gain {gain:.3g} A/V)"
        raise BadInput("winding", text, "a winding with resistance and inductance")
    noise = float(np.sum((after - columns @ found) ** 2)) / (after.size - found.size)
    of_both = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0]])  # phi and gain
    covariance = noise * of_both @ np.linalg.inv(columns.T @ columns) @ of_both.T
    resistance = (1.0 - phi) / gain
    inductance = -resistance * PERIOD_S / np.log(phi)
    by_gain = -1.0 / gain
    by_phi = -1.0 / (1.0 - phi)
    return Winding(
        _measured("motor_resistance", resistance, np.array([by_phi, by_gain]), covariance),
        _measured(
            "motor_inductance",
            inductance,
            np.array([by_phi - 1.0 / (phi * np.log(phi)), by_gain]),
            covariance,
        ),
    )


def _measured(
    name: str, value: float, relative: NDArray[np.float64], covariance: NDArray[np.float64]
) -> Measured:
    """Return a value with its interval; `relative`: its relative change with phi and gain."""
    entry = lookup(name)
    scale = entry.scale or 1.0
    low, high = entry.low * scale, entry.high * scale
    if not low <= value <= high:
        raise BadInput(name, f"{value:.4g} {entry.unit}", f"{low:g} .. {high:g} {entry.unit}")
    share = 1.96 * float(np.sqrt(relative @ covariance @ relative))
    if share > _MOST_SHARE:
        text = f"{value:.3g} {entry.unit}, known to {share:.0%} only"
        raise BadInput(name, text, f"at most {_MOST_SHARE:.0%}: enter the data sheet's number")
    return Measured(value, value * (1.0 - share), value * (1.0 + share))
