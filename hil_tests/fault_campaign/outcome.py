"""What a fault did: noticed by what, bridge off how soon, what reached the operator.

Excess torque is what lies outside the hull of two runs without the fault: healthy, and with the
bridge off from the onset. Between them nothing is wrong: a drive may go on or stop, or do a part of
either. Its integral over time counts until 20 ms after the bridge is off: what friction then keeps
in the cables, the motor no longer makes.

Ceilings. 20 ms of the motor's full torque at the load is less than an operator can react to: the
short latency of the stretch reflex is 20 to 50 ms. 0.05 J lifts a forearm and hand of 1.5 kg by 3.4
mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from bowden_rig.bench import TICKS_PER_S

from hil_tests.fault_campaign.faults import Fault
from hil_tests.fault_campaign.situations import MOTOR_LIMIT_NM, RATIO, Situation
from hil_tests.fault_campaign.trial import Trace

IMPULSE_CEILING_NMS: Final = 0.02 * MOTOR_LIMIT_NM * RATIO
ENERGY_CEILING_J: Final = 0.05
AFTERGLOW_S: Final = 0.02
WARNINGS: Final = frozenset({0xFF01})


@dataclass(frozen=True)
class Outcome:
    """One row of the table.

    Parameters
    ----------
    target, situation, fault : str
        Names.
    told : int or None
        First EMCY code after the onset that is no warning, or else the first warning.
    told_s, off_s : float or None, s
        After the onset; None: not within the horizon.
    impulse_nms : float, N m s
        Excess torque over time at the load.
    energy_j : float, J
        Work that the excess torque has done on the load.
    peak_nm : float, N m
        Largest excess torque.
    switched_on : bool
        The bridge was off and went on.
    """

    target: str
    situation: str
    fault: str
    told: int | None
    told_s: float | None
    off_s: float | None
    impulse_nms: float
    energy_j: float
    peak_nm: float
    switched_on: bool

    @property
    def name(self) -> str:
        """``native/tunnel-none/load_encoder-frozen``."""
        return f"{self.target}/{self.situation}/{self.fault}"

    @property
    def holds(self) -> bool:
        """Return whether both ceilings hold and the bridge has not gone on by itself."""
        below = self.impulse_nms <= IMPULSE_CEILING_NMS and self.energy_j <= ENERGY_CEILING_J
        return below and not self.switched_on


def judge(
    target: str, where: Situation, fault: Fault, run: Trace, references: tuple[Trace, Trace]
) -> Outcome:
    """Compare a run with its references: healthy, and with the bridge cut at the onset."""
    healthy, cut = references
    low = np.minimum(healthy.load_torque_nm, cut.load_torque_nm)
    high = np.maximum(healthy.load_torque_nm, cut.load_torque_nm)
    excess = run.load_torque_nm - np.clip(run.load_torque_nm, low, high)
    off = None
    if where.bridge_on and not run.bridge_on.all():
        off = int(np.argmin(run.bridge_on))
    last = len(excess) if off is None else off + round(AFTERGLOW_S * TICKS_PER_S)
    counted = excess[:last]
    power = np.maximum(counted * run.load_speed_rad_per_s[:last], 0.0)
    told = [*(e for e in run.emergencies if e[1] not in WARNINGS), *run.emergencies]
    return Outcome(
        target=target,
        situation=where.name,
        fault=fault.name,
        told=told[0][1] if told else None,
        told_s=told[0][0] if told else None,
        off_s=None if off is None else (off + 1) / TICKS_PER_S,
        impulse_nms=float(np.sum(np.abs(counted)) / TICKS_PER_S),
        energy_j=float(np.sum(power) / TICKS_PER_S),
        peak_nm=float(np.max(np.abs(counted), initial=0.0)),
        switched_on=not where.bridge_on and bool(run.bridge_on.any()),
    )
